"""Files that other programs open: OBJ, USD, weights as CSV, overlay video."""
