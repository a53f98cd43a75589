"""Pose and blend weights of a take from its landmarks (Mono13 6)."""
