"""Trained laws as a file (see `sealed`): an elastic and a plastic network, and their answers."""

import json
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..sealed import about_of, opened, sealed, write_whole
from . import response
from .invariants import count

FORMAT = 1
PARTS = ("elastic", "plastic")
KINDS = {kind.__name__: kind for kind in (response.Stress, response.SymmetricStress,
                                          response.PlainStress, response.Correction,
                                          response.PlainCorrection)}


class Trained(NamedTuple):
    """A law: layers [(W (in, out), b (out,))] with GELU between them, and the kind of answer."""

    layers: tuple
    kind: tuple             # a NamedTuple of `response`


class Laws(NamedTuple):
    """Two trained laws, and what is known of their training."""

    elastic: Trained        # F -> tau [Pa]
    plastic: Trained        # trial F -> F
    about: dict             # plain values


def save(path, laws):
    """Write `Laws`, whole or not at all. Raises ValueError for numbers that are not finite or sizes
    that do not fit, OSError where the system refuses.
    """
    arrays = {"format": np.array(FORMAT),
              "about": np.array(json.dumps(laws.about, sort_keys=True, allow_nan=False))}
    for part in PARTS:
        arrays |= arrays_of(part, getattr(laws, part))
    fault = fault_of(arrays)
    if fault:
        raise ValueError(f"{path} is not written: {fault}")
    write_whole(Path(path), sealed(arrays))


def load(path):
    """Read what `save` wrote. Raises ValueError saying what is wrong with the file."""
    arrays = opened(Path(path))
    if arrays.get("format") != FORMAT:
        raise ValueError(f"{path} has format {arrays.get('format')}, this program reads {FORMAT}; "
                         "use the version that wrote it, or train again")
    fault = fault_of(arrays)
    if fault:
        raise ValueError(f"{path} holds no trained laws: {fault}; train again")
    return Laws(*(trained_of(part, arrays) for part in PARTS), about_of(path, arrays))


def arrays_of(part, law):
    """The arrays of a law by name."""
    found = {f"{part}_kind": np.array(type(law.kind).__name__),
             f"{part}_constants": np.array(law.kind, dtype=float)}
    for k, (W, b) in enumerate(law.layers):
        found |= {f"{part}_W{k}": np.asarray(W, float), f"{part}_b{k}": np.asarray(b, float)}
    return found


def trained_of(part, arrays):
    """`Trained` from the arrays of a file."""
    kind = KINDS[str(arrays[f"{part}_kind"])]
    layers = tuple((arrays[f"{part}_W{k}"], arrays[f"{part}_b{k}"])
                   for k in range(depth(part, arrays)))
    return Trained(layers, kind(*arrays[f"{part}_constants"].tolist()))


def depth(part, arrays):
    """How many layers a law has."""
    return sum(name.startswith(f"{part}_W") for name in arrays)


def fault_of(arrays):
    """What is wrong with the arrays of a file, or None."""
    for part in PARTS:
        if str(arrays.get(f"{part}_kind")) not in KINDS:
            return f"{part} law of kind {arrays.get(f'{part}_kind')}"
        layers = depth(part, arrays)
        names = [f"{part}_{what}{k}" for k in range(layers) for what in "Wb"]
        missing = [name for name in names if name not in arrays]
        if missing or not layers:
            return f"{part} law without {', '.join(missing) or 'layers'}"
        for name in names:
            if not np.isfinite(arrays[name]).all():
                return f"{name} has numbers that are not finite"
        sizes = [arrays[f"{part}_W{k}"].shape for k in range(layers)]
        inner = [a[1] == b[0] for a, b in pairwise(sizes)]
        ends = (sizes[0][0], sizes[-1][1])
        if not all(inner) or ends not in {(count(d), d * d) for d in (2, 3)}:
            return f"{part} law with layers of sizes {sizes}"
        if any(arrays[f"{part}_b{k}"].shape != (sizes[k][1],) for k in range(layers)):
            return f"{part} law with biases that do not fit"
    return None
