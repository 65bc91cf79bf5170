"""POD modes as a file, straight or bent, as those of `weights` are: the same `Model`, its
decoder `Modes` or `Curved`.
"""

from functools import partial
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from ..store.weights_file import about_of, format_of, opened, stated, write
from .fields.pod import Modes
from .fields.polynomial_manifold import Curved
from .weights import Model

FORMAT = 1
NUMBERS = ("X", "U", "slope", "xhat", "rest")
KINDS = {"modes": NUMBERS, "curved": (*NUMBERS, "powers", "C")}


def save(path, model):
    """Write a `Model` of modes, whole or not at all. Raises ValueError for arrays that do not fit
    and an `about` with more than JSON knows, OSError where the system refuses.
    """
    kind, arrays = arrays_of(model)
    write(path, {"kind": np.array(kind), **stated(path, FORMAT, model.about), **arrays},
          partial(fault_of, kind))


def load(path):
    """Read what `save` wrote. Raises ValueError saying what is wrong with the file."""
    arrays = opened(Path(path))
    if not is_one(arrays) or format_of(arrays) != FORMAT:
        raise ValueError(f"{path} holds no modes of format {FORMAT}; make them again")
    kind = str(arrays["kind"])
    fault = fault_of(kind, arrays)
    if fault:
        raise ValueError(f"{path} holds no modes: {fault}; make them again")
    X, U, slope, xhat, rest, *bend = (arrays[name] for name in KINDS[kind])
    map = Modes(X, U, slope, KDTree(X))
    return Model(Curved(map, *bend) if bend else map, xhat, rest, about_of(path, arrays))


def arrays_of(model):
    """Kind of a `Model` of modes, and the arrays of its file by name."""
    map, bend = model.decoder, ()
    if isinstance(map, Curved):
        map, *bend = map
    kind = "curved" if bend else "modes"
    found = (map.X, map.U, map.slope, model.xhat, model.rest, *bend)
    return kind, {name: np.asarray(a, dtype=int if name == "powers" else float)
                  for name, a in zip(KINDS[kind], found, strict=True)}


def is_one(arrays):
    """Whether the arrays of a file are those of modes."""
    return str(arrays.get("kind")) in KINDS


def fault_of(kind, arrays):
    """What is wrong with the arrays of a file, or None."""
    missing = set(KINDS[kind]) - set(arrays)
    if missing:
        return f"it lacks {', '.join(sorted(missing))}"
    if arrays["U"].ndim != 3 or arrays["xhat"].ndim != 3:
        return "U and xhat have not three axes each"
    if kind == "curved" and arrays["powers"].ndim != 2:
        return "powers has not two axes"
    for name, shape in shapes(kind, arrays).items():
        if arrays[name].shape != shape:
            return f"{name} has shape {arrays[name].shape}, expected {shape}"
        if not np.isfinite(arrays[name]).all():
            return f"{name} has numbers that are not finite"
    return None


def shapes(kind, arrays):
    """Shape of each array, as those of U, rest and C tell them."""
    (n, d, R), r = arrays["U"].shape, arrays["xhat"].shape[2]
    if kind == "modes":
        r = R
    found = {"X": (n, d), "U": (n, d, R), "slope": (n, d, d, R), "rest": (r,),
             "xhat": (*arrays["xhat"].shape[:2], r)}
    if kind == "curved":
        monomials = len(arrays["powers"])
        found |= {"powers": (monomials, r), "C": (R - r, monomials)}
    return found
