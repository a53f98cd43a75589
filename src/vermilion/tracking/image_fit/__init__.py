"""Pose and blend weights of each frame from its image (Lips16 3.2)."""
