"""An accounting database for the tests' cluster: MariaDB and Slurm's daemon in front of it."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import tempfile
import time
from pathlib import Path

INSTALL = "apt-get install -y --no-install-recommends slurmdbd mariadb-server"
#: What a controller is told that has one.
CONFIGURATION = """AccountingStorageType=accounting_storage/slurmdbd
AccountingStorageHost=localhost
"""
_PORT = 6819
_FOLDER = Path("/etc/slurm")
_DAEMON = """AuthType=auth/munge
DbdHost=localhost
DbdPort={port}
SlurmUser=root
PidFile={run}/slurmdbd.pid
LogFile={run}/slurmdbd.log
StorageType=accounting_storage/mysql
StorageHost=localhost
StorageUser=slurm
StoragePass=slurm
StorageLoc=slurm_acct
"""
_PREPARE = """create database if not exists slurm_acct;
create user if not exists 'slurm'@'localhost' identified by 'slurm';
grant all on slurm_acct.* to 'slurm'@'localhost';"""


def why_not() -> str | None:
    """Why no accounting can be started here, with what to do; None where it can."""
    missing = [name for name in ("slurmdbd", "mariadbd") if not shutil.which(name)]
    return f"{', '.join(missing)} not found: {INSTALL}" if missing else None


class Accounting:
    """The database and its daemon while a `with` lasts; munge must run."""

    def __init__(self):
        # The database's user must get there, so it does not lie below a folder of pytest's.
        self.run = Path(tempfile.mkdtemp(prefix="vermilion-accounting-"))

    def __enter__(self) -> Accounting:
        data, socket_file = self.run / "data", self.run / "mysqld.sock"
        self.run.chmod(0o755)
        shutil.chown(self.run, "mysql")
        made = ["mariadb-install-db", "--user=mysql", f"--datadir={data}"]
        made += [f"--tmpdir={self.run}"]
        subprocess.run(made, check=True, capture_output=True)
        words = ["mariadbd", "--no-defaults", "--user=mysql", f"--datadir={data}"]
        words += [f"--socket={socket_file}", "--skip-networking"]
        words += [f"--tmpdir={self.run}", "--innodb_buffer_pool_size=128M"]
        with open(self.run / "mariadb.log", "w") as log:
            self._database = subprocess.Popen(words, stdout=log, stderr=log)
        client = ["mariadb", f"--socket={socket_file}", "-e"]
        self._until(
            lambda: subprocess.run([*client, "select 1"], capture_output=True).returncode == 0
        )
        subprocess.run([*client, _PREPARE], check=True)
        known = Path("/run/mysqld")
        known.mkdir(exist_ok=True)
        (known / "mysqld.sock").unlink(missing_ok=True)
        (known / "mysqld.sock").symlink_to(socket_file)
        configuration = _FOLDER / "slurmdbd.conf"
        configuration.write_text(_DAEMON.format(port=_PORT, run=self.run))
        configuration.chmod(0o600)
        subprocess.run(["slurmdbd"], check=True)
        self._until(self._answers)
        return self

    def __exit__(self, *_: object) -> None:
        pid = self.run / "slurmdbd.pid"
        if pid.exists():
            os.kill(int(pid.read_text()), 15)
        self._database.terminate()
        self._database.wait(timeout=60)
        for path in (_FOLDER / "slurmdbd.conf", Path("/run/mysqld/mysqld.sock")):
            path.unlink(missing_ok=True)
        shutil.rmtree(self.run, ignore_errors=True)

    def register(self, cluster: str) -> None:
        """Make the cluster, an account and root's place in it known."""
        for words in (
            ["cluster", cluster],
            ["account", "main", f"cluster={cluster}"],
            ["user", "root", "account=main"],
        ):
            subprocess.run(["sacctmgr", "-i", "add", *words], capture_output=True)

    @staticmethod
    def _answers() -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", _PORT)) == 0

    @staticmethod
    def _until(holds, seconds: float = 120.0) -> None:
        end = time.monotonic() + seconds
        while not holds():
            if time.monotonic() > end:
                raise RuntimeError(f"no accounting within {seconds:.0f} s")
            time.sleep(0.2)
