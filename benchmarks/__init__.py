"""Speed and accuracy against peers and against the papers: `python -m benchmarks`."""
