"""Replace files atomically: write a temporary file in the same folder, sync it, rename it."""

import os
import shutil
from contextlib import contextmanager
from pathlib import Path

MARGIN = 1 << 20     # bytes left free beyond what a file needs, for the file system's own records


class NotWritten(OSError):
    """A file could not be written; what stood in its place before still stands."""


@contextmanager
def replacing(path):
    """Yield the path of a temporary file, which replaces `path` when the block ends without error.

    A reader of `path`, even after a crash, sees the old file or the new one, never a part of it.
    The temporary file lies in the same folder, since a rename is atomic only within a file system,
    and its name holds the process id, so that two processes never write to the same one. Raises
    `NotWritten` if there is no such folder, or if the system refuses.
    """
    path = Path(path)
    require_place(path)
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        yield part
        sync(part)
        os.replace(part, path)
        sync(path.parent)
    except NotWritten:
        raise
    except OSError as e:
        raise write_error(path, e) from e
    finally:
        part.unlink(missing_ok=True)


def write_bytes(path, content):
    """Replace the file at `path` by these bytes atomically. Raises `NotWritten`."""
    with replacing(path) as part:
        part.write_bytes(content)


def part_of(path):
    """Return the path of the file that is filled before it takes the place of `path`.

    Its name is the same for every process, so that a lock on it admits one writer. It has the
    suffix of `path`, by which programs recognise the format.
    """
    path = Path(path)
    return path.with_name(f".{path.stem}.part{path.suffix}")


def sync(path):
    """Flush a file, or the entries of a folder, to the disk (fsync)."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def require_place(path):
    """Raise `NotWritten` unless the folder of `path` exists and `path` itself is not a folder."""
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
            f"{path}: {size_text(size)} needed, {size_text(free)} free in {folder}; "
            "free some space or name a file on another disk"
        )


def write_error(path, error):
    """Return the `NotWritten` that reports an error of the system."""
    return NotWritten(f"{path} could not be written: {error.strerror or error}; "
                      "is the disk full, or the folder read-only?")


def size_text(size):
    """Return a number of bytes as text with a unit, such as 1.5 GB."""
    for unit in ("B", "kB", "MB", "GB"):
        if size < 1000.0:
            return f"{size:.3g} {unit}"
        size /= 1000.0
    return f"{size:.3g} TB"
