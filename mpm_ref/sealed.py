"""Plain arrays as a file: an npz with a seal, written whole or not at all.

The last bytes of the file, in a zip archive its comment, are the sha256 of all bytes before them.
They are compared before anything else of the file is read. Equal content gives equal bytes.
"""

import hashlib
import io
import os
import zipfile

import numpy as np

SEAL = 64           # bytes: a sha256 in hexadecimal digits
MAGIC = b"PK"       # what every zip archive begins with


def sealed(arrays):
    """The bytes of a file."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    with zipfile.ZipFile(buffer, "a") as archive:
        archive.comment = bytes(SEAL)
    content = buffer.getvalue()[:-SEAL]
    return content + seal(content)


def seal(content):
    """The last bytes of a file, from those before."""
    return hashlib.sha256(content).hexdigest().encode()


def intact(content):
    """Whether the last bytes of a file are the seal of those before."""
    return seal(content[:-SEAL]) == content[-SEAL:]


def opened(path):
    """The arrays of a file whose seal is intact."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror}; name another file, or make "
                         "this one") from None
    if not content.startswith(MAGIC):
        raise ValueError(f"{path} is not an npz file; name another one, or make it again")
    if not intact(content):
        raise ValueError(f"{path} is damaged, cut short or none of ours: its checksum does not "
                         "fit; copy it again from where it came, or make it again")
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            return dict(file)
    except (ValueError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path} is no archive of plain arrays ({error}); copy it again from "
                         "where it came, or make it again") from None


def write_whole(path, content):
    """Write bytes beside their place, have the disk hold them, and move them into it."""
    if not path.parent.is_dir():
        raise OSError(f"{path}: there is no folder {path.parent}; create it or name another file")
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with open(part, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        raise OSError(f"{path} could not be written: {error.strerror}; is the disk full, or the "
                      "folder read-only?") from error
    finally:
        part.unlink(missing_ok=True)
