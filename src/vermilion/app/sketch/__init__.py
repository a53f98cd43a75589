"""The page on which an artist draws: a server on this machine alone, and what it serves."""
