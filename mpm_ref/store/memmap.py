"""Allocate arrays that may exceed the memory: large ones are mapped from an unnamed file.

The system holds in memory the pages in use, and the file vanishes with the array. It lies where
`tempfile` puts files, in the folder TMPDIR if that is set. If that folder is itself in memory, as
/tmp is on some systems, nothing is gained.
"""

import errno
import os
from math import prod
from tempfile import TemporaryFile, gettempdir

import numpy as np

LARGEST = 2**30     # bytes of an array in memory
UNKNOWN = errno.EOPNOTSUPP, errno.EINVAL    # of disks that cannot reserve room


def empty(shape, kind):
    """Return an uninitialised array of a shape and dtype.

    Raises OSError if its file does not fit on the disk, as far as the system can tell beforehand.
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
                      f": expected as much room in {temporary_folder()}; set TMPDIR to a folder "
                      "that has it, or store fewer states") from error


def temporary_folder():
    """Return the path of the folder for temporary files, or its description if there is none."""
    try:
        return gettempdir()
    except OSError:
        return "the folder TMPDIR"


def reserve(file, size):
    """Extend a file to `size` bytes, allocated on the disk if the system supports it."""
    if hasattr(os, "posix_fallocate"):
        try:
            os.posix_fallocate(file.fileno(), 0, size)
        except OSError as error:
            if error.errno not in UNKNOWN:
                raise
    file.truncate(size)
