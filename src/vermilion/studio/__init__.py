"""Synthetic captures: actors, performances, a rig, light and pictures."""
