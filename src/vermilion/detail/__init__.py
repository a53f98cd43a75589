"""Sequences finer than the coarse track (Mono13 7 and 8)."""
