"""Inner and outer lip contours as likelihood maps (Lips16 3.2.2)."""
