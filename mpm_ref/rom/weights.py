"""A trained map as a file (see `archive`)."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..store.weights_file import read, stated, write
from .fields.network import Decoder, Units
from .fields.perceptron import Network, layers_of, network

FORMAT = 1
SHOWN = 12          # values of a list that a sentence shows


class Model(NamedTuple):
    """A trained map, and what is known of its training."""

    decoder: Decoder
    xhat: np.ndarray        # (s, k + 1, r) latent coordinates of the training snapshots
    rest: np.ndarray        # (r,) of the body at rest
    about: dict             # settings, seed, command, commit, data, date, versions: plain values


def save(path, model):
    """Write a `Model`, whole or not at all. Raises ValueError for sizes that do not fit, numbers
    that are not finite and an `about` with more than JSON knows, OSError where the system refuses.
    """
    write(path, stated(path, FORMAT, model.about) | arrays_of(model), fault_of)


def load(path):
    """Read what `save` wrote. Raises ValueError saying what is wrong with the file."""
    arrays, about = read(path, FORMAT, fault_of, "trained map")
    net = Network(arrays["sizes"].astype(int), arrays["W"], arrays["b"])
    units = Units(*(arrays[name] for name in Units._fields))
    return Model(Decoder(network(layers_of(net)), units), arrays["xhat"], arrays["rest"],
                 about)


def arrays_of(model):
    """The numbers of a file by name; transposed weights are made anew on loading."""
    net, units = model.decoder
    numbers = {"W": net.W, "b": net.b, **units._asdict(), "xhat": model.xhat, "rest": model.rest}
    return {"sizes": np.array(net.sizes),
            **{name: np.array(a, dtype=float) for name, a in numbers.items()}}


def fault_of(arrays):
    """What is wrong with the arrays of a file, or None."""
    missing = {"about", "sizes", "W", "b", *Units._fields, "xhat", "rest"} - set(arrays)
    if missing:
        return f"it lacks {', '.join(sorted(missing))}"
    if fault := fault_of_sizes(arrays["sizes"]):
        return fault
    for name, shape in shapes(arrays["sizes"].tolist(), arrays["xhat"].shape).items():
        if arrays[name].shape != shape:
            return f"{name} has shape {arrays[name].shape}, expected {shape}"
        if arrays[name].dtype.kind != "f":
            return f"{name} is of type {arrays[name].dtype}, expected floating-point numbers"
        if not np.isfinite(arrays[name]).all():
            return f"{name} has numbers that are not finite"
    if not (arrays["span"].min() > 0.0 and arrays["std"].min() > 0.0):
        return "span or std has numbers that are not positive"
    return None


def fault_of_sizes(sizes):
    """What is wrong with the widths of layers, or None."""
    if sizes.ndim != 1 or sizes.dtype.kind not in "iu":
        return (f"sizes is an array of shape {sizes.shape} and type {sizes.dtype}: expected whole "
                "numbers d + r, .., d")
    if sizes.min(initial=1) < 1 or len(sizes) < 2 or sizes[0] <= sizes[-1]:
        return f"layers of sizes {in_short(sizes.tolist())}: expected d + r, .., d"
    return None


def in_short(values):
    """A list as text; of a long one, its first values and how many there are."""
    if len(values) <= SHOWN:
        return str(values)
    return f"{str(values[:SHOWN])[:-1]}, .. {len(values)} in all]"


def shapes(sizes, found):
    """Shape of each array of numbers, for layers of these sizes; xhat is found with some shape."""
    d, r = sizes[-1], sizes[0] - sizes[-1]
    runs_and_levels = found[:2] if len(found) == 3 else ("runs", "levels")
    return {"W": (sum(n * m for n, m in pairwise(sizes)),), "b": (sum(sizes[1:]),),
            **{name: (d,) for name in Units._fields},
            "xhat": (*runs_and_levels, r), "rest": (r,)}
