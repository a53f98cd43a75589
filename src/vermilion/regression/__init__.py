"""Regressors from lip features to correction layers, their selection and their files."""
