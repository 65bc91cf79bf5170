"""The data files of the repository that this process has opened: scenes, studies, weights.

An experiment depends on them as on its source. A file that an earlier experiment of the process
opened counts too, since its content may be cached. Files that a library opens by itself (HDF5) are
not noticed.
"""

import hashlib
import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("mpm_ref", "scenes", "studies", "validation")
IGNORED = ("validation/targets/", "validation/templates/")      # rules and layout, no input
CODE = {".py", ".pyc", ".nbi", ".nbc"}

_opened = set()         # paths as text


def watch():
    """Begin to note the files that are opened; for the life of the process."""
    sys.addaudithook(_note)


def _note(event, arguments):
    if event == "open" and isinstance(arguments[0], str | os.PathLike):
        _opened.add(os.fspath(arguments[0]))


def opened(root=ROOT):
    """Return {path relative to `root`: hash} of the data files that were opened and are there."""
    inside = {relative(path, root) for path in list(_opened)} - {None}
    return {path: file_hash(root / path) for path in sorted(inside)
            if is_input(path) and (root / path).is_file()}


def relative(path, root):
    """Return a path relative to `root`, with slashes, or None of one elsewhere."""
    try:
        return Path(os.path.abspath(os.fsdecode(path))).relative_to(root).as_posix()
    except ValueError:
        return None


def is_input(path):
    """Return whether a relative path is of a data file that results depend on."""
    return (path.split("/")[0] in FOLDERS and not path.startswith(IGNORED)
            and Path(path).suffix not in CODE)


def file_hash(file):
    """Return the hash of a file, empty where there is none."""
    try:
        return hashlib.sha256(Path(file).read_bytes()).hexdigest()[:16]
    except OSError:
        return ""


watch()
