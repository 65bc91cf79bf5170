"""Compare another code's arrays with a golden file: which stage departs first, and where."""

import json
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np

from ..store.foreign import Unreadable, copied
from ..store.seal import DAMAGED, GOLDEN, UNSEALED, verify
from .recording import expand_like
from .report import CheckReport, Departure
from .schema import ALL_ARRAYS, AUXILIARY, ENERGIES, FORMAT, INTEGERS, SUMS, key, stage_arrays

RECORDED = "a golden file, which `mpm-ref oracle record SCENE -o FILE` writes"
WRITTEN = "the other code's arrays in HDF5, which `mpm_ref.oracle.write` writes"


class NotComparable(ValueError):
    """A file that cannot be compared: it has another layout, or no order of its nodes."""


class Mismatch(Exception):
    """An array does not match the golden one; the message, which says how, goes into the report."""


class MatchedArray(NamedTuple):
    """One array of the other code, in the order of the golden file."""

    value: np.ndarray     # shaped as the golden array
    given: np.ndarray     # of the same shape: whether an entry was given
    extra: np.ndarray     # entries at nodes that the golden file does not have, where it means 0


def check(golden, other, precision="auto"):
    """Return the `CheckReport` on the file `other`, written by `write`, against the golden file.

    precision "f64" or "f32" selects the tolerances; "auto" takes f32 if an array of the other file
    has that type. NaN and infinity on either side depart; arrays that are not given are listed.
    Raises NotComparable for a file that is damaged, without the layout, or without the order of its
    nodes.
    """
    if precision not in ("auto", "f64", "f32"):
        raise NotComparable(f"precision = {precision!r}: expected 'f64', 'f32' or 'auto'")
    with open_file(golden, RECORDED) as g, open_other(other) as o, readable(other):
        if g.attrs.get("format") != FORMAT:
            raise NotComparable(f"{golden}: not a golden file, its format is "
                                f"{g.attrs.get('format')!r}; expected {RECORDED}")
        if not isinstance(o.get("steps"), h5py.Group):
            raise NotComparable(f"{other}: it has no group 'steps'; write it with `oracle.write`")
        bodies, arrays = list(g["bodies"]), stage_arrays(g.attrs.get("integrator"))
        given = {step: given_arrays(o["steps"][step], bodies) for step in o["steps"]}
        if precision == "auto":
            types = {a.dtype for theirs in given.values() for a in theirs.values()}
            precision = "f32" if np.dtype(np.float32) in types else "f64"
        return compare_steps(g["steps"], given, (arrays, bodies), precision)


def open_file(path, expected):
    """Return the open HDF5 file; raise NotComparable if it is missing, not HDF5 or cut short."""
    if not Path(path).is_file():
        what = "this is a folder" if Path(path).is_dir() else "there is no such file"
        raise NotComparable(f"{path}: {what}; expected {expected}")
    try:
        require_whole(path, expected)
        return h5py.File(path, "r")
    except OSError as e:
        why = "it is empty" if Path(path).stat().st_size == 0 else str(e).splitlines()[0]
        raise NotComparable(f"{path}: cannot be read as HDF5 ({why}); expected {expected}") from e


@contextmanager
def open_other(path):
    """Yield the other code's open file, or a copy of it if it has no checksum (`store.foreign`)."""
    with ExitStack() as stack:
        if Path(path).is_file() and h5py.is_hdf5(path) and verify(path, GOLDEN) == UNSEALED:
            with readable(path):
                path = stack.enter_context(copied(path, "steps"))
        yield stack.enter_context(open_file(path, WRITTEN))


@contextmanager
def readable(other):
    """Turn what HDF5 raises on damaged tables, of a file without checksum, into NotComparable."""
    try:
        yield
    except (OSError, RuntimeError, KeyError, Unreadable) as fault:
        raise NotComparable(f"{other} cannot be read ({' '.join(str(fault).split())}); expected "
                            f"{WRITTEN}") from fault


def require_whole(path, expected):
    """Raise NotComparable unless a file's checksum fits; only golden files must have one.

    On damaged tables HDF5 may crash or never return, so that this comes first.
    """
    found = verify(path, GOLDEN)
    if found == DAMAGED:
        raise NotComparable(f"{path} is damaged: its bytes are not those that were written; copy "
                            "it again from where it came, or make it again")
    if found == UNSEALED and expected == RECORDED:
        why = ("it is empty" if Path(path).stat().st_size == 0 else
               "it is cut short, or no golden file" if h5py.is_hdf5(path) else
               "it cannot be read as HDF5")
        raise NotComparable(f"{path}: {why}; expected {expected}")


def given_arrays(group, bodies):
    """Return {key: dataset} of one step of the other file, with the name of a single body put in.

    Raises NotComparable for datasets without numbers.
    """
    of_particles = {a.name for a in ALL_ARRAYS if key(a) != a.name} | {"base", "id"}
    datasets = {}

    def visit(name, item):
        if isinstance(item, h5py.Dataset):
            require_numbers(name, item)
            alone = len(bodies) == 1 and name in of_particles
            datasets[f"{bodies[0]}/{name}" if alone else name] = item

    group.visititems(visit)
    ours = {"scale", "bar"}.difference(bodies)          # of a golden file that is checked itself
    return {name: item for name, item in datasets.items() if name.split("/")[0] not in ours}


def compare_steps(steps, given, arrays_and_bodies, precision):
    """Return the `CheckReport` on all steps and arrays, in the order of the stages.

    steps is the golden group, given is {step: {key: dataset}} of the other code; arrays_and_bodies
    are the arrays that a step may have, and the names of the bodies.
    """
    departures, missing, count, nearest, checked = [], set(), 0, 0.0, set()
    unknown = {name for theirs in given.values() for name in theirs
               if name.split("/")[-1] not in AUXILIARY}
    unknown |= {f"step {step}" for step in given if step not in steps}
    for step in sorted(steps, key=int):
        theirs = given.get(step, {})
        for array, name in golden_arrays(steps[step], *arrays_and_bodies):
            unknown.discard(name)
            if name not in theirs:
                missing.add(name if theirs else f"step {step}")
                continue
            count += 1
            checked.add(step)
            departure, off = compare_array(steps[step], theirs, array, name, precision)
            if departure is not None:
                departures.append(Departure(int(step), array.stage, name, **departure))
            nearest = max(nearest, off)
    return CheckReport(not departures and count > 0, precision, (len(checked), len(steps)), count,
                       float(nearest), tuple(departures), tuple(sorted(missing)),
                       tuple(sorted(unknown)))


def golden_arrays(group, arrays, bodies):
    """Yield the arrays of a golden step in the order of the stages: pairs of `Array` and key."""
    for array in arrays:
        for name in dict.fromkeys(key(array, body) for body in bodies):
            if name in group:
                yield array, name


def compare_array(group, theirs, array, name, precision):
    """Return the fields of the `Departure` of one array, or None if it agrees, and a number.

    The number is the largest difference over the tolerance, or 0 if the array departs.
    """
    golden, scale = group[name][()], group[f"scale/{name}"][()]
    if not np.isfinite(golden).all():
        return {"what": "the golden file holds numbers that are not finite"}, 0.0
    try:
        other = match(group, theirs, array, name)
    except Mismatch as mismatch:
        return {"what": str(mismatch)}, 0.0
    bad = np.argwhere(other.given & ~np.isfinite(other.value))
    if len(bad) or not np.isfinite(other.extra).all():
        place = (entry_name(group, array, name, tuple(bad[0])) if len(bad)
                 else "a node that the golden file does not have")
        return {"where": place, "what": f"{place} is not finite"}, 0.0
    tol = group[name].attrs[f"tolerance_{precision}"] * scale
    if f"bar/{name}" in group:
        tol = tol + group[f"bar/{name}"][()]
    tol = np.broadcast_to(expand_like(tol, golden), golden.shape)
    off = np.where(other.given, abs(other.value - golden), 0.0)
    units = in_tolerances(off, tol)
    i = np.unravel_index(np.argmax(units), units.shape)
    if units[i] > 1.0:
        return {"where": entry_name(group, array, name, i), "golden": float(golden[i]),
                "other": float(other.value[i]), "difference": float(off[i]),
                "tolerance": float(tol[i])}, 0.0
    excess = abs(other.extra).max(initial=0.0)
    if excess > tol.max():
        return {"what": f"{excess:.3g} at a node where the golden file has 0, which is more than "
                        f"the tolerance {tol.max():.3g}"}, 0.0
    return None, max(units[i], in_tolerances(excess, tol.max()))


def in_tolerances(off, tol):
    """Return differences in units of their tolerances.

    If all inputs of an entry are 0 so is its tolerance: the result is then 0 for no difference, and
    infinite for any other.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return np.where(off > 0.0, off / tol, 0.0)


def entry_name(group, array, name, i):
    """Return the entry i of an array in words: its node, particle, component or parameter."""
    if array.location == "body":
        return ENERGIES[i[0]]
    if array.location == "parameters":
        body, _, role = name.partition("/")
        record = group.file[f"bodies/{body}"].attrs[f"{role.removesuffix('_grad')}_parameters"]
        return f"parameter {list(json.loads(record))[i[0]]}"
    if array.location == "step":
        return "the sum" if group[name].size == 1 else f"component {i[0]}"
    component = f" component {', '.join(map(str, i[1:]))}" if len(i) > 1 else ""
    if array.location == "nodes":
        level = f" of level {array.level}" if array.level else ""
        return f"node {tuple(group[node_list(array)][i[0]].tolist())}{level}{component}"
    if array.location == "pairs":
        base = group[f"{name.partition('/')[0]}/base"][i[0]]
        d = len(base)
        width = round(group[name].shape[1] ** (1 / d))
        node = base + np.array(np.unravel_index(i[1], d * (width,)))
        return f"particle {i[0]}, node {tuple(node.tolist())}"
    return f"particle {i[0]}{component}"


# the other code's arrays in the order of the golden file: by node, particle and pair

def require_numbers(name, a):
    """Raise NotComparable unless an array or a dataset holds numbers: integers for indices."""
    integers = name.split("/")[-1] in INTEGERS
    if a.dtype.kind not in ("iu" if integers else "iuf"):
        raise NotComparable(f"array {name!r} has the type {a.dtype}: expected "
                            f"{'whole' if integers else 'real'} numbers")


def match(group, theirs, array, name):
    """Return the `MatchedArray` of one array; `theirs` has the other code's arrays of the step.

    Raises `Mismatch` if shapes, nodes or particles do not match, NotComparable if nodes are not
    given.
    """
    a, golden = theirs[name][()], group[name][()]
    if array.location == "nodes":
        return by_node(group, theirs, array, a, golden)
    if array.location in ("body", "parameters", "step"):
        require_shape(a, golden.shape)
        return complete(a)
    body = name.partition("/")[0]
    a = by_particle(theirs, body, a)
    require_particles(a, golden.shape)
    return by_pair(group, theirs, body, a, golden) if array.location == "pairs" else complete(a)


def node_list(array):
    """Return the name of the list of nodes that an array is on."""
    return f"nodes{array.level or ''}"


def complete(a):
    """Return the `MatchedArray` of an array with all its entries."""
    return MatchedArray(a, np.ones(a.shape, bool), np.empty(0))


def require_shape(a, shape):
    """Raise `Mismatch` for another shape."""
    if a.shape != tuple(shape):
        raise Mismatch(f"has shape {a.shape}, expected {tuple(shape)}")


def require_particles(a, shape):
    """Raise `Mismatch` for another shape, with a question if the number of particles differs."""
    try:
        require_shape(a, shape)
    except Mismatch as mismatch:
        if a.shape[:1] == tuple(shape[:1]):
            raise
        raise Mismatch(f"{mismatch}; is it the same scene?") from None


def by_particle(theirs, body, a):
    """Return an array of particles in the golden order, by `id` if there is one."""
    if f"{body}/id" not in theirs:
        return a
    id_ = theirs[f"{body}/id"][()]
    if id_.shape != a.shape[:1] or not np.array_equal(np.sort(id_), np.arange(len(a))):
        raise Mismatch(f"{body}/id does not number its {len(a)} particles from 0 to {len(a) - 1}")
    out = np.empty_like(a)
    out[id_] = a
    return out


def by_node(group, theirs, array, a, golden):
    """Return the `MatchedArray` on the golden nodes; sums are 0 at nodes that are not listed."""
    name, listing = array.name, node_list(array)
    if listing not in theirs:
        raise NotComparable(f"{name} is given without `{listing}`: expected (M, d) integer "
                            "coordinates; a whole grid is written with its `origin`")
    nodes, ours = theirs[listing][()], group[listing][()]
    if nodes.shape[1:] != ours.shape[1:]:
        raise NotComparable(f"{listing} has shape {nodes.shape}: expected (M, {ours.shape[1]}) "
                            "integer coordinates")
    require_shape(a, (len(nodes), *golden.shape[1:]))
    place = {tuple(i): k for k, i in enumerate(nodes.tolist())}
    if len(place) < len(nodes):
        raise Mismatch(f"{len(nodes) - len(place)} of its nodes are listed twice")
    index = np.array([place.get(tuple(i), -1) for i in ours.tolist()])
    value, is_given = a[index], index >= 0
    value[~is_given] = 0
    given = np.broadcast_to(is_given.reshape(-1, *(1,) * (a.ndim - 1)), value.shape)
    if name in SUMS:
        extra = np.delete(a, index[is_given], axis=0)
        return MatchedArray(value, np.ones(value.shape, bool), extra)
    require_nodes(group, ours, is_given)
    return MatchedArray(value, given, np.empty(0))


def require_nodes(group, nodes, is_given):
    """Raise `Mismatch` if a node is not given whose mass is more than its tolerance."""
    m = group["mass"]
    missing = ~is_given & (m[()] > m.attrs["tolerance_f32"] * group["scale/mass"][()])
    if missing.any():
        k = np.argmax(missing * m[()])
        raise Mismatch(f"node {tuple(nodes[k].tolist())}, with mass {m[k]:.3g}, is not given")


def by_pair(group, theirs, body, a, golden):
    """Return the weights on the golden pairs, for any base nodes; 0 outside of a stencil."""
    base = group[f"{body}/base"][()]
    if f"{body}/base" not in theirs:
        return complete(a)
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
    return MatchedArray(value, np.ones(a.shape, bool), a[~inside])
