"""Another code's arrays against a golden file: the first stage that departs, and where."""

import json
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np

from .recording import shaped_as
from .report import Departure, Report
from .schema import BESIDE, COUNTED, ENERGIES, EVERY, FORMAT, SUMS, arrays_of, key

RECORDED = "a golden file, which `mpm-ref oracle record SCENE -o FILE` writes"
WRITTEN = "the other code's arrays in HDF5, which `mpm_ref.oracle.write` writes"


class NotComparable(ValueError):
    """A file is not what it should be, or does not tell its order."""


class Mismatch(Exception):
    """An array as a whole does not match; the message says how. It is what a check reports."""


class Other(NamedTuple):
    """One array of the other code in the golden order."""

    value: np.ndarray     # shaped as the golden array
    given: np.ndarray     # the same shape: which entries there are
    extra: np.ndarray     # what it has where the golden file has nothing, which means 0


def check(golden, other, precision="auto"):
    """`Report` on the file `other`, written by `files.write`, against the golden file.

    precision "f64" or "f32" selects the tolerances; "auto" takes f32 if an array of the other file
    has that type. Not a number on either side departs; what is not given is listed. Raises
    NotComparable for a file without the layout, or without the order of its nodes.
    """
    if precision not in ("auto", "f64", "f32"):
        raise NotComparable(f"precision = {precision!r}: expected 'f64', 'f32' or 'auto'")
    with opened(golden, RECORDED) as g, opened(other, WRITTEN) as o:
        if g.attrs.get("format") != FORMAT:
            raise NotComparable(f"{golden}: no golden file, its format is {g.attrs.get('format')!r}"
                                f"; expected {RECORDED}")
        if not isinstance(o.get("steps"), h5py.Group):
            raise NotComparable(f"{other}: it has no group 'steps'; write it with `oracle.write`")
        bodies, arrays = list(g["bodies"]), arrays_of(g.attrs.get("integrator"))
        given = {step: keys_of(o["steps"][step], bodies) for step in o["steps"]}
        if precision == "auto":
            types = {a.dtype for theirs in given.values() for a in theirs.values()}
            precision = "f32" if np.dtype(np.float32) in types else "f64"
        return compared(g["steps"], given, (arrays, bodies), precision)


def opened(path, expected):
    """The file, for reading; NotComparable if it is not there, not HDF5 or cut short."""
    if not Path(path).is_file():
        what = "this is a folder" if Path(path).is_dir() else "there is no such file"
        raise NotComparable(f"{path}: {what}; expected {expected}")
    try:
        return h5py.File(path, "r")
    except OSError as e:
        why = "it is empty" if Path(path).stat().st_size == 0 else str(e).splitlines()[0]
        raise NotComparable(f"{path}: cannot be read as HDF5 ({why}); expected {expected}") from e


def keys_of(group, bodies):
    """{key: dataset} of one step of the other file; the name of a single body may be left out.
    Raises NotComparable for datasets without numbers.
    """
    of_particles = {a.name for a in EVERY if key(a) != a.name} | {"base", "id"}
    found = {}

    def visit(name, item):
        if isinstance(item, h5py.Dataset):
            refuse_no_numbers(name, item)
            alone = len(bodies) == 1 and name in of_particles
            found[f"{bodies[0]}/{name}" if alone else name] = item

    group.visititems(visit)
    ours = {"scale", "bar"}.difference(bodies)          # of a golden file that is checked itself
    return {name: item for name, item in found.items() if name.split("/")[0] not in ours}


def compared(steps, given, names, precision):
    """The `Report` over all steps and arrays, in the order of the stages; names are the arrays
    that there may be, and the bodies.
    """
    departures, missing, count, nearest, found = [], set(), 0, 0.0, set()
    unknown = {name for theirs in given.values() for name in theirs
               if name.split("/")[-1] not in BESIDE}
    unknown |= {f"step {step}" for step in given if step not in steps}
    for step in sorted(steps, key=int):
        theirs = given.get(step, {})
        for array, name in named(steps[step], *names):
            unknown.discard(name)
            if name not in theirs:
                missing.add(name if theirs else f"step {step}")
                continue
            count += 1
            found.add(step)
            departure, off = distance(steps[step], theirs, array, name, precision)
            if departure is not None:
                departures.append(Departure(int(step), array.stage, name, **departure))
            nearest = max(nearest, off)
    return Report(not departures and count > 0, precision, (len(found), len(steps)), count,
                  float(nearest), tuple(departures), tuple(sorted(missing)), tuple(sorted(unknown)))


def named(group, arrays, bodies):
    """The arrays of a golden step in the order of the stages: pairs of `Array` and key."""
    for array in arrays:
        for name in dict.fromkeys(key(array, body) for body in bodies):
            if name in group:
                yield array, name


def distance(group, theirs, array, name, precision):
    """What departs in one array, or None; and its largest difference over the tolerance if not."""
    golden, scale = group[name][()], group[f"scale/{name}"][()]
    if not np.isfinite(golden).all():
        return {"what": "the golden file holds numbers that are not finite"}, 0.0
    try:
        other = matched(group, theirs, array, name)
    except Mismatch as mismatch:
        return {"what": str(mismatch)}, 0.0
    bad = np.argwhere(other.given & ~np.isfinite(other.value))
    if len(bad) or not np.isfinite(other.extra).all():
        at = words(group, array, name, tuple(bad[0])) if len(bad) else "a node that is not golden"
        return {"where": at, "what": f"{at} is not finite"}, 0.0
    tol = group[name].attrs[f"tolerance_{precision}"] * scale
    if f"bar/{name}" in group:
        tol = tol + group[f"bar/{name}"][()]
    tol = np.broadcast_to(shaped_as(tol, golden), golden.shape)
    off = np.where(other.given, abs(other.value - golden), 0.0)
    units = in_units(off, tol)
    i = np.unravel_index(np.argmax(units), units.shape)
    if units[i] > 1.0:
        return {"where": words(group, array, name, i), "golden": float(golden[i]),
                "other": float(other.value[i]), "difference": float(off[i]),
                "tolerance": float(tol[i])}, 0.0
    beyond = abs(other.extra).max(initial=0.0)
    if beyond > tol.max():
        return {"what": f"{beyond:.3g} at a node where the golden file has 0, which is more than "
                        f"the tolerance {tol.max():.3g}"}, 0.0
    return None, max(units[i], in_units(beyond, tol.max()))


def in_units(off, tol):
    """Differences in units of their tolerances. Where all that enters an entry is 0 so is its
    tolerance: no difference is 0 of it then, and any other is infinitely often.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return np.where(off > 0.0, off / tol, 0.0)


def words(group, array, name, i):
    """The entry i of an array in words: which node, particle, component, parameter."""
    if array.where == "body":
        return ENERGIES[i[0]]
    if array.where == "parameters":
        body, _, role = name.partition("/")
        record = group.file[f"bodies/{body}"].attrs[f"{role.removesuffix('_grad')}_parameters"]
        return f"parameter {list(json.loads(record))[i[0]]}"
    if array.where == "step":
        return "the sum" if group[name].size == 1 else f"component {i[0]}"
    component = f" component {', '.join(map(str, i[1:]))}" if len(i) > 1 else ""
    if array.where == "nodes":
        level = f" of level {array.level}" if array.level else ""
        return f"node {tuple(group[nodes_of(array)][i[0]].tolist())}{level}{component}"
    if array.where == "pairs":
        base = group[f"{name.partition('/')[0]}/base"][i[0]]
        d = len(base)
        width = round(group[name].shape[1] ** (1 / d))
        node = base + np.array(np.unravel_index(i[1], d * (width,)))
        return f"particle {i[0]}, node {tuple(node.tolist())}"
    return f"particle {i[0]}{component}"


# the other code's arrays in the order of the golden file: by node, particle and pair

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
