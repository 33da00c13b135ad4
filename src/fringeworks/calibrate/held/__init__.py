"""A rig held against one new view of a board: by how much it misses, and what moved."""
