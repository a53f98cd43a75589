"""Which point of the accurate mesh belongs to which vertex of the coarse one (Lips16 4.1)."""
