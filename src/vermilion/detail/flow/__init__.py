"""Dense correction of the coarse mesh by six-frame optical flow (Mono13 section 7)."""
