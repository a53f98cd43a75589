"""Mesh sequences of other trackers: folders of meshes, `.npz`, USD, Alembic, glTF."""
