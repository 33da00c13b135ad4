"""3D measurement by fringe projection: from captured images to a measured cloud.

Data walks one straight line, and the rooms of this package are its stops: patterns -> capture ->
wrapped phase -> absolute phase -> cloud -> measurements. `fringeworks.pipeline` walks all of it.
"""

__version__ = "0.1.0.dev0"
