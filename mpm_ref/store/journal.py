"""A file that goes from one committed state to the next, and is never found between two.

HDF5 cannot do this by itself: killed while it writes, it may leave a file that does not open. So
h5py is given a file object of ours, and `commit` is the moment at which changes come to stand:

* bytes past the end of the last commit (a new frame) go to the file at once: nobody reads them;
* bytes before it (HDF5's own tables: few) wait in memory, page by page;
* `commit` syncs the new bytes, writes the waiting pages into a journal beside the file, atomically,
  copies them into the file, and removes the journal.

Killed before the journal is there, the file is the old one; killed after, `recover` finishes the
copy. Between commits the file is a plain HDF5 file, which any tool may read while a run goes on.

A write that the system refuses (disk full) is kept in memory and reported by `commit`: HDF5, which
does not survive such an error, never sees it.
"""

import fcntl
import hashlib
import io
import os
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

from .atomic import not_written, replacing, sync

PAGE = 4096
MAGIC = b"mpm_ref journal\n"
LIBVER = ("earliest", "v110")     # the oldest format that will do: every HDF5 tool reads it


class InUse(OSError):
    """Another process is writing the file."""


class Damaged(OSError):
    """A file is not what its checksum says."""


class JournaledFile(io.RawIOBase):
    """A file object for `h5py.File(file, mode)` whose changes stand only after `commit`.

    `new` creates an empty file in place of what was there. Holds a lock against other writers.
    Raises `InUse`, `Damaged`, or `NotWritten` where the file cannot be opened.
    """

    def __init__(self, path, new=False):
        self.path = Path(path)
        self._file = _locked(self.path, new)
        try:
            if new:
                self._file.truncate(0)
                journal_of(self.path).unlink(missing_ok=True)
            _apply_journal(self._file, self.path)
        except BaseException:
            self._file.close()
            raise
        self._at = 0
        self._size = 0           # that HDF5 asked for; the file grows to it at a commit
        self._waiting = {}       # page number -> its new bytes
        self._error = None       # the first refused write
        self._freeze()

    def _freeze(self):
        end = os.fstat(self._file.fileno()).st_size
        self._frozen = -(-end // PAGE) * PAGE
        self._size = max(self._size, end)

    def commit(self):
        """Make all changes since the last commit stand, or none of them: raises `NotWritten`."""
        if self._error is None:
            try:
                self._commit()
            except OSError as e:
                self._error = e
        if self._error is not None:
            raise not_written(self.path, self._error) from self._error

    def _commit(self):
        handle = self._file.fileno()
        if os.fstat(handle).st_size < self._size:
            os.ftruncate(handle, self._size)
        os.fsync(handle)
        if self._waiting:
            _write_journal(journal_of(self.path), self._waiting)
            _apply_journal(self._file, self.path)
        self._waiting.clear()
        self._freeze()

    def move(self, path):
        """Let the file take the place of `path`, in the same folder; what stood there is gone."""
        journal_of(path).unlink(missing_ok=True)
        os.replace(self.path, path)
        sync(Path(path).parent)
        self.path = Path(path)

    def write(self, data):
        """Write bytes at the current position; never refuses, see `commit`."""
        data = memoryview(data).cast("B")
        wait = len(data) if self._error else min(max(self._frozen - self._at, 0), len(data))
        self._keep(self._at, data[:wait])
        try:
            _write_at(self._file, data[wait:], self._at + wait)
        except OSError as e:
            self._error = e
            self._keep(self._at + wait, data[wait:])
        self._at += len(data)
        self._size = max(self._size, self._at)
        return len(data)

    def _keep(self, at, data):
        """Let bytes wait in memory."""
        while len(data):
            page, start = divmod(at, PAGE)
            if page not in self._waiting:
                old = os.pread(self._file.fileno(), PAGE, page * PAGE)
                self._waiting[page] = bytearray(old.ljust(PAGE, b"\0"))
            piece = data[:PAGE - start]
            self._waiting[page][start:start + len(piece)] = piece
            at, data = at + len(piece), data[len(piece):]

    def readinto(self, buffer):
        """Read as much as there is, waiting bytes included."""
        n = min(len(buffer), max(self._size - self._at, 0))
        got = bytearray(os.pread(self._file.fileno(), n, self._at).ljust(n, b"\0"))
        for page in range(self._at // PAGE, -(-(self._at + n) // PAGE)):
            if page in self._waiting:
                first, last = max(page * PAGE, self._at), min((page + 1) * PAGE, self._at + n)
                got[first - self._at:last - self._at] = self._waiting[page][
                    first - page * PAGE:last - page * PAGE]
        buffer[:n] = got
        self._at += n
        return n

    def seek(self, offset, whence=io.SEEK_SET):
        """Move the current position."""
        start = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence]
        self._at = start + offset
        return self._at

    def tell(self):
        """The current position."""
        return self._at

    def truncate(self, size=None):
        """Note the size that HDF5 wants; a file never shrinks, which HDF5 does not mind."""
        self._size = max(self._size, size or 0)
        return self._size

    def readable(self):
        """True."""
        return True

    def writable(self):
        """True."""
        return True

    def seekable(self):
        """True."""
        return True

    def close(self):
        """Close the file; what was not committed is forgotten."""
        self._file.close()
        super().close()


@contextmanager
def new_hdf5(path):
    """An `h5py.File` to fill, committed when the block ends well. Raises `NotWritten`."""
    file = JournaledFile(path, new=True)
    try:
        with h5py.File(file, "w", libver=LIBVER) as h5:
            yield h5
        file.commit()
    finally:
        file.close()


def recover(path):
    """Finish the commit in which a writer of `path` was killed, if so; to be called by readers."""
    if journal_of(path).exists():
        try:
            JournaledFile(path).close()
        except InUse:
            pass             # its writer lives, and will finish by itself


def journal_of(path):
    """Path of the journal of a file."""
    path = Path(path)
    return path.with_name(f".{path.name}.journal")


def in_use(path):
    """`InUse` for a file."""
    return InUse(f"{path} is being written by another process; wait for it, or write to another "
                 "file")


def _locked(path, new):
    """The file at `path`, created if it is not there and `new`, with other writers locked out."""
    while True:
        try:
            file = open(path, "r+b", buffering=0, opener=_create if new else None)
        except OSError as e:
            raise not_written(path, e) from e
        try:
            _lock(file, path)
            if _stands_at(path, file):
                return file
        except BaseException:
            file.close()
            raise
        file.close()


def _create(path, flags):
    return os.open(path, flags | os.O_CREAT, 0o666)


def _lock(file, path):
    """Lock out other writers. A POSIX lock: HDF5's own locks, hence readers, do not mind it."""
    try:
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise in_use(path) from None


def _stands_at(path, file):
    """Whether an open file is the one at `path`: a writer that was faster may have moved it."""
    try:
        return os.path.samestat(os.stat(path), os.fstat(file.fileno()))
    except FileNotFoundError:
        return False


def _write_at(file, data, at):
    while len(data):
        n = os.pwrite(file.fileno(), data, at)
        at, data = at + n, data[n:]


def _write_journal(journal, pages):
    numbers = np.array(sorted(pages), dtype="<i8")
    text = len(numbers).to_bytes(8, "little") + numbers.tobytes()
    text += b"".join(bytes(pages[k]) for k in numbers.tolist())
    with replacing(journal) as part:
        part.write_bytes(MAGIC + hashlib.sha256(text).digest() + text)


def _apply_journal(file, path):
    """Copy the pages of a file's journal into it, if there is one, and remove the journal."""
    journal = journal_of(path)
    if not journal.exists():
        return
    content = journal.read_bytes()
    digest, text = content[len(MAGIC):len(MAGIC) + 32], content[len(MAGIC) + 32:]
    if not content.startswith(MAGIC) or digest != hashlib.sha256(text).digest():
        raise Damaged(f"{journal} is damaged, so the last frame of {path.name} is lost; remove the "
                      "journal to read the frames before it")
    count = int.from_bytes(text[:8], "little")
    numbers = np.frombuffer(text[8:8 + 8 * count], dtype="<i8").tolist()
    for k, page in enumerate(numbers):
        start = 8 + 8 * count + k * PAGE
        _write_at(file, text[start:start + PAGE], page * PAGE)
    os.fsync(file.fileno())
    journal.unlink()
