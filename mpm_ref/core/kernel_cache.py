"""Store compiled kernels so that no file in their folder can end a run or change its results.

`KernelCache` takes the place of Numba's own cache, which has an index per function with all its
signatures. Here each signature of a function has a file of its own, named by the hash of its key:

* A file holds the sha256 of its key and content. A file that is empty, truncated, altered or of
  another key is not unpickled: the kernel is compiled again and the file replaced.
* A folder that cannot be read or written, or is full, costs compilation in memory, and one line.
* Only functions and types of this package are stored, since the folder is named by the hash of the
  package's sources: a file of somebody else's code could outlive that code.
"""

import hashlib
import os
import pickle
import sys
import uuid
from functools import cache
from multiprocessing import parent_process
from pathlib import Path

from numba import config
from numba.core import types
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps
from numba.core.typing.templates import Signature

PACKAGE = __name__.partition(".")[0]
CHECKSUM = 32            # bytes of a sha256, with which a file begins
FLAGS = ("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK", "DEBUGINFO_DEFAULT")  # of Numba
READING, WRITING = "read", "stored"
CURE = {READING: "they are compiled and stored again",
        WRITING: "every start compiles anew; set NUMBA_CACHE_DIR to a folder with room"}

compilations = []        # functions that are called, without arguments, before each compilation
_altered = set()         # classes of the package for which others have registered methods
_reported = set()        # (folder, READING or WRITING) of the lines that were printed


class KernelCache(NullCache):
    """The compiled forms of a function in a folder, a file for each signature.

    It has the methods that Numba's dispatcher calls. A folder None stores nothing.
    """

    def __init__(self, function, folder):
        self._function = function
        self._folder = folder and Path(folder)
        self._code = None

    @property
    def cache_path(self):
        """Return the folder."""
        return self._folder and str(self._folder)

    def load_overload(self, sig, target_context):
        """Return the stored compilation for a signature, or None, for which Numba compiles."""
        found = None
        if self._is_stored(sig):
            try:
                found = self._load(self._key(sig, target_context.codegen()), target_context)
            except FileNotFoundError:
                pass
            except Exception as fault:      # whatever is wrong with the file, compiling is right
                report(self._folder, READING, fault)
        if found is None:
            for begin in compilations:
                begin()
        return found

    def save_overload(self, sig, data):
        """Store the compilation for a signature."""
        if not self._is_stored(sig) or (self._folder, WRITING) in _reported:
            return
        if data.library.has_dynamic_globals or data.lifted:     # addresses of this process
            return
        try:
            self._save(self._key(sig, data.codegen), dumps(data._reduce()))
        except Exception as fault:
            report(self._folder, WRITING, fault)

    def _is_stored(self, sig):
        """Return whether the folder is for a signature: the package's function, on its types."""
        return (self._folder is not None and is_ours(self._function)
                and all(map(is_ours, classes_of(sig))))

    def _load(self, key, target):
        target.refresh()
        return CompileResult._rebuild(target, *pickle.loads(unsealed(self._file(key), key)))

    def _save(self, key, content):
        replace_file(self._file(key), seal(key, content))

    def _file(self, key):
        name = f"{self._function.__module__}.{self._function.__qualname__}"
        name = "".join(c for c in name if c.isalnum() or c in "._")[-100:]
        return self._folder / f"{name}-{hashlib.sha256(key).hexdigest()[:24]}.kernel"

    def _key(self, sig, codegen):
        """Return what determines the machine code, beside the sources that name the folder."""
        if self._code is None:
            self._code = code_text(self._function)
        names = [f"{c.__module__}.{c.__qualname__}" for c in classes_of(sig)]
        flags = [getattr(config, name) for name in FLAGS]
        return repr((self._code, str(sig), names, codegen.magic_tuple(), flags)).encode()


def code_text(function):
    """Return a text that differs between functions of one name, such as lambdas."""
    code = function.__code__
    constants = [c for c in code.co_consts if not hasattr(c, "co_code")]
    enclosed = [cell.cell_contents for cell in function.__closure__ or ()]
    return repr((function.__module__, function.__qualname__, code.co_code.hex(), code.co_names,
                 constants, hashlib.sha256(dumps(enclosed)).hexdigest() if enclosed else ""))


def seal(key, content):
    """Return the bytes of a file: the sha256 of key and content, and the content."""
    return hashlib.sha256(key + content).digest() + content


def unsealed(file, key):
    """Return the content of a file. Raises ValueError unless it is whole and of this key."""
    stored = file.read_bytes()
    content = stored[CHECKSUM:]
    if seal(key, content) != stored:
        raise ValueError("a file is damaged or of another kernel")
    return content


def replace_file(file, content):
    """Write a file beside its place and rename it, so that no reader sees a part of it."""
    file.parent.mkdir(parents=True, exist_ok=True)
    part = file.with_name(f"{uuid.uuid4().hex}.part")
    try:
        part.write_bytes(content)
        os.replace(part, file)
    finally:
        part.unlink(missing_ok=True)


def report(folder, action, fault):
    """Print one line for a folder in which kernels cannot be read or stored, once a process."""
    if (folder, action) in _reported:
        return
    _reported.add((folder, action))
    if parent_process() is None:
        reason = getattr(fault, "strerror", None) or " ".join(str(fault).split()) or repr(fault)
        print(f"mpm-ref: compiled kernels cannot be {action} in {folder} ({reason[:200]}): "
              f"{CURE[action]}", file=sys.stderr)


def mark_altered(cls, method):
    """Note that a method for a class comes from outside of the package, if it does."""
    if not is_ours(method):
        _altered.add(cls)


def is_ours(part):
    """Return whether a class or function is the package's, compiled as its sources say."""
    module = getattr(part, "__module__", None) or ""
    return module.partition(".")[0] in (PACKAGE, "numba", "builtins") and part not in _altered


@cache
def classes_of(part):
    """Return all classes that the types of a signature refer to.

    A kernel among the arguments counts as None: only its address in this process describes it.
    """
    if isinstance(part, type):
        return (part,)
    if isinstance(part, types.Callable):
        return (None,)
    if isinstance(part, Signature):
        part = (part.return_type, *part.args)
    inner = vars(part).values() if isinstance(part, types.Type) else part
    inner = tuple(one for one in inner if isinstance(one, type | tuple | types.Type)) if (
        isinstance(part, tuple | types.Type)) else ()
    return (type(part), *(cls for one in inner for cls in classes_of(one)))
