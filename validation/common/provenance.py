"""The origin of a number: source, versions, date, machine."""

import os
import platform
import subprocess
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

PACKAGES = ("numpy", "scipy", "numba")


def provenance(source):
    """The fields of a `Record` that say by what it was made, `source` being the commit."""
    return {
        "commit": source,
        "date": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "cores": os.cpu_count() or 1,
        "versions": {"python": platform.python_version(), **_versions()},
    }


def commit(root):
    """Commit of the source at `root`, with "+changes" where files other than results differ."""
    head = _git(root, "rev-parse", "--short=12", "HEAD")
    if not head:
        return "unknown"
    changes = _git(root, "status", "--porcelain", "--", ".", ":!results")
    return head + ("+changes" if changes else "")


def _git(root, *arguments):
    """Output of a git command, empty where git or the repository is missing."""
    try:
        done = subprocess.run(
            ["git", *arguments], cwd=root, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return done.stdout.strip()


def _versions():
    found = {}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
