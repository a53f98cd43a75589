"""Synthetic captures: actors, performances, a rig, light and images."""
