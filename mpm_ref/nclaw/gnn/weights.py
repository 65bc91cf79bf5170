"""A trained graph network as a file (see `store.weights_file`); its weights are in single
precision.
"""

from itertools import pairwise

import numpy as np

from ...store.weights_file import header, read, write
from .features import HISTORY, FeatureSettings, MotionScales
from .network import GraphWeights, PerceptronWeights
from .simulator import Simulator

FORMAT = "gnn 1"
LAYERS = 3          # of each perceptron
NUMBERS = ("radius", "dt")


def save(path, simulator):
    """Write a `Simulator`, whole or not at all; weights are rounded to single precision.

    Raises ValueError for sizes that do not fit, numbers that are not finite or not positive, and an
    `about` with more than JSON knows; OSError where the system refuses.
    """
    write(path, arrays_of(simulator) | header(path, FORMAT, simulator.about), fault_of)


def load(path):
    """Read what `save` wrote. Raises ValueError saying what is wrong with the file."""
    arrays, about = read(path, FORMAT, fault_of, "trained graph network")
    radius, dt = (float(arrays[name]) for name in NUMBERS)
    scales = MotionScales(*(arrays[name] for name in MotionScales._fields))
    return Simulator(network_of(arrays), FeatureSettings(radius, dt, scales), about)


def named(network):
    """Yield (name, `PerceptronWeights`) of all of a network."""
    yield "points", network.points
    yield "edges", network.edges
    for k, (of_edges, of_points) in enumerate(network.blocks):
        yield f"edges_{k}", of_edges
        yield f"points_{k}", of_points
    yield "answer", network.answer


def arrays_of(simulator):
    """Return the numbers of a file by name."""
    (radius, dt, scales), arrays = simulator.reading, {}
    for name, perceptron in named(simulator.network):
        for l, (W, b) in enumerate(perceptron.layers):
            arrays |= {f"{name}_W{l}": W, f"{name}_b{l}": b}
        arrays |= dict(zip((f"{name}_gain", f"{name}_shift"), perceptron.norm, strict=False))
    return {**{name: np.asarray(a, np.float32) for name, a in arrays.items()},
            **{name: np.asarray(a, float) for name, a in scales._asdict().items()},
            "radius": np.array(float(radius)), "dt": np.array(float(dt))}


def network_of(arrays):
    """Return the `GraphWeights` of the arrays of a file, in doubles."""
    def perceptron(name):
        layers = tuple((double(f"{name}_W{l}"), double(f"{name}_b{l}")) for l in range(LAYERS))
        norm = () if name == "answer" else (double(f"{name}_gain"), double(f"{name}_shift"))
        return PerceptronWeights(layers, norm)

    def double(name):
        return arrays[name].astype(float)

    blocks = tuple((perceptron(f"edges_{k}"), perceptron(f"points_{k}"))
                   for k in range(blocks_of(arrays)))
    return GraphWeights(perceptron("points"), perceptron("edges"), blocks, perceptron("answer"))


def blocks_of(arrays):
    """Return the number of blocks that pass messages."""
    return sum(name.startswith("edges_") and name.endswith("_gain") and name != "edges_gain"
               for name in arrays)


def fault_of(arrays):
    """Return a sentence on what is wrong with the arrays of a file, or None."""
    W, v_mean = arrays.get("points_W0"), arrays.get("v_mean")
    if W is None or v_mean is None or (W.ndim, v_mean.ndim) != (2, 1):
        return "it lacks points_W0 or v_mean, or they are no matrix and no vector"
    shapes = shapes_of(W.shape[1], blocks_of(arrays), len(v_mean))
    missing = sorted(shapes.keys() - arrays.keys())
    if missing:
        return f"it lacks {', '.join(missing)}"
    strange = sorted(arrays.keys() - shapes.keys() - {"format", "about"})
    if strange:
        return f"it has {', '.join(strange)}, which belong to no network of {LAYERS} layers each"
    for name, shape in shapes.items():
        if arrays[name].shape != shape:
            return f"{name} has shape {arrays[name].shape}, expected {shape}"
        if arrays[name].dtype.kind != "f" or not np.isfinite(arrays[name]).all():
            return f"{name} has entries that are not finite numbers"
    for name in (*NUMBERS, "v_std", "a_std"):
        if not (arrays[name] > 0.0).all():
            return f"{name} has entries that are not positive"
    return None


def shapes_of(width, blocks, d):
    """Return {name: shape} of the arrays of a network with a number of blocks in d dimensions."""
    shapes = {**dict.fromkeys(NUMBERS, ()), **dict.fromkeys(MotionScales._fields, (d,))}
    ends = {"points": ((HISTORY + 2) * d, width), "edges": (d + 1, width), "answer": (width, d)}
    for k in range(blocks):
        ends |= {f"edges_{k}": (3 * width, width), f"points_{k}": (2 * width, width)}
    for name, (inputs, outputs) in ends.items():
        for l, (n, m) in enumerate(pairwise((inputs, *(LAYERS - 1) * (width,), outputs))):
            shapes |= {f"{name}_W{l}": (n, m), f"{name}_b{l}": (m,)}
        if name != "answer":
            shapes |= {f"{name}_gain": (width,), f"{name}_shift": (width,)}
    return shapes
