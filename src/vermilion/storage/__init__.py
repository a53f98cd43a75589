"""Files that are written whole or not at all: arrays, tables, sequences, quality rows; errors, progress."""
