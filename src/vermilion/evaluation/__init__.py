"""Accuracy: errors against truth or a held-out reconstruction, with intervals, images, report."""
