"""The correction layer: what turns a coarse mesh into an accurate one, triangle by triangle."""
