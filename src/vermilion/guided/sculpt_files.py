"""Names of sculpted meshes. Imports nothing: the workflow reads it whenever it starts."""

USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
#: Files of a sculpted frame, `labels/sculpts/<frame:06d>.<suffix>`.
SCULPT_SUFFIXES = (".obj", ".ply", *USD_SUFFIXES)
