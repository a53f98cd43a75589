"""Two faults of the storage plugin for S3 (0.3), mended at the start of a run."""

from __future__ import annotations

from typing import Any


def mend_bucket_files(kind: type[Any]) -> None:
    """Make files of a bucket obey the wildcards' constraints, and folders be found once they are there.

    Outputs are matched by the paths of their local copies. Snakemake adds the constraints to an output's
    address; the plugin takes the path from the address before that. And where an address was no folder when
    the run was planned, the plugin remembers that after the folder was stored.

    Args:
        kind: the plugin's class of a file in a bucket.
    """

    def local_suffix(self: Any) -> str:
        return str(self.query).partition("://")[2]

    def is_dir(self: Any) -> bool:
        if not self._is_dir:
            self._is_dir = any(self.get_subkeys())
        return bool(self._is_dir)

    kind.local_suffix = local_suffix
    if hasattr(kind, "get_subkeys"):
        kind.is_dir = is_dir
