"""User-guided lip correction (Guided18): correct a few frames, and the take follows."""
