"""Named arrays as a file with a checksum, which names its format and says how it was made.

An npz archive whose comment, its last bytes, is the sha256 of all bytes before them. The checksum
is compared before anything else of the file is read. Equal content gives equal bytes.

A caller adds `stated` to its arrays, where the bytes of its files have it, and passes `write` and
`read` a function fault_of, which maps arrays to a sentence that says what is wrong, or to None.
Checkpoints of trainings are bytes of PyTorch that end in the same checksum.
"""

import hashlib
import io
import json
import os
import re
import zipfile
from pathlib import Path

import numpy as np

SEAL = 64           # bytes: a sha256 in hexadecimal digits
MAGIC = b"PK"       # what every zip archive begins with
KINDS = {       # a format without its number -> the files that have it
    "": "laws", "reduced model": "reduced models", "gnn": "graph networks",
    "mpm_ref law": "layers of exported laws"}


def stated(path, format, about):
    """The arrays of a file that are no numbers: its format, and plain values on how it was made.

    Raises ValueError, which names the path, for an `about` with more than JSON knows (of which
    tuples come back as lists).
    """
    try:
        text = json.dumps(about, sort_keys=True, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path} is not written: about: {error}; give numbers, text, lists and "
                         "dicts of them") from None
    return {"format": np.array(format), "about": np.array(text)}


def write(path, arrays, fault_of):
    """Write arrays; who reads the file meanwhile, or a crash, finds the old one or the new one.

    Raises ValueError where they have a fault, OSError where the system refuses.
    """
    if fault := fault_of(arrays):
        raise ValueError(f"{path} is not written: {fault}")
    write_whole(Path(path), sealed(arrays))


def read(path, format, fault_of, what):
    """The arrays of a file, and how it was made; what: in words, what they are of.

    Raises ValueError for a file that is damaged, of another format, or has a fault.
    """
    arrays = opened(Path(path))
    require_format(path, arrays, format, what)
    if fault := fault_of(arrays):
        raise ValueError(f"{path} holds no {what}: {fault}; train again")
    return arrays, about_of(path, arrays)


def format_of(arrays):
    """The format that a file names; in words where that is not one number."""
    found = arrays.get("format")
    return f"an array of shape {found.shape}" if np.ndim(found) else found


def kind_of(format):
    """The kind of files that have a format, in words; None for none of ours."""
    found = re.fullmatch(r"(.*?) ?\d+", str(format))
    return KINDS.get(found[1]) if found else None


def require_format(path, arrays, expected, what):
    """Raise ValueError unless a file is of the expected format; what: in words, what was asked
    for.
    """
    found = format_of(arrays)
    if found == expected:
        return
    if kind_of(found) not in (None, kind_of(expected)):
        raise ValueError(f"{path} holds no {what}, format {expected}: its format, {found}, is that "
                         f"of {kind_of(found)}; name another file")
    raise ValueError(f"{path} has format {found}, this program reads {expected}; use the version "
                     "that wrote it, or make it again")


def about_of(path, arrays):
    """What is known of a file's making, from its arrays. Raises ValueError for no JSON of it."""
    try:
        about = json.loads(str(arrays.get("about", "")))
    except ValueError as error:
        raise ValueError(f"{path} does not say how it was made: about is no JSON ({error}); copy "
                         "it again from where it came, or make it again") from None
    if not isinstance(about, dict):
        raise ValueError(f"{path} does not say how it was made: about is a "
                         f"{type(about).__name__}, expected a JSON object; make it again")
    return about


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


def write_sealed(path, content):
    """Write the bytes of a checkpoint, whole or not at all."""
    write_whole(path, content + seal(content))


def read_sealed(path):
    """The bytes of a checkpoint. Raises ValueError where it is damaged."""
    content = path.read_bytes()
    if not intact(content):
        raise ValueError(f"{path} is damaged or no checkpoint: its checksum does not fit; remove "
                         "it to train from the start, or name another file")
    return content[:-SEAL]


def require_same_training(path, kept, named):
    """Raise ValueError unless a checkpoint is of the training that goes on; both as text."""
    if kept != named:
        raise ValueError(f"{path} is a checkpoint of the training {kept}, not of {named}; remove "
                         "it or give another folder")
