"""The regressor's input: shape coefficients and relative contour distances (Lips16 5.1)."""
