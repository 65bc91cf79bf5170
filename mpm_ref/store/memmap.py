"""Arrays that may be larger than memory: above a size each is mapped from a nameless file.

The system keeps in memory what is in use, and the file is gone with the array. It lies where
`tempfile` puts files: in the folder TMPDIR, if that is set. Where that folder is itself in memory,
as /tmp is on some systems, nothing is gained.
"""

import errno
import os
from math import prod
from tempfile import TemporaryFile, gettempdir

import numpy as np

LARGEST = 2**30     # bytes of an array in memory
UNKNOWN = errno.EOPNOTSUPP, errno.EINVAL    # of disks that cannot reserve room


def empty(shape, kind):
    """An array of a shape and kind whose values are anything. Raises OSError where its file has no
    room, as far as the system can tell before it is written.
    """
    size = prod(shape) * np.dtype(kind).itemsize
    if size <= LARGEST:
        return np.empty(shape, kind)
    try:
        with TemporaryFile() as file:
            reserve(file, size)
            return np.asarray(np.memmap(file, kind, "r+", shape=shape))
    except OSError as error:
        raise OSError(f"no file for {size / 2**30:.3g} GiB of snapshots ({error.strerror or error})"
                      f": expected as much room in {folder()}; set TMPDIR to a folder that has "
                      "it, or keep fewer states") from error


def folder():
    """Where files are put, in words."""
    try:
        return gettempdir()
    except OSError:
        return "the folder TMPDIR"


def reserve(file, size):
    """Make a file so many bytes long, on the disk too where the system can."""
    if hasattr(os, "posix_fallocate"):
        try:
            os.posix_fallocate(file.fileno(), 0, size)
        except OSError as error:
            if error.errno not in UNKNOWN:
                raise
    file.truncate(size)
