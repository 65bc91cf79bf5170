"""POD modes as a file, sealed as those of `weights` are: the same `Model`, its decoder `Modes`."""

import json
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from .modes import Modes
from .weights import Model, opened, sealed, write_whole

FORMAT = 1
KIND = "modes"
NUMBERS = ("X", "U", "slope", "xhat", "rest")


def save(path, model):
    """Write a `Model` of modes, whole or not at all. Raises ValueError for arrays that do not fit,
    and OSError where the system refuses.
    """
    map = model.decoder
    arrays = {name: np.asarray(a, dtype=float) for name, a in
              zip(NUMBERS, (map.X, map.U, map.slope, model.xhat, model.rest), strict=True)}
    fault = fault_of(arrays)
    if fault:
        raise ValueError(f"{path} is not written: {fault}")
    about = json.dumps(model.about, sort_keys=True, allow_nan=False)
    write_whole(Path(path), sealed({"kind": np.array(KIND), "format": np.array(FORMAT),
                                    "about": np.array(about), **arrays}))


def load(path):
    """Read what `save` wrote. Raises ValueError saying what is wrong with the file."""
    arrays = opened(Path(path))
    if not is_one(arrays) or arrays.get("format") != FORMAT:
        raise ValueError(f"{path} holds no modes of format {FORMAT}; make them again")
    fault = fault_of(arrays)
    if fault:
        raise ValueError(f"{path} holds no modes: {fault}; make them again")
    X, U, slope, xhat, rest = (arrays[name] for name in NUMBERS)
    return Model(Modes(X, U, slope, KDTree(X)), xhat, rest, json.loads(str(arrays["about"])))


def is_one(arrays):
    """Whether the arrays of a file are those of modes."""
    return str(arrays.get("kind")) == KIND


def fault_of(arrays):
    """What is wrong with the arrays of a file, or None."""
    missing = set(NUMBERS) - set(arrays)
    if missing:
        return f"it lacks {', '.join(sorted(missing))}"
    if arrays["U"].ndim != 3 or arrays["xhat"].ndim != 3:
        return "U and xhat have not three axes each"
    n, d, r = arrays["U"].shape
    shapes = {"X": (n, d), "slope": (n, d, d, r), "rest": (r,),
              "xhat": (*arrays["xhat"].shape[:2], r)}
    for name in NUMBERS:
        if arrays[name].shape != shapes.get(name, arrays[name].shape):
            return f"{name} has shape {arrays[name].shape}, expected {shapes[name]}"
        if not np.isfinite(arrays[name]).all():
            return f"{name} has numbers that are not finite"
    return None
