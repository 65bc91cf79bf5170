"""Read and write files of named arrays with a format, a provenance and a checksum.

A file is an npz archive whose comment, its last bytes, is the sha256 of all bytes before them,
verified before anything else is read. Equal content gives equal bytes.

A caller adds the arrays of `header` to its own, and passes to `write` and `read` a function
fault_of, which maps arrays to a sentence about what is wrong with them, or to None. Checkpoints of
trainings are bytes of PyTorch that end in the same checksum.
"""

import hashlib
import io
import json
import os
import re
import zipfile
from pathlib import Path

import numpy as np

from .atomic import size_text, write_bytes

SEAL = 64           # bytes: a sha256 in hexadecimal digits
MAGIC = b"PK"       # what every zip archive begins with
KINDS = {       # a format without its number -> the files that have it
    "": "laws", "reduced model": "reduced models", "gnn": "graph networks",
    "mpm_ref law": "layers of exported laws"}


def header(path, file_format, about):
    """Return the arrays of a file that are text: its format, and its provenance as JSON.

    about: dict of plain values (tuples are read back as lists). Raises ValueError, which names the
    path, for values that JSON cannot represent.
    """
    try:
        text = json.dumps(about, sort_keys=True, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path} is not written: about: {error}; give numbers, text, lists and "
                         "dicts of them") from None
    return {"format": np.array(file_format), "about": np.array(text)}


def write(path, arrays, fault_of):
    """Replace the file at `path` by these arrays atomically.

    Raises ValueError for arrays with a fault, and `NotWritten`.
    """
    if fault := fault_of(arrays):
        raise ValueError(f"{path} is not written: {fault}")
    write_bytes(path, pack(arrays))


def read(path, file_format, fault_of, what):
    """Return the arrays of a file and its provenance; `what` describes the content in messages.

    Raises ValueError for a file that is damaged, of another format, or has a fault.
    """
    arrays = load_arrays(Path(path))
    require_format(path, arrays, file_format, what)
    if fault := fault_of(arrays):
        raise ValueError(f"{path} holds no {what}: {fault}; train again")
    return arrays, read_provenance(path, arrays)


def format_of(arrays):
    """Return the format that a file names, or a description of what stands in its place."""
    stored = arrays.get("format")
    return f"an array of shape {stored.shape}" if np.ndim(stored) else stored


def format_kind(file_format):
    """Return the kind of files with a format, in words; None for a foreign format."""
    match = re.fullmatch(r"(.*?) ?\d+", str(file_format))
    return KINDS.get(match[1]) if match else None


def require_format(path, arrays, expected, what):
    """Raise ValueError unless a file has the expected format; `what` describes it in messages."""
    stored = format_of(arrays)
    if stored == expected:
        return
    if format_kind(stored) not in (None, format_kind(expected)):
        raise ValueError(f"{path} holds no {what}, format {expected}: its format, {stored}, is "
                         f"that of {format_kind(stored)}; name another file")
    raise ValueError(f"{path} has format {stored}, this program reads {expected}; use the version "
                     "that wrote it, or make it again")


def read_provenance(path, arrays):
    """Return the provenance of a file, a dict. Raises ValueError if it is no JSON object."""
    try:
        about = json.loads(str(arrays.get("about", "")))
    except ValueError as error:
        raise ValueError(f"{path} does not say how it was made: about is no JSON ({error}); copy "
                         "it again from where it came, or make it again") from None
    if not isinstance(about, dict):
        raise ValueError(f"{path} does not say how it was made: about is a "
                         f"{type(about).__name__}, expected a JSON object; make it again")
    return about


def pack(arrays):
    """Return the bytes of a file with these arrays, checksum included."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    with zipfile.ZipFile(buffer, "a") as archive:
        archive.comment = bytes(SEAL)
    content = buffer.getvalue()[:-SEAL]
    return content + checksum(content)


def checksum(content):
    """Return the last bytes of a file, the sha256 of those before them."""
    return hashlib.sha256(content).hexdigest().encode()


def is_intact(content):
    """Return whether the last bytes of a file are the checksum of those before."""
    return checksum(content[:-SEAL]) == content[-SEAL:]


def load_arrays(path):
    """Return the arrays of a file. Raises ValueError if it is no npz file or its checksum fails."""
    content = read_file(path)
    if not content.startswith(MAGIC):
        raise ValueError(f"{path} is not an npz file; name another one, or make it again")
    if not is_intact(content):
        raise ValueError(f"{path} is damaged, cut short or none of ours: its checksum does not "
                         "fit; copy it again from where it came, or make it again")
    try:
        require_uncompressed(path, content)
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            return dict(file)
    except (ValueError, OSError, EOFError, zipfile.BadZipFile, KeyError,
            NotImplementedError, RuntimeError) as error:
        raise ValueError(f"{path} is no archive of plain arrays ({error}); copy it again from "
                         "where it came, or make it again") from None


def read_file(path):
    """Return the bytes of a file. Raises ValueError unless it is an ordinary one that fits into the
    memory: a pipe may wait for ever, a device has no end.
    """
    try:
        size = path.stat().st_size
        if not (path.is_file() or path.is_dir()):        # opening a folder says so by itself
            raise ValueError(f"{path} cannot be read: it is no ordinary file; name another one")
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        if size > memory:
            raise ValueError(f"{path} has {size_text(size)}, and this machine {size_text(memory)} "
                             "of memory; name another file")
        with open(path, "rb") as file:
            return file.read(size)
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror}; name another file, or make "
                         "this one") from None


def require_uncompressed(path, content):
    """Raise ValueError for an archive that would grow: ours are not compressed."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        if sum(entry.file_size for entry in archive.infolist()) > len(content):
            raise ValueError("its arrays are compressed, which no file of ours is")


def write_checkpoint(path, content):
    """Replace a checkpoint of a training atomically, with a checksum. Raises `NotWritten`."""
    write_bytes(path, content + checksum(content))


def read_checkpoint(path):
    """Return the bytes of a checkpoint of a training. Raises ValueError if it is damaged."""
    content = read_file(path)
    if not is_intact(content):
        raise ValueError(f"{path} is damaged or no checkpoint: its checksum does not fit; remove "
                         "it to train from the start, or name another file")
    return content[:-SEAL]


def require_same_training(path, stored, expected):
    """Raise ValueError unless a checkpoint is of the expected training, described by a text."""
    if stored != expected:
        raise ValueError(f"{path} is a checkpoint of the training {stored}, not of {expected}; "
                         "remove it or give another folder")
