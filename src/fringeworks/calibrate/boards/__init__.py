"""Finding a board's corners in an image: checkerboard, ChArUco, circles."""
