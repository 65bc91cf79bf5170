"""Files of learned laws: an elastic law and a flow, with layers and kind of each.

A kind is a record of numbers, whose type determines the meaning of the layers (W (in, out), b
(out,)); see `store.weights_file` for the bytes:

    answers of `response`       GELU between them; of the invariants, without R also of F - I
    `stretch_network`           ELU between them; from s - 1 to y, d numbers each
    `spline`                    one, the values of f, g, h at knots, b = 0
    `Energetic`                 softplus between them, no W negative; from four measures to N
    `Contraction`               GELU between them; from three strains to a and b before softplus
    of `materials`              none, the record is the law: identified ones, and no return map
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...store.weights_file import header, read, write
from .energetic import Energetic
from .network import dim_of_inputs
from .response import CORRECTIONS, STRESSES
from .table import KINDS, TABLES

FORMAT = 1
PARTS = tuple(TABLES)       # of a file: "elastic", "plastic"


RESPONSES = {kind.__name__ for kind in (*STRESSES, *CORRECTIONS)}


class LawWeights(NamedTuple):
    """The weights of a law: its layers, which may be none, and its kind."""

    layers: tuple           # ((W (in, out), b (out,)), ..)
    kind: tuple             # a NamedTuple of KINDS


class LearnedLaws(NamedTuple):
    """The weights of an elastic law and of a flow, and a record of their training."""

    elastic: LawWeights     # F -> tau [Pa]
    plastic: LawWeights     # trial F -> F
    about: dict             # plain values


def save(path, laws):
    """Write `LearnedLaws`, whole or not at all.

    Raises ValueError for numbers that are not finite, sizes that do not fit and an `about` with
    more than JSON knows, OSError where the system refuses.
    """
    arrays = header(path, FORMAT, laws.about)
    for part in PARTS:
        arrays |= law_arrays(part, getattr(laws, part))
    write(path, arrays, fault_of)


def load(path):
    """Read what `save` wrote. Raises ValueError saying what is wrong with the file."""
    arrays, about = read(path, FORMAT, fault_of, "trained laws")
    return LearnedLaws(*(law_from_arrays(part, arrays) for part in PARTS), about)


def dim_of(laws):
    """Return the number of space dimensions of `LearnedLaws`; 3 of those that are for any."""
    dims = [dim_of_inputs(len(law.layers[0][0])) for law in laws[:2]
            if type(law.kind).__name__ in RESPONSES]
    return dims[0] if dims else 3


def errors_include_velocities(about):
    """Return whether the errors of epochs in an `about` include the loss's term of velocities, as
    in files without the entry `errors_of`.
    """
    return bool(about.get("recipe", {}).get("velocity")) and "errors_of" not in about


def law_arrays(part, law):
    """Return the arrays of a law by name."""
    arrays = {f"{part}_kind": np.array(type(law.kind).__name__),
              f"{part}_constants": np.array(law.kind, dtype=float)}
    for k, (W, b) in enumerate(law.layers):
        arrays |= {f"{part}_W{k}": np.asarray(W, float), f"{part}_b{k}": np.asarray(b, float)}
    return arrays


def law_from_arrays(part, arrays):
    """Return the `LawWeights` from the arrays of a file."""
    kind = KINDS[str(arrays[f"{part}_kind"])]
    layers = tuple((arrays[f"{part}_W{k}"], arrays[f"{part}_b{k}"])
                   for k in range(depth(part, arrays)))
    return LawWeights(layers, kind(*arrays[f"{part}_constants"].tolist()))


def depth(part, arrays):
    """Return the number of layers of a law."""
    return sum(name.startswith(f"{part}_W") for name in arrays)


def fault_of(arrays):
    """Return a sentence on what is wrong with the arrays of a file, or None."""
    for part in PARTS:
        fault = fault_of_law(part, arrays)
        if fault:
            return fault
    read = [arrays[f"{part}_W0"].shape[0] for part in PARTS
            if str(arrays[f"{part}_kind"]) in RESPONSES]
    if len(set(read)) > 1:
        return f"laws that read {read[0]} and {read[1]} numbers, expected as many"
    return None


def fault_of_law(part, arrays):
    """Return a sentence on what is wrong with the arrays of a law, or None."""
    kind = str(arrays.get(f"{part}_kind"))
    ends = {one.__name__: entry.ends for one, entry in TABLES[part].items()}
    if kind not in ends:
        return f"{part} law of kind {kind}, expected {' or '.join(ends)}"
    layers = depth(part, arrays)
    names = [f"{part}_{what}{k}" for k in range(layers) for what in "Wb"]
    missing = [name for name in (*names, f"{part}_constants") if name not in arrays]
    if missing or (ends[kind] and not layers):
        return f"{part} law without {', '.join(missing) or 'layers'}"
    for name in (*names, f"{part}_constants"):
        if arrays[name].dtype != float or not np.isfinite(arrays[name]).all():
            return f"{name} has entries that are not finite numbers"
    if arrays[f"{part}_constants"].shape != (len(KINDS[kind]._fields),):
        return f"{part} law with constants {arrays[f'{part}_constants']}"
    if kind == Energetic.__name__ and any((arrays[f"{part}_W{k}"] < 0.0).any()
                                          for k in range(layers)):
        return f"{part} law of an energy with negative weights"
    return fault_of_sizes(part, arrays, ends[kind])


def fault_of_sizes(part, arrays, ends):
    """Return a sentence on what is wrong with the sizes of a law's layers, or None.

    ends: the pairs of inputs and outputs that they may have.
    """
    layers = range(depth(part, arrays))
    sizes = [arrays[f"{part}_W{k}"].shape for k in layers]
    if (any(len(size) != 2 for size in sizes) or any(a[1] != b[0] for a, b in pairwise(sizes))
            or (sizes and (sizes[0][0], sizes[-1][1]) not in ends)):
        return f"{part} law with layers of sizes {sizes}"
    if any(arrays[f"{part}_b{k}"].shape != (sizes[k][1],) for k in layers):
        return f"{part} law with biases that do not fit"
    return None
