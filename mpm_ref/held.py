"""Arrays that may be larger than memory: above a size they are mapped from a nameless file.

The system keeps in memory what is in use, and the file is gone with the array. It lies where
`tempfile` puts files: in the folder TMPDIR, if that is set.
"""

import os
from math import prod
from tempfile import TemporaryFile, gettempdir

import numpy as np

LARGEST = 2**30     # bytes of an array in memory


def empty(shape, kind):
    """An array of a shape and kind whose values are anything. Raises OSError where its file has no
    room.
    """
    size = prod(shape) * np.dtype(kind).itemsize
    if size <= LARGEST:
        return np.empty(shape, kind)
    with TemporaryFile() as file:
        try:
            reserve(file, size)
        except OSError as error:
            raise OSError(f"no room for {size / 2**30:.3g} GiB of snapshots in {gettempdir()} "
                          f"({error.strerror}): expected as much on the disk; set TMPDIR to a "
                          "folder that has it, or keep fewer states") from error
        return np.asarray(np.memmap(file, kind, "r+", shape=shape))


def reserve(file, size):
    """Make a file so many bytes long, on the disk too where the system can tell."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file.fileno(), 0, size)
    file.truncate(size)
