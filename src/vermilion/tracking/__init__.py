"""Fitting the coarse face model to landmarks: identity, pose and blend weights (Mono13 6)."""
