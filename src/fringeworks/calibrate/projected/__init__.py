"""The paper's way: the camera from the printed board, the projector from a projected one."""
