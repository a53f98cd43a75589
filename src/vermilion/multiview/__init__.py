"""From calibrated cameras to H, the registered high-quality mesh sequence (Lips16 3.1)."""
