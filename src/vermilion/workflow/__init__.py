"""House-keeping of the workflow: fingerprints of code, checksums of results.

The rest of the library knows nothing of rules or of the results' layout; this package does.
"""
