"""Captures as they come: checked pictures and calibrated cameras (Lips16 3.1)."""
