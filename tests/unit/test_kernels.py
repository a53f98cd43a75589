"""A compiled function is compiled by one process, and the others of the same moment wait for it."""

import os
import subprocess
import sys
import textwrap

import pytest

MODULE = """
    import math
    import sys
    import time
    from pathlib import Path

    from vermilion.storage.kernels import kernel

    @kernel(nogil=True)
    def inner(x, n):
        total = 0.0
        for i in range(n):
            total += math.sin(x * i) * math.exp(-x) if i % 3 else math.log1p(abs(x))
        return total

    @kernel()
    def outer(x, n):
        return inner(x, n) + inner(2.0 * x, n)

    if __name__ == "__main__":
        import kernels_of_test

        Path(sys.argv[1]).touch()
        while not Path(sys.argv[2]).exists():
            time.sleep(0.01)
        value = kernels_of_test.outer(0.5, 7)
        assert value == kernels_of_test.outer.py_func(0.5, 7)
        print(sum(kernels_of_test.outer.stats.cache_misses.values()))
"""


def compilations(folder):
    """How often two processes that start together, and one after them, compile `outer`."""
    (folder / "kernels_of_test.py").write_text(textwrap.dedent(MODULE))
    ready, start = [folder / "a", folder / "b"], folder / "start"
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": ""}
    together = [
        subprocess.Popen(
            [sys.executable, "kernels_of_test.py", str(one), str(start)],
            cwd=folder,
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        for one in ready
    ]
    while not all(one.exists() for one in ready):
        assert all(process.poll() is None for process in together)
    start.touch()
    printed = [process.communicate(timeout=300)[0] for process in together]
    after = subprocess.run(
        [sys.executable, "kernels_of_test.py", str(ready[0]), str(start)],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return [int(text) for text in [*printed, after.stdout]]


@pytest.mark.slow
def test_one_process_compiles_and_no_other_then_or_later(tmp_path):
    *together, after = compilations(tmp_path)
    assert sorted(together) == [0, 1]
    assert after == 0
