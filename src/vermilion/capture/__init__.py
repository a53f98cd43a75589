"""Checked images and calibrated cameras of a capture (Lips16 3.1)."""
