"""The origin of a number: source, versions, date, machine."""

import os
import platform
import subprocess
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

PACKAGES = ("numpy", "scipy", "numba")


def provenance(source):
    """Return the fields of a `Measurement` on its origin, `source` being the commit."""
    return {
        "commit": source,
        "date": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "cores": os.cpu_count() or 1,
        "versions": {"python": platform.python_version(), **_versions()},
    }


def commit(root):
    """Return the commit of the source at `root`, with "+changes" if more than results differ."""
    head = _git(root, "rev-parse", "--short=12", "HEAD")
    if not head:
        return "unknown"
    changes = _git(root, "status", "--porcelain", "--", ".", ":!results")
    return head + ("+changes" if changes else "")


def _git(root, *arguments):
    """Return the output of a git command, empty where git or the repository is missing."""
    try:
        process = subprocess.run(
            ["git", *arguments], cwd=root, capture_output=True, text=True, check=True)
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
