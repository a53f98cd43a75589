"""Geometry-guided removal of a lip tattoo (Lips16 3.2.1)."""
