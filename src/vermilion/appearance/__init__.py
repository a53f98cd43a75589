"""Albedo and lighting of a face at samples of its skin (Lips16 3.2)."""
