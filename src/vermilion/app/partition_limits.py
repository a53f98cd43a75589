"""Jobs that no node of their Slurm partition can ever run, found before the first is submitted.

Slurm accepts a job that asks for more time, memory or cores than its partition allows, and leaves it
pending for ever. A run would then wait without a word.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

#: States of a partition in which jobs wait at the most; in others they are refused.
_ACCEPTING = ("up", "down")


@dataclass(frozen=True)
class PartitionLimits:
    """What a partition allows a job, on its largest node.

    Attributes:
        minutes: longest time limit; None: unlimited.
        mem_mb: memory of the largest node.
        cores: cores of the largest node.
        state: as `sinfo` has it (`up`, `down`, `inactive`, `drain`).
    """

    minutes: int | None
    mem_mb: int
    cores: int
    state: str = "up"


@dataclass(frozen=True)
class JobRequest:
    """What a job asks for.

    Attributes:
        rule: its rule.
        partition: the partition that it goes to.
        minutes, mem_mb, cores: its request.
    """

    rule: str
    partition: str
    minutes: int
    mem_mb: int
    cores: int


def read_partitions() -> dict[str, PartitionLimits]:
    """Limits of every partition by name, as `sinfo` tells; empty where Slurm is not at hand."""
    if shutil.which("sinfo") is None:
        return {}
    listing = subprocess.run(
        ["sinfo", "--noheader", "--format", "%R|%l|%m|%c|%a"], capture_output=True, text=True
    )
    limits: dict[str, PartitionLimits] = {}
    for line in listing.stdout.split():
        name, time, memory, cores, state = line.split("|")
        # Slurm marks nodes that differ with a plus: the number is the smallest of them.
        found = PartitionLimits(
            _minutes(time),
            int(memory.rstrip("+")),
            int(cores.rstrip("+")),
            state,
        )
        known = limits.get(name)
        limits[name] = found if known is None else _larger(known, found)
    return limits


def impossible_jobs(
    requests: Iterable[JobRequest], limits: Mapping[str, PartitionLimits]
) -> list[str]:
    """A sentence for each rule with a job that can never start, worst request first.

    A partition that `limits` does not have is a sentence, too; without any limits there is none.
    """
    worst: dict[tuple[str, str, str], int] = {}
    unknown: dict[str, str] = {}
    closed: dict[str, str] = {}
    for job in requests if limits else ():
        allowed = limits.get(job.partition)
        if allowed is None:
            unknown[job.partition] = job.rule
            continue
        if allowed.state not in _ACCEPTING:
            closed[job.partition] = job.rule
        for what, asked, most in (
            ("runtime", job.minutes, allowed.minutes),
            ("mem_mb", job.mem_mb, allowed.mem_mb),
            ("threads", job.cores, allowed.cores),
        ):
            if most is not None and asked > most:
                key = (job.rule, what, job.partition)
                worst[key] = max(worst.get(key, 0), asked)
    names = [_unknown_partition(name, rule, limits) for name, rule in sorted(unknown.items())]
    names += [
        f"rule {rule}: partition '{name}' takes no jobs now: it is {limits[name].state}. Wait, or choose "
        "another partition (--default-resources slurm_partition=NAME)."
        for name, rule in sorted(closed.items())
    ]
    return names + [
        f"rule {rule} asks for {what} {asked}{_unit(what)}; partition '{partition}' allows "
        f"{_allowed(limits[partition], what)}{_unit(what)}. Choose another partition "
        f"(--default-resources slurm_partition=NAME) or ask for less "
        f"(--set-resources {rule}:{what}={_allowed(limits[partition], what)})."
        for (rule, what, partition), asked in sorted(worst.items(), key=lambda item: -item[1])
    ]


def requests_of(jobs: Iterable[Any]) -> list[JobRequest]:
    """Requests of Snakemake's jobs; jobs that run where Snakemake itself does are left out."""
    return [
        JobRequest(
            rule=job.rule.name,
            partition=str(job.resources.get("slurm_partition", "")),
            minutes=int(job.resources.get("runtime", 0)),
            mem_mb=int(job.resources.get("mem_mb", 0)),
            cores=int(job.threads),
        )
        for job in jobs
        if not job.is_local
    ]


def _minutes(text: str) -> int | None:
    """Minutes of Slurm's `days-hours:minutes:seconds`; None for `infinite`."""
    if not text[:1].isdigit():
        return None
    days, _, clock = text.rpartition("-")
    parts = [int(part) for part in clock.split(":")]
    hours, minutes = parts[-3] if len(parts) > 2 else 0, parts[-2] if len(parts) > 1 else 0
    return (int(days or 0) * 24 + hours) * 60 + minutes


def _larger(one: PartitionLimits, other: PartitionLimits) -> PartitionLimits:
    return replace(one, mem_mb=max(one.mem_mb, other.mem_mb), cores=max(one.cores, other.cores))


def _allowed(limits: PartitionLimits, what: str) -> int | None:
    return {"runtime": limits.minutes, "mem_mb": limits.mem_mb, "threads": limits.cores}[what]


def _unit(what: str) -> str:
    return {"runtime": " min", "mem_mb": " MB", "threads": ""}[what]


def _unknown_partition(name: str, rule: str, limits: Mapping[str, PartitionLimits]) -> str:
    return (
        f"rule {rule} goes to partition '{name}', which this cluster does not have; it has "
        f"{', '.join(sorted(limits))}. Set slurm_partition in the profile."
    )
