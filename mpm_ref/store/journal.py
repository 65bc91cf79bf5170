"""Write HDF5 files in transactions: a crash leaves the file as of its last commit.

HDF5 alone cannot do this: a process killed while it writes may leave a file that does not open. So
h5py writes through the file object `JournaledFile`, whose changes become permanent in `commit`:

* bytes beyond the end of the last commit (a new frame) go to the file at once, unread by others;
* changes of earlier bytes (few: HDF5's own tables) stay in memory, page by page;
* `commit` syncs the new bytes, writes the changed pages atomically to a journal in the same folder,
  copies them into the file, and removes the journal.

After a crash before the journal exists the file is unchanged; after a later one `recover` finishes
the copy. Between commits the file is plain HDF5, which any tool may read while the run continues.

If the system refuses a write (disk full), the bytes stay in memory and `commit` reports the error:
HDF5, which may crash on such an error, never sees it. Alternatives: decision 17 and 73 in
docs/explanation/decisions.md.
"""

import fcntl
import hashlib
import io
import os
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

from .atomic import replacing, sync, write_error
from .checksums import BlockDigests, Damaged, require_intact

PAGE = 4096
MAGIC = b"mpm_ref journal\n"
LIBVER = ("earliest", "v110")     # the oldest format that will do: every HDF5 tool reads it


class InUse(OSError):
    """Another process is writing the file."""


class JournaledFile(io.RawIOBase):
    """A file object for `h5py.File(file, mode)` whose changes become permanent in `commit`.

    `new` empties the file, or creates it. checked: each commit writes the checksums of
    `checksums`, which are verified first; the content then begins with a user block. The object
    locks out other writers. Raises `InUse`, `Damaged`, or `NotWritten` if the file cannot be
    opened.
    """

    def __init__(self, path, new=False, checked=False):
        self.path = Path(path)
        self._file = _locked(self.path, new)
        try:
            if new:
                self._file.truncate(0)
                journal_of(self.path).unlink(missing_ok=True)
            _apply_journal(self._file, self.path)
            self._blocks = self._opened_blocks(new) if checked else None
        except BaseException:
            self._file.close()
            raise
        self._position = 0
        # What HDF5 asked for; the file grows to it at a commit.
        self._size = self._blocks.size if checked else 0
        self._pending = {}       # page number -> its new bytes
        self._error = None       # the first refused write
        self._freeze()

    def _opened_blocks(self, new):
        try:
            return BlockDigests() if new else require_intact(self._file)
        except Damaged as fault:
            raise Damaged(f"{self.path} is damaged: {fault}; take a copy, or start anew") from None

    def _freeze(self):
        end = os.fstat(self._file.fileno()).st_size
        self._frozen = -(-end // PAGE) * PAGE
        if self._blocks is None:
            self._size = max(self._size, end)

    def commit(self):
        """Make all changes since the last commit permanent, or none and raise `NotWritten`."""
        if self._error is None:
            try:
                self._commit()
            except OSError as e:
                self._error = e
        if self._error is not None:
            raise write_error(self.path, self._error) from self._error

    def _commit(self):
        handle = self._file.fileno()
        if os.fstat(handle).st_size < self._size:
            os.ftruncate(handle, self._size)
        if self._blocks is not None:
            self._put_checksums()
            if self._error is not None:
                return
        os.fsync(handle)
        if self._pending:
            _write_journal(journal_of(self.path), self._pending)
            _apply_journal(self._file, self.path)
        self._pending.clear()
        self._freeze()

    def _put_checksums(self):
        pages = [(page * PAGE, (page + 1) * PAGE) for page in self._pending]
        self._blocks.update(self._content, self._size, pages)
        self._put(self._size, self._blocks.digests)
        self._put(0, self._blocks.head())

    def move(self, path):
        """Rename the file to `path`, in the same folder, replacing a file there."""
        journal_of(path).unlink(missing_ok=True)
        os.replace(self.path, path)
        sync(Path(path).parent)
        self.path = Path(path)

    def write(self, data):
        """Write bytes at the current position; errors are reported by `commit`."""
        data = memoryview(data).cast("B")
        self._put(self._position, data)
        self._position += len(data)
        self._size = max(self._size, self._position)
        return len(data)

    def _put(self, at, data):
        """Write bytes that no commit has, and hold others in memory."""
        wait = len(data) if self._error else min(max(self._frozen - at, 0), len(data))
        self._hold(at, data[:wait])
        try:
            _write_at(self._file, data[wait:], at + wait)
        except OSError as e:
            self._error = e
            self._hold(at + wait, data[wait:])

    def _hold(self, at, data):
        """Hold changed bytes in memory until the commit."""
        while len(data):
            page, start = divmod(at, PAGE)
            if page not in self._pending:
                old = os.pread(self._file.fileno(), PAGE, page * PAGE)
                self._pending[page] = bytearray(old.ljust(PAGE, b"\0"))
            piece = data[:PAGE - start]
            self._pending[page][start:start + len(piece)] = piece
            at, data = at + len(piece), data[len(piece):]

    def readinto(self, buffer):
        """Read up to the end of the file, uncommitted bytes included."""
        n = min(len(buffer), max(self._size - self._position, 0))
        buffer[:n] = self._content(self._position, n)
        self._position += n
        return n

    def _content(self, begin, n):
        """Return n bytes from `begin` on, uncommitted ones included."""
        data = bytearray(os.pread(self._file.fileno(), n, begin).ljust(n, b"\0"))
        for page in range(begin // PAGE, -(-(begin + n) // PAGE)):
            if page in self._pending:
                first, last = max(page * PAGE, begin), min((page + 1) * PAGE, begin + n)
                data[first - begin:last - begin] = self._pending[page][
                    first - page * PAGE:last - page * PAGE]
        return data

    def seek(self, offset, whence=io.SEEK_SET):
        """Set the current position and return it."""
        start = {io.SEEK_SET: 0, io.SEEK_CUR: self._position, io.SEEK_END: self._size}[whence]
        self._position = start + offset
        return self._position

    def tell(self):
        """Return the current position."""
        return self._position

    def truncate(self, size=None):
        """Note the size that HDF5 asks for; the file never shrinks, which HDF5 allows."""
        self._size = max(self._size, size or 0)
        return self._size

    def readable(self):
        """Return True: the file can be read."""
        return True

    def writable(self):
        """Return True: the file can be written."""
        return True

    def seekable(self):
        """Return True: the file can be positioned."""
        return True

    def close(self):
        """Close the file and discard uncommitted changes."""
        self._file.close()
        super().close()


@contextmanager
def new_hdf5(path):
    """Yield a new `h5py.File`, committed when the block ends without error. Raises `NotWritten`."""
    file = JournaledFile(path, new=True)
    try:
        with h5py.File(file, "w", libver=LIBVER) as h5:
            yield h5
        file.commit()
    finally:
        file.close()


def recover(path):
    """Finish the commit that a killed writer of `path` left unfinished; readers call this first."""
    if journal_of(path).exists():
        try:
            JournaledFile(path).close()
        except InUse:
            pass             # its writer still runs and finishes the commit itself


def journal_of(path):
    """Return the path of the journal of a file."""
    path = Path(path)
    return path.with_name(f".{path.name}.journal")


def in_use(path):
    """Return the `InUse` that names a file."""
    return InUse(f"{path} is being written by another process; wait for it, or write to another "
                 "file")


def _locked(path, new):
    """Open and lock the file at `path`, created if it is missing and `new`."""
    while True:
        try:
            file = open(path, "r+b", buffering=0, opener=_create if new else None)
        except OSError as e:
            raise write_error(path, e) from e
        try:
            _lock(file, path)
            if _is_current(path, file):
                return file
        except BaseException:
            file.close()
            raise
        file.close()


def _create(path, flags):
    return os.open(path, flags | os.O_CREAT, 0o666)


def _lock(file, path):
    """Lock out other writers by a POSIX lock, which HDF5's own locks, hence readers, ignore."""
    try:
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise in_use(path) from None


def _is_current(path, file):
    """Return whether `path` still names an open file: another writer may have renamed it."""
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
    """Copy the pages of the journal, if there is one, into the file and remove the journal."""
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
