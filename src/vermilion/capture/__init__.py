"""Captures as they come: checked images and calibrated cameras (Lips16 3.1)."""
