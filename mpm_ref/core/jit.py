"""All configuration of Numba: three decorators, one dispatch, one cache, one thread pool.

Every option and its reason:

* ``error_model="numpy"``: 1/0 gives inf both in serial and in parallel code; Numba's default
  raises in serial code only, so that the same kernel would behave differently.
* ``fastmath`` off: kernels equal their plain twins to round-off, NaN stays visible, and the bits
  do not depend on the width of the machine's vector registers.
* ``SLP_VECTORIZE`` on: the compiler may use vector registers for the d components of a node. It
  reorders no sum, hence changes no bit, and makes particle-to-grid transfer 1.3 times faster.
* A cache of our own (`kernel_cache`), in a folder named by the hash of every file that shapes
  kernels. Numba's own looks only at the file of the cached function: after an edit of a *callee in
  another file* it would silently run the old code. Docstrings and comments shape no kernel and are
  left out of the hash. Kernels of types or methods from outside of the package are not stored.
* The threading layer is pinned (OpenMP where present, else Numba's own work queue): Numba's
  default changes when another package installs TBB. The bits of our results do not depend on it.
* Waiting OpenMP threads spin for about 0.1 ms, then sleep. Without the spin, the threads of a small
  step sleep and wake several times; spinning for longer made steps of small scenes 8 times slower
  on a machine that does other work too. Set GOMP_SPINCOUNT or OMP_WAIT_POLICY to choose otherwise.
  The spin is that of GNU's library alone.
* ``pipeline_class``: kernels of single arguments compute in single precision (`precision`).
* ``_nrt``: arrays are counted, also in kernels that a `borrowing` one calls, which would pass its
  option on.
* ``no_cfunc_wrapper``: no kernel is handed to C, and the wrapper for that takes time to compile.
* Parallel loops run over a fixed number of chunks, never over "one chunk per thread": a result is a
  function of the input alone. See `chunk` and `total`.
"""

import ast
import hashlib
import importlib.util
import os
import shutil
import sys
from contextlib import suppress
from functools import partial, update_wrapper
from pathlib import Path
from time import time
from types import FunctionType

import numba
import numpy as np
import platformdirs
from numba import njit
from numba.extending import overload, typeof_impl

from .kernel_cache import WRITING, KernelCache, compilations, mark_altered, report
from .precision import Compiler

CHUNKS = 64          # of every parallel loop and reduction
FEW_ITEMS = "MPM_REF_FEW_ITEMS"     # variable with the number of items below which loops are serial
VERSIONS = 4         # of the package whose compiled kernels stay on disk, however old
IN_USE = 86400.0     # [s] since a version was opened, in which it may still be in use: stays too

prange = numba.prange       # of the drivers
few_items = int(os.environ.get(FEW_ITEMS, "2000"))

DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef)
_OPTIONS = {"error_model": "numpy", "no_cfunc_wrapper": True, "pipeline_class": Compiler,
            "_nrt": True}

if "OMP_WAIT_POLICY" not in os.environ:         # both are read when the library is loaded
    os.environ["OMP_WAIT_POLICY"] = "PASSIVE"
    os.environ.setdefault("GOMP_SPINCOUNT", "3000")
if "NUMBA_SLP_VECTORIZE" not in os.environ:
    numba.config.SLP_VECTORIZE = 1
if "NUMBA_THREADING_LAYER" not in os.environ:
    has_omp = importlib.util.find_spec("numba.np.ufunc.omppool") is not None
    numba.config.THREADING_LAYER = "omp" if has_omp else "workqueue"


def _sources(package):
    """Return the texts of all files that shape compiled code: kernels, and in `core` and
    `materials` also the records and tables that kernels are compiled for.
    """
    texts = ((file.relative_to(package), file.read_bytes()) for file in
             sorted(package.rglob("*.py")))
    return [text for path, text in texts
            if path.parts[0] in ("core", "materials") or b"jit import" in text]


def syntax(text):
    """Return the syntax tree of a text, without comments, docstrings and positions, as bytes."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            del node.body[0]
    return ast.dump(tree).encode()


def _hash(parts):
    """Return the hash of a sequence of bytes and of the compiler's version."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    for part in parts:
        digest.update(part)
    return digest.hexdigest()[:16]


def _source_hash(package, root):
    """Return the hash of the syntax of `_sources`, which names the folder of compiled kernels.

    Parsing takes longer than reading, so that the folder `root` has, for each state of the texts,
    a small file with the hash of their syntax.
    """
    texts = _sources(package)
    known = root / f"{_hash(texts)}.syntax"
    try:
        found = known.read_text(encoding="ascii")
    except OSError:
        found = ""
    if len(found) == 16:            # neither missing nor half written by another process
        return found
    found = _hash(map(syntax, texts))
    with suppress(OSError):
        root.mkdir(parents=True, exist_ok=True)
        known.write_text(found, encoding="ascii")
    return found


def _used(version):
    """Return when a folder of compiled kernels was last opened [s]."""
    return version.stat().st_mtime


def _remove_old(root):
    """Remove the versions long unused from the folder of compiled kernels."""
    for known in root.glob("*.syntax"):
        if time() - _used(known) > IN_USE:
            known.unlink(missing_ok=True)
    versions = [d for d in root.iterdir() if d.is_dir()]
    for old in sorted(versions, key=_used)[:-VERSIONS]:
        if time() - _used(old) > IN_USE:
            shutil.rmtree(old, ignore_errors=True)


def _cache_dir():
    """Return the folder of this version's compiled kernels, and remove versions long unused.

    Returns None, of which the first compilation tells, if there can be no such folder.
    """
    root = Path(numba.config.CACHE_DIR or platformdirs.user_cache_dir("mpm_ref")) / "kernels"
    here = root / _source_hash(Path(__file__).parents[1], root)
    try:
        here.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        compilations.append(partial(report, root, WRITING, fault))
        return None
    with suppress(OSError):         # others may own the folder, or remove the same versions
        os.utime(here)
        _remove_old(root)
    return str(here)


CACHE_DIR = _cache_dir()


def _compiled(function, **options):
    """Return Numba's dispatcher of a function, with our cache."""
    dispatcher = njit(**_OPTIONS | options)(function)
    dispatcher._cache = KernelCache(function, CACHE_DIR)
    return dispatcher


class Kernel:
    """A compiled function that kernels and Python may call.

    It is compiled in two forms. Kernels link the one without an entry for Python, which takes
    about half as long to compile; the other one is compiled where Python calls the function.
    """

    def __init__(self, function, **options):
        update_wrapper(self, function)
        self.py_func = function
        self._entry = _compiled(function, **options)
        self.linked = _compiled(_renamed(function, "linked"), no_cpython_wrapper=True,
                                **options)

    def __call__(self, *args, **kwargs):
        """Return what the function returns for the arguments."""
        return self._entry(*args, **kwargs)

    @property
    def signatures(self):
        """Return the types of arguments with which Python has called the function."""
        return self._entry.signatures


def _renamed(function, form):
    """Return a copy of a function named after its form, and so with a cache of its own."""
    copy = FunctionType(function.__code__, function.__globals__, function.__name__,
                        function.__defaults__, function.__closure__)
    copy.__module__, copy.__qualname__ = function.__module__, f"{function.__qualname__}.{form}"
    copy.__doc__ = function.__doc__
    return copy


@typeof_impl.register(Kernel)
def _type_of_kernel(function, context):
    """Return the type by which compiled callers know a kernel: that of its linked form."""
    return numba.types.Dispatcher(function.linked)


def kernel(function):
    """Compile a formula, or a serial traversal (one loop calling formulas)."""
    return Kernel(function)


def leaf(function):
    """Compile a formula that is worth inlining although it is long, as LLVM would not by itself."""
    return Kernel(function, forceinline=True)


def borrowing(function):
    """Compile a formula as a `leaf` that borrows the arrays of its arguments: it does not count
    references to them, which takes longer than what it computes, and more so where threads share
    the counters. The compiler refuses one that makes an array. It must not return an array, not
    even one of its arguments or a part of it, which the caller would then free: nothing checks it.
    """
    return Kernel(function, forceinline=True, _nrt=False)


def parallel(function):
    """Compile a driver: a `prange` over chunks that calls a serial traversal.

    Only the driver is compiled with ``parallel=True``: the loop's body stays an ordinary kernel,
    which compiles faster and can be run with ``NUMBA_BOUNDSCHECK=1`` (not honoured in parallel
    code).
    """
    return _compiled(function, parallel=True)


class Driver:
    """A `prange` over chunks that is compiled in two forms: with threads, and as a serial loop.

    The serial form runs where there are few items, or one thread. It takes a third of the time to
    compile, starts no threads, and gives the same bits. The items are those of the first argument:
    an array, or a NamedTuple whose first field has a row for each.
    """

    def __init__(self, function):
        update_wrapper(self, function)
        self.py_func = function
        self.threaded = _compiled(function, parallel=True)
        self.serial = _compiled(_renamed(function, "serial"))

    def __call__(self, *args):
        """Run the loop."""
        is_serial = item_count(args[0]) < few_items or numba.get_num_threads() == 1
        return (self.serial if is_serial else self.threaded)(*args)

    @property
    def signatures(self):
        """Return the types of arguments with which Python has called the loop, in either form."""
        return list(dict.fromkeys([*self.serial.signatures, *self.threaded.signatures]))


def item_count(argument):
    """Return the number of rows of an array, or of the first field of a NamedTuple."""
    while isinstance(argument, tuple):
        argument = argument[0]
    return len(argument)


def parallel_if_many(function):
    """Compile a driver as a `Driver`."""
    return Driver(function)


def by_type(name, position=-1):
    """A function `name(*arguments)` that calls the method registered for one argument's type.

    The type is that of ``arguments[position]``, a NamedTuple class, or `tuple` for any other tuple;
    methods are added with ``f.method(Class, kernel)``. Compiled callers resolve the method when
    they are compiled, so that it is inlined; and they are still cached on disk, which they are not
    when handed a kernel as an argument. Raises TypeError for a type without a method.
    """
    methods = {}

    def dispatch(*arguments):
        return _find(methods, name, type(arguments[position]))(*arguments)

    def resolve(*types):
        method = _find(methods, name, _class_of(types[position]))
        return lambda *arguments: method(*arguments)

    def add(cls, method):
        mark_altered(cls, method)
        methods[cls] = method

    dispatch.__name__ = dispatch.__qualname__ = name
    dispatch.method = add
    dispatch.methods = methods
    overload(dispatch, jit_options=_OPTIONS, strict=False)(resolve)
    return dispatch


def _class_of(known):
    """Return the Python class of a tuple of a compiled type; None for anything else."""
    plain = tuple if isinstance(known, numba.types.BaseTuple) else None
    return getattr(known, "instance_class", plain)


def _find(methods, name, cls):
    try:
        return methods[cls]
    except KeyError:
        known = ", ".join(sorted(c.__name__ for c in methods))
        raise TypeError(f"{name} is not defined for {cls}; it is for: {known}") from None


@kernel
def chunk(c, n):
    """First and last-plus-one item of chunk c of n items."""
    return c * n // CHUNKS, (c + 1) * n // CHUNKS


@kernel
def _sum(a, start, stop):
    s = 0.0
    for i in range(start, stop):
        s += a[i]
    return s


@kernel
def _sum_of_chunks(a):
    s = 0.0
    for c in range(CHUNKS):
        start, stop = chunk(c, len(a))
        s += _sum(a, start, stop)
    return s


def total(a):
    """Sum of a 1-D array, in double: of chunks, whose sums are added in turn."""
    return _sum_of_chunks(np.asarray(a, dtype=float))


def set_threads(n):
    """Number of threads of all kernels. Raises ValueError outside 1 .. number of cores at start."""
    most = numba.config.NUMBA_NUM_THREADS
    if not 1 <= n <= most:
        raise ValueError(f"threads = {n}: expected 1 .. {most}; NUMBA_NUM_THREADS raises the limit")
    numba.set_num_threads(n)
