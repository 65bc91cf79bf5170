"""The origin of a number: source, versions, date, machine."""

import os
import platform
import subprocess
import sys
import time
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from typing import NamedTuple

import numba
import threadpoolctl

from . import input_files
from .record import Origin
from .source_digest import source_digest

PACKAGES = ("numpy", "scipy", "numba")
IDLE = (3, 4)           # columns of /proc/stat: idle, and waiting for a disk
COUNTED = 8             # its columns without those of guests, which others contain


class Occupation(NamedTuple):
    """CPU seconds since the start of the machine, and of this process and its children."""

    wall: float
    machine: float | None           # None where the system does not tell
    process: float


def provenance(source):
    """Return the fields of a `Measurement` on its origin, `source` being the commit."""
    return {
        "commit": source,
        "date": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "cores": os.cpu_count() or 1,
        "versions": {"python": platform.python_version(), **_versions()},
    }


def origin_of(function, load_before, occupied_before):
    """Return the `Origin` of the records that a function has made.

    load_before: see `load_average`; occupied_before: `Occupation` at its start. A function of no
    module in the repository has no digest.
    """
    torch = sys.modules.get("torch")
    return Origin(
        digest=source_digest(function.__module__), cpu=cpu_model(), memory_gb=memory_gb(),
        threads=numba.get_num_threads(), system=platform.platform(), blas=blas(),
        torch=str(getattr(torch, "__version__", "")), load=(load_before, load_average()),
        others=busy_cores(occupied_before, occupation()),
        inputs=input_files.opened() | input_files.always())


def load_average():
    """Return the mean number of running processes over the last minute."""
    return round(os.getloadavg()[0], 2)


def occupation():
    """Return the `Occupation` of the machine now."""
    return Occupation(time.monotonic(), machine_seconds(), sum(os.times()[:4]))


def machine_seconds():
    """Return the CPU seconds of all processes since the start, None where the system is silent."""
    try:
        with open("/proc/stat", encoding="utf-8") as file:
            ticks = [int(text) for text in file.readline().split()[1:1 + COUNTED]]
    except (OSError, ValueError):
        return None
    return (sum(ticks) - sum(ticks[k] for k in IDLE)) / os.sysconf("SC_CLK_TCK")


def busy_cores(before, after):
    """Return the mean number of cores that other processes kept busy between two `Occupation`s."""
    wall = after.wall - before.wall
    if before.machine is None or after.machine is None or wall <= 0:
        return None
    others = (after.machine - before.machine) - (after.process - before.process)
    return round(max(others / wall, 0.0), 3)


def cpu_model():
    """Return the name of the processor, as far as the system tells it."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            names = [line.partition(":")[2].strip() for line in file
                     if line.startswith("model name")]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or platform.machine()


def memory_gb():
    """Return the size of the main memory [GB]."""
    return round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1)


def blas():
    """Return the names, versions and threads of the linear algebra libraries that are loaded."""
    libraries = [one for one in threadpoolctl.threadpool_info() if one["user_api"] == "blas"]
    return ", ".join(sorted({f"{one['internal_api']} {one['version']}, {one['num_threads']} threads"
                             for one in libraries}))


def commit(root):
    """Return the last commit at `root` that changed more than results, with "+changes" if more than
    results differ from it.
    """
    source = ("--", ".", ":!results")
    head = _git(root, "log", "-1", "--format=%h", "--abbrev=12", *source)
    if not head:
        return "unknown"
    changes = _git(root, "status", "--porcelain", *source)
    return head + ("+changes" if changes else "")


def _git(root, *arguments):
    """Return the output of a git command, empty where git or the repository is missing.

    It takes no lock that a commit beside it would wait for.
    """
    try:
        process = subprocess.run(
            ["git", "--no-optional-locks", *arguments], cwd=root, capture_output=True, text=True,
            check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return process.stdout.strip()


def _versions():
    versions = {}
    for package in PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            continue
    return versions
