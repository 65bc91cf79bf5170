"""Files that are whole or not there: written beside their place, synced, then moved into it."""

import os
import shutil
from contextlib import contextmanager
from pathlib import Path

MARGIN = 1 << 20     # bytes left free beyond what a file needs, for the file system's own records


class NotWritten(OSError):
    """A file could not be written; what stood in its place before still stands."""


@contextmanager
def replacing(path):
    """Yield the path of a file to write; it takes the place of `path` when the block ends well.

    Whoever reads `path`, and whatever kills the process, finds the old file or the new one. The
    file to write lies in the same folder, since only within a file system is the move atomic.
    Raises `NotWritten` where there is no such place, or the system refuses.
    """
    path = Path(path)
    require_place(path)
    part = part_of(path)
    try:
        yield part
        sync(part)
        os.replace(part, path)
        sync(path.parent)
    except NotWritten:
        raise
    except OSError as e:
        raise not_written(path, e) from e
    finally:
        part.unlink(missing_ok=True)


def part_of(path):
    """Path of the file that is written in place of `path`, with its suffix, which says the kind."""
    path = Path(path)
    return path.with_name(f".{path.stem}.part{path.suffix}")


def sync(path):
    """Have the system put a file, or a folder's list of names, on the disk itself."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def require_place(path):
    """Raise `NotWritten` unless the folder of `path` is there, and `path` is not one itself."""
    folder = Path(path).resolve().parent
    if not folder.is_dir():
        raise NotWritten(f"{path}: there is no folder {folder}; create it or name another file")
    if Path(path).is_dir():
        raise NotWritten(f"{path} is a folder; name a file, in it or elsewhere")


def require_space(path, size):
    """Raise `NotWritten` unless the file system that holds `path` has `size` bytes free."""
    require_place(path)
    folder = Path(path).resolve().parent
    free = shutil.disk_usage(folder).free
    if free < size + MARGIN:
        raise NotWritten(
            f"{path}: {in_words(size)} needed, {in_words(free)} free in {folder}; "
            "free some space or name a file on another disk"
        )


def not_written(path, error):
    """`NotWritten` for an error of the system."""
    return NotWritten(f"{path} could not be written: {error.strerror or error}; "
                      "is the disk full, or the folder read-only?")


def in_words(size):
    """A number of bytes for people: 1.5 GB."""
    for unit in ("B", "kB", "MB", "GB"):
        if size < 1000.0:
            return f"{size:.3g} {unit}"
        size /= 1000.0
    return f"{size:.3g} TB"
