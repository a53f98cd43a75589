"""What made a result: fingerprints of code, checksums of files, keys of the shared cache."""
