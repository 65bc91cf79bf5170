"""NSF's three networks as a file (see `archive`).

The arrays of position, stress and affine field begin with "g.", "h." and "l."; those of g are the
ones of `weights`. Arrays that single precision holds exactly, as it does trained weights, are
stored so.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..store import weights_file
from . import weights
from .fields.network import Decoder, Field, FieldUnits, Units, misfit
from .fields.perceptron import Network, count, layers_of, network

FORMAT = 1
WHAT = "three networks of stress fields"
NUMBERS = ("W", "b", *FieldUnits._fields)


class Model(NamedTuple):
    """Three trained networks, and what is known of their training."""

    g: Decoder              # position
    h: Field                # stress
    l: Field                # affine field
    xhat: np.ndarray        # (s, k + 1, r) latent coordinates of the training snapshots
    rest: np.ndarray        # (r,) near those of the start, from where a run searches its own
    about: dict             # settings, seed, command, commit, data, date, versions: plain values


def save(path, model):
    """Write a `Model`, whole or not at all. Raises ValueError for networks that do not fit each
    other, numbers that are not finite and an `about` with more than JSON knows, OSError where the
    system refuses.
    """
    stated = weights_file.stated(path, FORMAT, model.about)
    weights_file.write(path, stated | arrays_of(model), fault_of)


def load(path):
    """Read what `save` wrote. Raises ValueError saying what is wrong with the file."""
    stored, about = weights_file.read(path, FORMAT, fault_of, WHAT)
    arrays = {name: a.astype(float) if a.dtype.kind == "f" else a for name, a in stored.items()}
    own = part(arrays, "g")
    return Model(*networks_of(arrays), own["xhat"], own["rest"], about)


def arrays_of(model):
    """The numbers of a file by name."""
    parts = {"g": weights.arrays_of(weights.Model(model.g, model.xhat, model.rest, model.about)),
             "h": arrays_of_field(model.h), "l": arrays_of_field(model.l)}
    return {f"{name}.{key}": compact(a) for name, own in parts.items() for key, a in own.items()}


def compact(a):
    """An array, in single precision where that loses nothing."""
    if a.dtype.kind != "f":
        return a
    with np.errstate(over="ignore"):
        single = a.astype(np.float32)
    return single if np.array_equal(single, a) else a


def arrays_of_field(field):
    """The numbers of a `Field` by name."""
    numbers = {"W": field.net.W, "b": field.net.b, **field.units._asdict()}
    waves = {"octaves": np.array(field.octaves)} if field.octaves else {}
    return {"sizes": np.array(field.net.sizes), **waves,
            **{name: np.array(a, dtype=float) for name, a in numbers.items()}}


def part(arrays, name):
    """The arrays of one network, by the rest of their names."""
    return {key.removeprefix(f"{name}."): a for key, a in arrays.items()
            if key.startswith(f"{name}.")}


def networks_of(arrays):
    """`Decoder`, `Field` and `Field` from the arrays of a file."""
    g, h, l = (part(arrays, name) for name in "ghl")
    return (Decoder(network_of(g), Units(*(g[name] for name in Units._fields))),
            *(Field(network_of(own), FieldUnits(*(own[name] for name in FieldUnits._fields)),
                    int(own.get("octaves", 0))) for own in (h, l)))


def network_of(own):
    """`Network` from its arrays; transposed weights are made anew."""
    return network(layers_of(Network(own["sizes"].astype(int), own["W"], own["b"])))


def fault_of(arrays):
    """What is wrong with the arrays of a file, or None."""
    faults = {"g": weights.fault_of(part(arrays, "g") | {"about": None}),
              **{name: fault_of_field(part(arrays, name)) for name in "hl"}}
    for name, fault in faults.items():
        if fault:
            return f"{name}: {fault}"
    return misfit(*networks_of(arrays))


def fault_of_field(own):
    """What is wrong with the arrays of a `Field`, or None."""
    missing = {"sizes", *NUMBERS} - set(own)
    if missing:
        return f"it lacks {', '.join(sorted(missing))}"
    sizes = own["sizes"]
    if sizes.ndim != 1 or sizes.dtype.kind not in "iu" or len(sizes) < 2 or sizes.min() < 1:
        return (f"sizes is an array of shape {sizes.shape} and type {sizes.dtype}: expected whole "
                "numbers of 1 or more, into each layer and out of the last")
    octaves = own.get("octaves", np.array(0))
    if octaves.shape != () or octaves.dtype.kind not in "iu" or octaves < 0:
        return f"octaves is {octaves}: expected a whole number of 0 or more"
    if own["low"].ndim != 1 or own["mu_mean"].ndim != 1:
        return "low or mu_mean has not one axis"
    read = count(len(own["low"]), int(octaves)) + len(own["mu_mean"])
    if sizes[0] <= read:
        return (f"its first layer reads {sizes[0]} numbers, of which places and parameters are "
                f"{read}: expected latent coordinates too")
    for name, shape in shapes(sizes.tolist(), len(own["low"]), len(own["mu_mean"])).items():
        if own[name].shape != shape:
            return f"{name} has shape {own[name].shape}, expected {shape}"
        if own[name].dtype.kind != "f":
            return f"{name} is of type {own[name].dtype}, expected floating-point numbers"
        if not np.isfinite(own[name]).all():
            return f"{name} has numbers that are not finite"
    if not all((own[name] > 0.0).all() for name in ("span", "std", "mu_std")):
        return "span, std or mu_std has numbers that are not positive"
    return None


def shapes(sizes, d, q):
    """Shape of each array of numbers, for layers of these sizes, d axes and q parameters."""
    k = sizes[-1]
    return {"W": (sum(n * m for n, m in pairwise(sizes)),), "b": (sum(sizes[1:]),),
            "low": (d,), "span": (d,), "mean": (k,), "std": (k,), "mu_mean": (q,), "mu_std": (q,)}
