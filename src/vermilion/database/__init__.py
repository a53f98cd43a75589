"""The training database: features and correction layers of all subjects in one HDF5."""
