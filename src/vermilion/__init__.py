"""Vermilion: corrective 3D lips from monocular video."""

__version__ = "0.1.0"
