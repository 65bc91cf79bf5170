"""NSF's three fields as sums of modes, as a file (see `archive`): the same `Model` as in `weights`,
its decoder `Spanned`.

Names of arrays are those of the records, with a dot between: "tau.modes", "tau.coefficients.w".
"""

import numpy as np

from ..store import weights_file
from .fields.pod_fields import Cells, Part, Spanned
from .fields.radial_basis import Radial
from .weights import Model

FORMAT = 1
KIND = "fields of modes"
FUNCTIONS = {"tau": "tau.coefficients", "C": "C.coefficients", "bend": "bend"}
WHOLE = ("cells.order", "cells.start", "cells.middle")      # numbers of points


def names(kind, name):
    """Names in a file of the arrays of a record of a kind."""
    return tuple(f"{name}.{field}" for field in kind._fields)


OWN = ("X", "U", "mu")                                      # of `Spanned`
MODEL = ("xhat", "rest")
OPTIONAL = (names(Radial, "bend"), ("C.modes", *names(Radial, "C.coefficients")))
NEEDED = (*OWN, *MODEL, "tau.modes", *names(Radial, "tau.coefficients"), *names(Cells, "cells"))
AXES = {"U": 3, "xhat": 3, "mu": 1, "cells.middle": 1, "tau.modes": 3, "C.modes": 3,
        "tau.coefficients.centers": 2, "C.coefficients.centers": 2, "bend.centers": 2}


def save(path, model):
    """Write a `Model` of fields, whole or not at all. Raises ValueError for arrays that do not fit
    and an `about` with more than JSON knows, OSError where the system refuses.
    """
    stated = weights_file.stated(path, FORMAT, model.about)
    weights_file.write(path, stated | arrays_of(model), fault_of)


def load(path):
    """Read what `save` wrote. Raises ValueError saying what is wrong with the file."""
    arrays, about = weights_file.read(path, FORMAT, fault_of, KIND)
    tau, C, bend = (function(arrays, name) for name in FUNCTIONS.values())
    fields = Spanned(arrays["X"], arrays["U"], bend, Part(arrays["tau.modes"], tau),
                     C and Part(arrays["C.modes"], C), arrays["mu"], record(Cells, arrays, "cells"))
    return Model(fields, arrays["xhat"], arrays["rest"], about)


def is_one(arrays):
    """Whether the arrays of a file are those of fields of modes."""
    return str(arrays.get("kind")) == KIND


def arrays_of(model):
    """The arrays of a file by name."""
    fields = model.decoder
    found = {name: getattr(fields, name) for name in OWN}
    found |= {name: getattr(model, name) for name in MODEL} | named(fields.cells, "cells")
    if fields.bend is not None:
        found |= named(fields.bend, "bend")
    for name, part in (("tau", fields.tau), ("C", fields.C)):
        if part is not None:
            found |= {f"{name}.modes": part.modes} | named(part.coefficients, FUNCTIONS[name])
    return {"kind": np.array(KIND)} | {
        name: np.asarray(a, dtype=int if name in WHOLE else float) for name, a in found.items()}


def named(record, name):
    """The arrays of a record by their names in a file."""
    return dict(zip(names(type(record), name), record, strict=True))


def record(kind, arrays, name):
    """A record of a kind from the arrays of a file."""
    return kind(*(arrays[own] for own in names(kind, name)))


def function(arrays, name):
    """`Radial` from the arrays of a file; None where it has none of that name."""
    return record(Radial, arrays, name) if f"{name}.w" in arrays else None


def fault_of(arrays):
    """What is wrong with the arrays of a file, or None."""
    if not is_one(arrays):
        return f"its kind is {arrays.get('kind')}, expected {KIND}"
    begun = [group for group in OPTIONAL if set(group) & set(arrays)]
    missing = {*NEEDED, *(name for group in begun for name in group)} - set(arrays)
    if missing:
        return f"it lacks {', '.join(sorted(missing))}"
    for name in sorted(set(AXES) & set(arrays)):
        if arrays[name].ndim != AXES[name]:
            return f"{name} has {arrays[name].ndim} axes, expected {AXES[name]}"
    if ("bend.w" in arrays) != (arrays["U"].shape[2] > arrays["xhat"].shape[2]):
        return "modes beyond the latent coordinates and their coefficients do not go together"
    return fault_of_numbers(arrays) or fault_of_blocks(record(Cells, arrays, "cells"))


def fault_of_numbers(arrays):
    """What is wrong with shapes, types and values, or None."""
    for name, shape in shapes(arrays).items():
        if arrays[name].shape != shape:
            return f"{name} has shape {arrays[name].shape}, expected {shape}"
        if arrays[name].dtype.kind != ("i" if name in WHOLE else "f"):
            return f"{name} is of type {arrays[name].dtype}"
        if name.endswith(".unit"):
            if not (arrays[name] > 0.0).all():
                return f"{name} has numbers that are not positive"
            if arrays[name.replace("unit", "centers")][:, np.isinf(arrays[name])].any():
                return f"{name} is infinite of coordinates that vary"
        elif not np.isfinite(arrays[name]).all():
            return f"{name} has numbers that are not finite"
    return None


def fault_of_blocks(cells):
    """What is wrong with the blocks of points, or None."""
    n = len(cells.order)
    ends = cells.start[0] == 0 and cells.start[-1] == n and (np.diff(cells.start) > 0).all()
    if not (ends and np.array_equal(np.sort(cells.order), np.arange(n))):
        return "its blocks do not hold each point once"
    if not ((cells.middle >= 0) & (cells.middle < n)).all():
        return "the middle of a block is no point"
    return None


def shapes(arrays):
    """Shape of each array, as those of U, xhat, mu and the modes tell them."""
    (n, d, R), r, q = arrays["U"].shape, arrays["xhat"].shape[2], len(arrays["mu"])
    blocks = arrays["cells.middle"].size
    found = {"X": (n, d), "U": (n, d, R), "mu": (q,), "xhat": (*arrays["xhat"].shape[:2], r),
             "rest": (r,), "cells.order": (n,), "cells.start": (blocks + 1,),
             "cells.middle": (blocks,), "cells.rest": (blocks,), "cells.spread": (blocks, R)}
    sizes = {"tau": (d * (d + 1) // 2, r + q), "C": (d * d, r)}
    for name, (k, inputs) in sizes.items():
        if f"{name}.modes" in arrays:
            count = arrays[f"{name}.modes"].shape[-1]
            found |= {f"{name}.modes": (n, k, count)}
            found |= of_function(arrays, FUNCTIONS[name], inputs, count)
    return found | (of_function(arrays, "bend", r, R - r) if "bend.w" in arrays else {})


def of_function(arrays, name, inputs, count):
    """Shapes of the arrays of a `Radial` with so many inputs and values."""
    centers = arrays[f"{name}.centers"].shape[0]
    return {f"{name}.centers": (centers, inputs), f"{name}.unit": (inputs,),
            f"{name}.w": (centers, count), f"{name}.tail": (1 + inputs, count)}
