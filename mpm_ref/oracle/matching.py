"""Another code's arrays put into the order of the golden file: by node, particle and pair."""

from typing import NamedTuple

import numpy as np

from .schema import COUNTED, SUMS


class NotComparable(ValueError):
    """A file is not what it should be, or does not tell its order."""


class Mismatch(Exception):
    """An array as a whole does not match; the message says how. It is what a check reports."""


class Other(NamedTuple):
    """One array of the other code in the golden order."""

    value: np.ndarray     # shaped as the golden array
    given: np.ndarray     # the same shape: which entries there are
    extra: np.ndarray     # what it has where the golden file has nothing, which means 0


def refuse_no_numbers(name, a):
    """Raise NotComparable unless an array, or a dataset, holds real numbers, and whole ones where
    they number nodes or particles.
    """
    whole_ones = name.split("/")[-1] in COUNTED
    if a.dtype.kind not in ("iu" if whole_ones else "iuf"):
        raise NotComparable(f"array {name!r} has the type {a.dtype}: expected "
                            f"{'whole' if whole_ones else 'real'} numbers")


def matched(group, theirs, array, name):
    """`Other` for one array of a golden step; `theirs` has the other code's arrays of that step.

    Raises `Mismatch` where shapes, nodes or particles do not match, NotComparable where nodes are
    not told.
    """
    a, golden = theirs[name][()], group[name][()]
    if array.where == "nodes":
        return by_node(group, theirs, array, a, golden)
    if array.where in ("body", "parameters", "step"):
        require_shape(a, golden.shape)
        return whole(a)
    body = name.partition("/")[0]
    a = by_particle(theirs, body, a)
    require_particles(a, golden.shape)
    return by_pair(group, theirs, body, a, golden) if array.where == "pairs" else whole(a)


def nodes_of(array):
    """Name of the list of nodes that an array is on."""
    return f"nodes{array.level or ''}"


def whole(a):
    """All entries are there."""
    return Other(a, np.ones(a.shape, bool), np.empty(0))


def require_shape(a, shape):
    """Raise `Mismatch` for another shape."""
    if a.shape != tuple(shape):
        raise Mismatch(f"has shape {a.shape}, expected {tuple(shape)}")


def require_particles(a, shape):
    """Raise `Mismatch` for another shape, with a question where the particles are not as many."""
    try:
        require_shape(a, shape)
    except Mismatch as mismatch:
        if a.shape[:1] == tuple(shape[:1]):
            raise
        raise Mismatch(f"{mismatch}; is it the same scene?") from None


def by_particle(theirs, body, a):
    """Particles in the golden order, by `id` where there is one."""
    if f"{body}/id" not in theirs:
        return a
    id_ = theirs[f"{body}/id"][()]
    if id_.shape != a.shape[:1] or not np.array_equal(np.sort(id_), np.arange(len(a))):
        raise Mismatch(f"{body}/id does not number its {len(a)} particles from 0 to {len(a) - 1}")
    out = np.empty_like(a)
    out[id_] = a
    return out


def by_node(group, theirs, array, a, golden):
    """Values on the golden nodes; sums are 0 at nodes that are not listed."""
    name, listing = array.name, nodes_of(array)
    if listing not in theirs:
        raise NotComparable(f"{name} is given without `{listing}`: expected (M, d) integer "
                            "coordinates")
    nodes, ours = theirs[listing][()], group[listing][()]
    if nodes.shape[1:] != ours.shape[1:]:
        raise NotComparable(f"{listing} has shape {nodes.shape}: expected (M, {ours.shape[1]}) "
                            "integer coordinates")
    require_shape(a, (len(nodes), *golden.shape[1:]))
    place = {tuple(i): k for k, i in enumerate(nodes.tolist())}
    if len(place) < len(nodes):
        raise Mismatch(f"{len(nodes) - len(place)} of its nodes are listed twice")
    at = np.array([place.get(tuple(i), -1) for i in ours.tolist()])
    value, found = a[at], at >= 0
    value[~found] = 0
    given = np.broadcast_to(found.reshape(-1, *(1,) * (a.ndim - 1)), value.shape)
    if name in SUMS:
        return Other(value, np.ones(value.shape, bool), np.delete(a, at[found], axis=0))
    require_nodes(group, ours, found)
    return Other(value, given, np.empty(0))


def require_nodes(group, nodes, found):
    """Raise `Mismatch` if a node is not given whose mass is more than its tolerance."""
    m = group["mass"]
    missing = ~found & (m[()] > m.attrs["tolerance_f32"] * group["scale/mass"][()])
    if missing.any():
        k = np.argmax(missing * m[()])
        raise Mismatch(f"node {tuple(nodes[k].tolist())}, with mass {m[k]:.3g}, is not given")


def by_pair(group, theirs, body, a, golden):
    """Weights of the same nodes, whichever base node was taken; 0 for nodes not reached."""
    base = group[f"{body}/base"][()]
    if f"{body}/base" not in theirs:
        return whole(a)
    theirs_base = by_particle(theirs, body, theirs[f"{body}/base"][()])
    require_particles(theirs_base, base.shape)
    d = base.shape[1]
    width = round(golden.shape[1] ** (1 / d))
    offset = np.array(list(np.ndindex(*d * (width,))))
    node = (theirs_base - base)[:, None] + offset
    inside = ((node >= 0) & (node < width)).all(axis=2)
    value = np.zeros_like(a)
    p, s = np.nonzero(inside)
    value[p, np.ravel_multi_index(tuple(node[inside].T), d * (width,))] = a[p, s]
    return Other(value, np.ones(a.shape, bool), a[~inside])
