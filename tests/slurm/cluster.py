"""A real Slurm of two nodes on this machine, for tests: munge, a controller and two node daemons.

Needs root and Debian's packages `slurm-wlm` and `munge`. The configuration must stand in /etc/slurm, as
Snakemake's job step takes every SLURM_* variable away; a configuration that is already there is not touched.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path

import psutil

from tests.slurm.accounting import CONFIGURATION, Accounting

INSTALL = "apt-get install -y --no-install-recommends slurm-wlm munge"
_MARK = "# written by Vermilion's tests"
_FOLDER = Path("/etc/slurm")
#: One cluster at a time: they would have the same ports.
_LOCK = Path("/var/lock/vermilion-test-slurm")
_MUNGE = Path("/run/munge")
_CONFIGURATION = """{mark}
ClusterName=vermilion
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CryptoType=crypto/munge
ReturnToService=2
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SwitchType=switch/none
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=2
JobAcctGatherParams=OverMemoryKill
{accounting}SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SchedulerType=sched/backfill
SchedulerParameters=batch_sched_delay=0,sched_min_interval=0
SlurmdParameters=config_overrides
MinJobAge=600
MaxJobCount=20000
KillWait=5
SlurmctldTimeout=60
SlurmdTimeout=20
StateSaveLocation={run}/controller
SlurmdSpoolDir={run}/%n
SlurmctldPidFile={run}/slurmctld.pid
SlurmdPidFile={run}/slurmd-%n.pid
SlurmctldLogFile={run}/slurmctld.log
SlurmdLogFile={run}/slurmd-%n.log
NodeName=n1 NodeHostname={host} NodeAddr=127.0.0.1 Port=17001 CPUs={cores} RealMemory=8000 State=UNKNOWN
NodeName=n2 NodeHostname={host} NodeAddr=127.0.0.1 Port=17002 CPUs={cores} RealMemory=8000 State=UNKNOWN
PartitionName=main Nodes=n1,n2 Default=YES MaxTime=60 DefaultTime=10 State=UP
PartitionName=short Nodes=n1 MaxTime=5 DefaultTime=2 State=UP
PartitionName=closed Nodes=n1 MaxTime=60 State=UP
"""


def why_not() -> str | None:
    """Why no cluster can be started here, with what to do; None where it can."""
    missing = [name for name in ("slurmctld", "slurmd", "munged") if not shutil.which(name)]
    if missing:
        return f"{', '.join(missing)} not found: {INSTALL}"
    if os.geteuid() != 0:
        return "Slurm's daemons need root"
    configuration = _FOLDER / "slurm.conf"
    if configuration.exists() and _MARK not in configuration.read_text(encoding="utf-8"):
        return f"{configuration} belongs to a cluster of this machine and is not touched"
    return None


class Cluster:
    """The cluster while a `with` lasts; partitions `main` (60 minutes) and `short` (5 minutes)."""

    def __init__(self, run: Path, cores: int | None = None, accounting: bool = False):
        """A cluster that keeps its state in the folder `run`; `cores` a node, else half of the machine's."""
        self.run = run
        self.accounting = Accounting() if accounting else None
        self.cores = cores or max(1, (os.cpu_count() or 2) // 2)

    def __enter__(self) -> Cluster:
        self._lock = open(_LOCK, "w")
        fcntl.flock(self._lock, fcntl.LOCK_EX)
        host = socket.gethostname().partition(".")[0]
        for folder in (self.run / "controller", self.run / "n1", self.run / "n2", _FOLDER):
            folder.mkdir(parents=True, exist_ok=True)
        none = "AccountingStorageType=accounting_storage/none\n"
        accounting = CONFIGURATION if self.accounting else none
        text = _CONFIGURATION.format(
            mark=_MARK, host=host, run=self.run, cores=self.cores, accounting=accounting
        )
        (_FOLDER / "slurm.conf").write_text(text, encoding="utf-8")
        # This plugin starts without touching a mount; neither jobs nor tasks use control groups here.
        (_FOLDER / "cgroup.conf").write_text("CgroupPlugin=cgroup/v1\n", encoding="utf-8")
        self._munge = self._start_munge()
        if self.accounting:
            self.accounting.__enter__()
            self.accounting.register("vermilion")
        subprocess.run(["slurmctld", "-i"], check=True)
        for node in ("n1", "n2"):
            subprocess.run(["slurmd", "-N", node], check=True)
        self._wait(lambda: self._states().count("idle") == 2, "two idle nodes")
        return self

    def __exit__(self, *_: object) -> None:
        for name in ("slurmd-n1", "slurmd-n2", "slurmctld"):
            self._stop(self.run / f"{name}.pid")
        if self.accounting:
            self.accounting.__exit__()
        if self._munge:
            self._stop(_MUNGE / "munged.pid")
        (_FOLDER / "slurm.conf").unlink(missing_ok=True)
        (_FOLDER / "cgroup.conf").unlink(missing_ok=True)
        self._lock.close()

    def crash_node(self, node: str) -> None:
        """Drain a node, then end its daemon and all that its jobs run, as a power cut does."""
        self._update(node, "DRAIN")
        os.kill(int((self.run / f"slurmd-{node}.pid").read_text()), signal.SIGKILL)
        numbers = self._squeue("-t", "R,CG", "-w", node)
        for step in psutil.process_iter(["name", "cmdline"]):
            words = " ".join(step.info["cmdline"] or [])
            if any(f"[{number}." in words for number in numbers):
                for process in [*step.children(recursive=True), step]:
                    process.kill()

    def start_node(self, node: str) -> None:
        """Start the daemon of a node that crashed, and let jobs on it again."""
        subprocess.run(["slurmd", "-N", node], check=True)
        self._update(node, "RESUME")
        self._wait(lambda: self._states().count("idle") == 2, "two idle nodes", 120)

    def clear(self) -> None:
        """No job, and two nodes that take some, whatever a test left."""
        if not self._states():
            self.start_controller()
        subprocess.run(["scancel", "--user", "root"], check=True)
        self._wait(lambda: not self.jobs(), "empty queue", 120)
        self._wait(lambda: self._states().count("idle") == 2, "two idle nodes", 60)

    def stop_controller(self) -> None:
        """End the controller; jobs go on."""
        self._stop(self.run / "slurmctld.pid")

    def start_controller(self) -> None:
        """Start the controller with the state that it saved."""
        subprocess.run(["slurmctld"], check=True)
        self._wait(lambda: bool(self._states()), "an answer of the controller")

    @classmethod
    def jobs(cls) -> list[str]:
        """Numbers of the jobs that are pending or running."""
        return cls._squeue("-t", "PD,R,CF,CG")

    @classmethod
    def running(cls) -> list[str]:
        """Numbers of the jobs that run."""
        return cls._squeue("-t", "R")

    @staticmethod
    def _squeue(*options: str) -> list[str]:
        listing = subprocess.run(
            ["squeue", "-h", "-o", "%i", *options], capture_output=True, text=True
        )
        return listing.stdout.split()

    @staticmethod
    def _update(node: str, state: str) -> None:
        words = ["scontrol", "update", f"NodeName={node}", f"State={state}", "Reason=test"]
        subprocess.run(words, check=True)

    @staticmethod
    def _state(node: str) -> str:
        listing = subprocess.run(
            ["sinfo", "-h", "-n", node, "-p", "main", "-o", "%T"], capture_output=True, text=True
        )
        return listing.stdout.strip()

    @staticmethod
    def _states() -> list[str]:
        listing = subprocess.run(
            ["sinfo", "-h", "-N", "-p", "main", "-o", "%T"], capture_output=True, text=True
        )
        return listing.stdout.split()

    @staticmethod
    def _start_munge() -> bool:
        """Start munge where none runs; whether it was started."""
        if subprocess.run(["munge", "-n"], capture_output=True).returncode == 0:
            return False
        _MUNGE.mkdir(exist_ok=True)
        shutil.chown(_MUNGE, "munge")
        subprocess.run(
            ["runuser", "-u", "munge", "--", shutil.which("munged") or "munged"], check=True
        )
        return True

    def _wait(self, holds, what: str, seconds: float = 30.0) -> None:
        end = time.monotonic() + seconds
        while not holds():
            if time.monotonic() > end:
                log = (self.run / "slurmctld.log").read_text(encoding="utf-8")[-2000:]
                raise RuntimeError(f"no {what} within {seconds:.0f} s\n{log}")
            time.sleep(0.2)

    @staticmethod
    def _stop(pid_file: Path) -> None:
        if not pid_file.exists():
            return
        pid = int(pid_file.read_text(encoding="utf-8"))
        try:
            os.kill(pid, signal.SIGTERM)
            for _ in range(100):
                os.kill(pid, 0)
                time.sleep(0.1)
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
