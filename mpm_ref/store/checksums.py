"""Checksums of the blocks of an HDF5 file that grows, verified before HDF5 sees the bytes.

On damaged tables HDF5 may crash or never return. A file here is

    head            HEAD bytes, which HDF5 skips as a user block: size of the content, head's digest
    content         what HDF5 wrote, from byte HEAD on
    digests         one for each block of the content, the head counted as zeros

`journal` writes head and digests with each commit; only the blocks that changed are hashed again.
Readers pass a `CheckedFile` to h5py, which verifies a block when it is first read.
"""

import io
import os
import time
from functools import partial
from hashlib import blake2b

HEAD = 512              # bytes: the smallest user block of HDF5
BLOCK = 1 << 16
DIGEST = 8              # bytes of the digest of a block
MAGIC = b"mpm_ref results, HDF5 from byte 512\n"
TRIES, PAUSE = 5, 0.01     # times [s] to wait for a writer that is committing


class Damaged(OSError):
    """A file, or its journal, is not as it was written."""


def digest(data):
    """Return the digest of some bytes."""
    return blake2b(data, digest_size=DIGEST).digest()


class BlockDigests:
    """The digests of the blocks of `size` bytes of content."""

    def __init__(self, size=0, digests=b""):
        self.size, self.digests = size, bytearray(digests)

    def head(self):
        """Return the first bytes of the file, which end in zeros."""
        text = MAGIC + self.size.to_bytes(8, "little") + digest(self.digests)
        return (text + digest(text)).ljust(HEAD, b"\0")

    def update(self, read, size, pages):
        """Hash again the blocks of changed pages, (begin, end) each, and those beyond the old size.

        read(at, n) returns bytes of the content.
        """
        first = min(self.size, size) // BLOCK
        changed = {k for begin, end in pages for k in range(begin // BLOCK, -(-end // BLOCK))}
        self.size = size
        count = -(-size // BLOCK)
        self.digests = self.digests[:count * DIGEST].ljust(count * DIGEST, b"\0")
        for k in {k for k in changed if k < count} | set(range(first, count)):
            self.digests[k * DIGEST:(k + 1) * DIGEST] = self._digest(read, k)

    def fits(self, read, k):
        """Return whether block k has its digest."""
        return self.digests[k * DIGEST:(k + 1) * DIGEST] == self._digest(read, k)

    def count(self):
        """Return the number of blocks."""
        return len(self.digests) // DIGEST

    def _digest(self, read, k):
        data = read(k * BLOCK, min(BLOCK, self.size - k * BLOCK))
        return digest(bytes(HEAD) + data[HEAD:] if k == 0 else data)


def has_head(path):
    """Return whether a file begins as those with checksums of their blocks do."""
    with open(path, "rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def read_blocks(file):
    """Return the `BlockDigests` of an open file. Raises `Damaged` where they or the head are."""
    handle, n = file.fileno(), len(MAGIC) + 8 + DIGEST
    head = os.pread(handle, HEAD, 0)
    text = head[:n]
    if len(head) < HEAD or head != (text + digest(text)).ljust(HEAD, b"\0"):
        raise Damaged("its first bytes are not those that were written")
    size = int.from_bytes(text[len(MAGIC):len(MAGIC) + 8], "little")
    digests = os.pread(handle, -(-size // BLOCK) * DIGEST, size)
    if digest(digests) != text[-DIGEST:]:
        raise Damaged("it is cut short, or its checksums are damaged")
    return BlockDigests(size, digests)


def require_intact(file):
    """Return the `BlockDigests` of an open file. Raises `Damaged` unless all of them fit."""
    blocks = read_blocks(file)
    for k in range(blocks.count()):
        if not blocks.fits(lambda at, n: os.pread(file.fileno(), n, at), k):
            raise Damaged(f"bytes {k * BLOCK} to {(k + 1) * BLOCK} are not those that were written")
    return blocks


class CheckedFile(io.RawIOBase):
    """A file object for `h5py.File(file, "r")` that raises `Damaged` for blocks without their
    digests. Another process may write the file meanwhile.
    """

    def __init__(self, path):
        self._file = open(path, "rb", buffering=0)
        try:
            self._blocks = self._patiently(lambda: read_blocks(self._file))
        except BaseException:
            self._file.close()
            raise
        self._verified, self._position, self._end = set(), 0, self._blocks.size

    def readinto(self, buffer):
        """Read verified bytes up to the end of the content."""
        begin, n = self._position, min(len(buffer), max(self._end - self._position, 0))
        for k in range(begin // BLOCK, -(-(begin + n) // BLOCK)):
            if k not in self._verified:
                self._patiently(partial(self._verify, k))
                self._verified.add(k)
        buffer[:n] = self._read(begin, n)
        self._position += n
        return n

    def _verify(self, k):
        if not self._blocks.fits(self._read, k):
            self._blocks = read_blocks(self._file)
            if not self._blocks.fits(self._read, k):
                raise Damaged(f"bytes {k * BLOCK} to {(k + 1) * BLOCK} are not those that were "
                              "written")

    def _read(self, at, n):
        return os.pread(self._file.fileno(), n, at)

    def _patiently(self, read):
        """Call a function again while it finds damage, which a commit heals in an instant."""
        for _ in range(TRIES - 1):
            try:
                return read()
            except Damaged:
                time.sleep(PAUSE)
        return read()

    def seek(self, offset, whence=io.SEEK_SET):
        """Set the current position and return it."""
        start = {io.SEEK_SET: 0, io.SEEK_CUR: self._position, io.SEEK_END: self._end}[whence]
        self._position = start + offset
        return self._position

    def tell(self):
        """Return the current position."""
        return self._position

    def readable(self):
        """Return True: the file can be read."""
        return True

    def seekable(self):
        """Return True: the file can be positioned."""
        return True

    def close(self):
        """Close the file."""
        self._file.close()
        super().close()
