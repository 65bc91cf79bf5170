"""The data files of the repository that this process has opened: scenes, studies, weights.

An experiment depends on them as on its source. A file that an earlier experiment of the process
opened counts too, since its content may be cached. Files that a library opens by itself (HDF5) are
not noticed. Results of other experiments count where a module declares them. The printed values in
`validation/targets`, which some experiments compute with, and the random numbers count for every
experiment.
"""

import hashlib
import os
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ALWAYS = ("validation/common/seeding.py", "validation/targets")     # of the last the values alone
FOLDERS = ("mpm_ref", "scenes", "studies", "validation")
IGNORED = ("validation/targets/", "validation/templates/")      # rules and layout, no input
CODE = {".py", ".pyc", ".nbi", ".nbc"}

_opened = set()         # paths as text
_declared = set()       # relative paths


def watch():
    """Begin to note the files that are opened; for the life of the process."""
    sys.addaudithook(_note)


def _note(event, arguments):
    if event == "open" and isinstance(arguments[0], str | os.PathLike):
        _opened.add(os.fspath(arguments[0]))


def declare(path):
    """Count a file as an input that lies outside of the folders of data files.

    path: relative to the root of the repository, with slashes.
    """
    _declared.add(path)


def forget_declared():
    """Forget what was declared, as a new experiment declares its own."""
    _declared.clear()


def opened(root=ROOT):
    """Return {path relative to `root`: hash} of the data files that were opened, or declared, and
    are there.
    """
    inside = {relative(path, root) for path in list(_opened)} - {None}
    inputs = {path for path in inside if is_input(path)} | _declared
    found = {path for path in inputs if (root / path).is_file()}
    return {path: hash_now(path, root) for path in sorted(found)}


def always(root=ROOT):
    """Return {path relative to `root`: hash} of what counts for every experiment."""
    return {path: hash_now(path, root) for path in ALWAYS}


def hash_now(path, root):
    """Return the hash of an input by its relative path: of a file, or of the printed values."""
    return file_hash(root / path) if path != ALWAYS[1] else values_hash(root / path)


def values_hash(folder):
    """Return the hash of the printed values in a folder, whatever their rules and reasons."""
    values = sorted((target["id"], target["value"]) for file in Path(folder).glob("*.toml")
                    for target in tomllib.loads(file.read_text(encoding="utf-8"))["targets"])
    return hashlib.sha256(repr(values).encode()).hexdigest()[:16]


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
