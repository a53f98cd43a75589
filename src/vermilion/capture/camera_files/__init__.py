"""Calibrated cameras as other programs write them: Metashape, OpenCV, USD, Multiface, NeRSemble."""
