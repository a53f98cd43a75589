"""Dense refinement of the coarse track from the pictures themselves (Lips16 3.2)."""
