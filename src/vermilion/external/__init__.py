"""Mesh sequences of other trackers: files, and such a sequence as the base of a run."""
