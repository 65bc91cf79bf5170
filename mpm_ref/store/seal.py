"""Seal a file that is written once: a last line with the sha256 of all bytes before it.

HDF5 ignores what follows its own end, so that every HDF5 tool reads a sealed file. The line is
verified before HDF5 sees the file: on damaged tables HDF5 may crash or never return.
"""

import hashlib
from pathlib import Path

CHECKPOINT, GOLDEN = b"\nmpm_ref sha256 ", b"\nmpm_ref golden sha256 "     # begin of the line
DIGITS = 64
WHOLE, DAMAGED, UNSEALED = "whole", "damaged", "unsealed"       # of `verify`


def seal(path, kind):
    """Append the last line, of a kind of files, to a file."""
    digest = _sha256(path, Path(path).stat().st_size)
    with open(path, "ab") as end:
        end.write(kind + digest)


def is_sealed(path, kind):
    """Return whether a file ends as sealed files of a kind do; `verify` computes the checksum."""
    return _last_line(Path(path), kind).startswith(kind)


def verify(path, kind):
    """Return WHOLE, DAMAGED, or for a file without the last line UNSEALED."""
    path = Path(path)
    end = _last_line(path, kind)
    if not end.startswith(kind):
        return UNSEALED
    return WHOLE if end == kind + _sha256(path, path.stat().st_size - len(end)) else DAMAGED


def _last_line(path, kind):
    """Return as many of the last bytes of a file as the last line has."""
    size = len(kind) + DIGITS
    with open(path, "rb") as file:
        file.seek(max(path.stat().st_size - size, 0))
        return file.read(size)


def _sha256(path, size):
    """Return the sha256 of the first `size` bytes of a file, in hexadecimal digits."""
    out = hashlib.sha256()
    with open(path, "rb") as file:
        while size > 0 and (block := file.read(min(size, 1 << 20))):
            out.update(block)
            size -= len(block)
    return out.hexdigest().encode()
