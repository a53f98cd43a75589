"""The person: identity coefficients from landmarks and from images (Lips16 3.2)."""
