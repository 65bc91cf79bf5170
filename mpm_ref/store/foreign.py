"""Read HDF5 files of other programs in a process of its own, which may hang or crash.

    python -m mpm_ref.store.foreign FILE GROUP COPY SECONDS

writes the arrays of a group of a file to a new file COPY, and on failure prints why. On damaged
tables HDF5 may crash or never return, and such a file has no checksum of ours that would show the
damage before. So `copied` runs this module with bounds of time and memory, and its caller reads the
copy. This file imports nothing of the package, since a process that loads NumPy and h5py alone
begins in a third of a second.
"""

import io
import os
import resource
import signal
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from math import prod
from pathlib import Path

import h5py

MOST_RATIO = 1032           # bytes that a byte of deflate gives at most
ALWAYS = 100e6              # bytes of arrays that any file may hold: entries may never be written
SPARE = 2 << 30             # bytes of addresses beyond those of the arrays: programs and buffers
SECONDS, RATE = 20, 5e6     # of processor time, and more for each so many bytes of the file
WAIT = 10                   # times as long on the clock, for a disk or a machine that is slow
REFUSED = 2                 # exit status of the process after a sentence


class Unreadable(ValueError):
    """A file of another program that HDF5 cannot read, or not in bounded time and memory."""


@contextmanager
def copied(path, group):
    """Yield the path of a temporary file with the arrays below a group of an HDF5 file.

    Arrays that hold no numbers come without entries. Where the file has no such group, neither has
    the copy. Raises `Unreadable` for a file that HDF5 cannot read within the bounds.
    """
    seconds = SECONDS + int(Path(path).stat().st_size / RATE)
    with tempfile.TemporaryDirectory(prefix="mpm_ref-") as folder:
        copy = Path(folder) / "copy.h5"
        command = [sys.executable, "-P", "-m", "mpm_ref.store.foreign", str(path), group, str(copy),
                   str(seconds)]
        try:
            done = subprocess.run(command, capture_output=True, check=False, env=environment(),
                                  timeout=WAIT * seconds, stdin=subprocess.DEVNULL)
        except subprocess.TimeoutExpired:
            raise Unreadable(_ending(-signal.SIGXCPU)) from None
        if done.returncode:
            raise Unreadable(done.stdout.decode(errors="replace").strip()
                             if done.returncode == REFUSED else _ending(done.returncode))
        yield copy


def environment():
    """Return variables under which a process finds this package and needs few threads.

    With `python -P` it finds no module in the current folder, which may be a stranger's.
    """
    root = str(Path(__file__).resolve().parents[2])
    paths = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    return {**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"}


def _ending(status):
    """Return how a process ended that gave no reason."""
    if status == -signal.SIGXCPU:
        return "HDF5 does not come to an end with it"
    return f"HDF5 breaks down on it ({signal.Signals(-status).name})" if status < 0 else (
        "HDF5 breaks down on it")


def copy_arrays(path, group, out):
    """Write the arrays below a group of an HDF5 file to a new file, where the file has the group.

    Raises `Unreadable` for arrays that lie in other files or are larger than the file can hold.
    """
    image = io.BytesIO()            # HDF5 may crash where a disk is full
    with h5py.File(path, "r") as f, h5py.File(image, "w") as new:
        _copy_group(f, group, new, max(MOST_RATIO * Path(path).stat().st_size, ALWAYS))
    try:
        Path(out).write_bytes(image.getbuffer())
    except OSError as fault:
        raise Unreadable(f"no copy fits in {Path(out).parent.parent}: {fault.strerror}; set TMPDIR "
                         "to a folder with room") from fault


def _copy_group(f, group, new, left):
    """Copy the arrays below a group between open files, `left` bytes at most."""
    link = f.get(group, getlink=True)
    if not isinstance(link, h5py.HardLink) or not isinstance(f[group], h5py.Group):
        return
    target = new.require_group(group)
    for name, item in _arrays(f[group]):
        left -= _size(name, item)
        if left < 0:
            raise Unreadable(f"its array {name} has the shape {item.shape}, more than a file "
                             "of this size holds")
        if item.shape is None or item.dtype.kind not in "iuf":
            target.create_dataset(name, shape=(0,), dtype=item.dtype)
        else:
            target.create_dataset(name, data=item[()])


def _arrays(group, path="", above=()):
    """Yield (path, array) of all arrays below a group, under each of their names: HDF5's own walk
    follows no soft links, and visits an array with several names once.

    Raises `Unreadable` for a link to another file, and KeyError for an entry that is damaged or
    leads nowhere. A group within itself is not entered again.
    """
    above = (*above, h5py.h5o.get_info(group.id).addr)
    for name in group:
        if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
            raise Unreadable(f"its entry {path}{name} lies in another file")
        item = group[name]              # `get` would leave out what is damaged
        if isinstance(item, h5py.Dataset):
            yield path + name, item
        elif isinstance(item, h5py.Group) and h5py.h5o.get_info(item.id).addr not in above:
            yield from _arrays(item, f"{path}{name}/", above)


def _size(name, item):
    """Return the bytes of an array. Raises `Unreadable` for one that lies in other files."""
    if item.external or item.is_virtual:
        raise Unreadable(f"its array {name} lies in other files")
    return 0 if item.shape is None else prod(item.shape) * item.dtype.itemsize


def _limit(kind, soft, hard):
    """Set the limits of a resource of this process, at most those that it has."""
    least = [min(wanted, given) if given != resource.RLIM_INFINITY else wanted
             for wanted, given in zip((soft, hard), resource.getrlimit(kind), strict=True)]
    resource.setrlimit(kind, least)


def main(path, group, out, seconds):
    """Copy within bounds and return the exit status; a sentence on stdout says why it failed."""
    addresses = SPARE + 2 * MOST_RATIO * Path(path).stat().st_size
    _limit(resource.RLIMIT_CPU, seconds, seconds + 5)
    _limit(resource.RLIMIT_CORE, 0, 0)
    _limit(resource.RLIMIT_AS, addresses, addresses)
    try:
        copy_arrays(path, group, out)
    except MemoryError:
        print("HDF5 asks for more memory than its arrays need")
    except Exception as fault:      # what broken files raise in h5py has no common class
        print(" ".join(str(fault).split()))
    else:
        return 0
    return REFUSED


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:4], int(sys.argv[4])))
