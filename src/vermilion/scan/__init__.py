"""A tracker's face model of one person from a 3D scan (Mono13 4, Lips16 3.2)."""
