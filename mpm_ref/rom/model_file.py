"""Files of reduced models: field, latent coordinates, and the record of how it was computed.

The arrays of a file have the names of the records, with dots between them: "net.W",
"tau.coefficients.w". The array "kind" names the field, one of KINDS. Arrays that single precision
holds exactly, as it does trained weights, are stored in it; on loading all numbers are double. See
`store.weights_file` for the bytes.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from ..store.weights_file import header, read, write
from .fields.network import Decoder, DecoderUnits, Field, FieldUnits, Networks, mismatch
from .fields.perceptron import Network, feature_count, layers_of, network
from .fields.pod import PodModes
from .fields.pod_fields import Cells, ModalField, PodFields
from .fields.polynomial_manifold import Curved
from .fields.radial_basis import Radial

FORMAT = "reduced model 1"
KINDS = {"network": Decoder, "network fields": Networks, "pod": PodModes, "pod fields": PodFields,
         "polynomial manifold": Curved}
WHOLE = ("sizes", "octaves", "powers", "order", "start", "middle")  # last names of integer arrays
SHOWN = 12          # values of a list that a sentence shows


class Model(NamedTuple):
    """A reduced model, and the record of how it was computed."""

    field: object           # of one of KINDS
    xhat: np.ndarray        # (s, k + 1, r) latent coordinates of the training snapshots
    rest: np.ndarray        # (r,) of the body at rest, or near those of the start
    about: dict             # settings, seed, command, commit, data, date, versions: plain values


def save(path, model):
    """Write a `Model`, whole or not at all. Raises ValueError for arrays that do not fit, numbers
    that are not finite and an `about` with more than JSON knows, OSError where the system refuses.
    """
    write(path, header(path, FORMAT, model.about) | arrays_of(model), fault_of)


def load(path):
    """Read a file that `save` wrote. Raises ValueError that says what is wrong with the file."""
    arrays, about = read(path, FORMAT, fault_of, "reduced model")
    arrays = {name: a.astype(float) if a.dtype.kind == "f" else a for name, a in arrays.items()}
    return Model(field_of(arrays), arrays["xhat"], arrays["rest"], about)


def is_model(arrays):
    """Return whether the arrays of a file are those of a reduced model."""
    return str(arrays.get("format")) == FORMAT


def arrays_of(model):
    """Return the arrays of a file by name, without format and about."""
    kind = next(name for name, record in KINDS.items() if isinstance(model.field, record))
    numbers = dict(flatten(model.field)) | {"xhat": model.xhat, "rest": model.rest}
    return {"kind": np.array(kind)} | {
        name: np.array(a) if is_whole(name) else compact(np.array(a, dtype=float))
        for name, a in numbers.items()}


def flatten(record, prefix=""):
    """Yield (name, array) of a record of records. Search trees and what is None are left out."""
    for name, part in zip(record._fields, record, strict=True):
        if hasattr(part, "_fields"):
            yield from flatten(part, f"{prefix}{name}.")
        elif part is not None and not isinstance(part, KDTree):
            yield prefix + name, part


def is_whole(name):
    """Return whether an array of a name holds integers."""
    return name.rpartition(".")[2] in WHOLE


def compact(a):
    """Return an array in single precision where that loses nothing."""
    with np.errstate(over="ignore"):
        single = a.astype(np.float32)
    return single if np.array_equal(single, a) else a


# Fields from arrays.

def field_of(arrays):
    """Return the field of the arrays of a file."""
    build = {"network": decoder_of, "network fields": networks_of, "pod": modes_of,
             "pod fields": pod_fields_of, "polynomial manifold": manifold_of}
    return build[str(arrays["kind"])](arrays)


def record(kind, arrays, prefix):
    """Return a record of arrays alone, whose names begin with a prefix."""
    return kind(*(arrays[prefix + name] for name in kind._fields))


def network_of(arrays, prefix):
    """Return a `Network`; raises as `network` does."""
    net = record(Network, arrays, f"{prefix}net.")
    return network(layers_of(net._replace(sizes=net.sizes.astype(int))))


def decoder_of(arrays, prefix=""):
    """Return a `Decoder`."""
    return Decoder(network_of(arrays, prefix), record(DecoderUnits, arrays, f"{prefix}units."))


def networks_of(arrays):
    """Return the `Networks` of the arrays of a file."""
    fields = (Field(network_of(arrays, name), record(FieldUnits, arrays, f"{name}units."),
                    int(arrays[f"{name}octaves"])) for name in ("h.", "l."))
    return Networks(decoder_of(arrays, "g."), *fields)


def modes_of(arrays, prefix=""):
    """Return the `PodModes` of arrays whose names begin with a prefix."""
    X, U, slope = (arrays[prefix + name] for name in ("X", "U", "slope"))
    return PodModes(X, U, slope, KDTree(X))


def manifold_of(arrays):
    """Return the `Curved` map of the arrays of a file."""
    return Curved(modes_of(arrays, "modes."), arrays["powers"], arrays["C"])


def pod_fields_of(arrays):
    """Return the `PodFields` of the arrays of a file."""
    def function(name):
        return record(Radial, arrays, f"{name}.") if f"{name}.w" in arrays else None

    tau, C = (ModalField(arrays[f"{name}.modes"], function(f"{name}.coefficients"))
              if f"{name}.modes" in arrays else None for name in ("tau", "C"))
    return PodFields(arrays["X"], arrays["U"], function("bend"), tau, C, arrays["mu"],
                   record(Cells, arrays, "cells."))


# What is wrong with arrays.

def fault_of(arrays):
    """Return a sentence that says what is wrong with the arrays of a file, or None."""
    kind = str(arrays.get("kind"))
    if kind not in KINDS:
        return f"its kind is {in_short(kind)}, expected one of {', '.join(KINDS)}"
    missing = {*needed(kind, arrays), "xhat", "rest"} - set(arrays)
    if missing:
        return f"it lacks {', '.join(sorted(missing))}"
    check = {"network": fault_of_decoder, "network fields": fault_of_networks,
             "pod": fault_of_modes, "pod fields": fault_of_pod_fields,
             "polynomial manifold": fault_of_manifold}
    return check[kind](arrays)


def needed(kind, arrays):
    """Return the names of the arrays that a field of a kind has, besides some of its own."""
    units = [f"units.{name}" for name in DecoderUnits._fields]
    field_units = [f"units.{name}" for name in FieldUnits._fields]
    net = [f"net.{name}" for name in Network._fields]
    modes = ["X", "U", "slope"]
    if kind == "network":
        return net + units
    if kind == "network fields":
        return ([f"g.{name}" for name in net + units]
                + [f"{f}.{name}" for f in "hl" for name in [*net, *field_units, "octaves"]])
    if kind == "pod":
        return modes
    if kind == "polynomial manifold":
        return [*(f"modes.{name}" for name in modes), "powers", "C"]
    return ["X", "U", "mu", *(f"cells.{name}" for name in Cells._fields), *part_names("tau"),
            *(name for group in (part_names("C"), function_names("bend"))
              if set(group) & set(arrays) for name in group)]


def function_names(name):
    """Return the names of the arrays of a `Radial`."""
    return [f"{name}.{field}" for field in Radial._fields]


def part_names(name):
    """Return the names of the arrays of a `ModalField`."""
    return [f"{name}.modes", *function_names(f"{name}.coefficients")]


def fault_of_decoder(arrays, prefix=""):
    """Return what is wrong with a `Decoder` and its latent coordinates, or None."""
    sizes = arrays[f"{prefix}net.sizes"]
    if fault := fault_of_sizes(sizes, f"{prefix}net.sizes"):
        return fault
    d, r = int(sizes[-1]), int(sizes[0]) - int(sizes[-1])
    if r < 1:
        return (f"layers of {prefix}net.sizes {in_short(sizes.tolist())}: expected d + r, .., d, "
                "with r of 1 or more")
    shapes = net_shapes(sizes, f"{prefix}net.") | {
        f"{prefix}units.{name}": (d,) for name in DecoderUnits._fields}
    return (fault_of_numbers(arrays, shapes | latent_shapes(arrays, r))
            or fault_of_scales(arrays, [f"{prefix}units.{name}" for name in ("span", "std")]))


def fault_of_networks(arrays):
    """Return what is wrong with `Networks`, or None."""
    return (fault_of_decoder(arrays, "g.") or fault_of_field(arrays, "h.")
            or fault_of_field(arrays, "l.") or mismatch(*networks_of(arrays)))


def fault_of_field(arrays, prefix):
    """Return what is wrong with a `Field`, or None."""
    sizes, octaves = arrays[f"{prefix}net.sizes"], arrays[f"{prefix}octaves"]
    if fault := fault_of_sizes(sizes, f"{prefix}net.sizes"):
        return fault
    if octaves.shape != () or octaves.dtype.kind not in "iu" or octaves < 0:
        return f"{prefix}octaves is {octaves}: expected a whole number of 0 or more"
    low, mu_mean = arrays[f"{prefix}units.low"], arrays[f"{prefix}units.mu_mean"]
    if low.ndim != 1 or mu_mean.ndim != 1:
        return f"{prefix}units.low or mu_mean has not one axis"
    d, q, k = len(low), len(mu_mean), int(sizes[-1])
    inputs = feature_count(d, int(octaves)) + q
    if sizes[0] <= inputs:
        return (f"the first layer of {prefix}net reads {sizes[0]} numbers, of which places and "
                f"parameters are {inputs}: expected latent coordinates too")
    lengths = {"low": d, "span": d, "mean": k, "std": k, "mu_mean": q, "mu_std": q}
    shapes = {f"{prefix}units.{name}": (n,) for name, n in lengths.items()}
    return (fault_of_numbers(arrays, net_shapes(sizes, f"{prefix}net.") | shapes)
            or fault_of_scales(arrays, [f"{prefix}units.{name}"
                                        for name in ("span", "std", "mu_std")]))


def fault_of_modes(arrays, prefix="", r=None):
    """Return what is wrong with `PodModes` and the r latent coordinates, those of all modes if
    None; or None.
    """
    if fault := fault_of_axes(arrays, {f"{prefix}U": 3, "xhat": 3}):
        return fault
    n, d, R = arrays[f"{prefix}U"].shape
    shapes = {f"{prefix}X": (n, d), f"{prefix}U": (n, d, R), f"{prefix}slope": (n, d, d, R)}
    return fault_of_numbers(arrays, shapes | latent_shapes(arrays, R if r is None else r))


def fault_of_manifold(arrays):
    """Return what is wrong with a `Curved` map, or None."""
    if fault := fault_of_axes(arrays, {"modes.U": 3, "xhat": 3, "powers": 2}):
        return fault
    R, r = arrays["modes.U"].shape[2], arrays["xhat"].shape[2]
    monomials = len(arrays["powers"])
    return (fault_of_numbers(arrays, {"powers": (monomials, r), "C": (R - r, monomials)})
            or fault_of_modes(arrays, "modes.", r))


def fault_of_pod_fields(arrays):
    """Return what is wrong with `PodFields`, or None."""
    axes = {"U": 3, "xhat": 3, "mu": 1, "cells.middle": 1, "tau.modes": 3, "C.modes": 3,
            "tau.coefficients.centers": 2, "C.coefficients.centers": 2, "bend.centers": 2}
    if fault := fault_of_axes(arrays, {name: axes[name] for name in axes if name in arrays}):
        return fault
    (n, d, R), r, q = arrays["U"].shape, arrays["xhat"].shape[2], len(arrays["mu"])
    if ("bend.w" in arrays) != (R > r):
        return "modes beyond the latent coordinates and their coefficients do not go together"
    blocks = arrays["cells.middle"].size
    shapes = latent_shapes(arrays, r) | {
        "X": (n, d), "U": (n, d, R), "mu": (q,), "cells.order": (n,), "cells.start": (blocks + 1,),
        "cells.middle": (blocks,), "cells.rest": (blocks,), "cells.spread": (blocks, R)}
    for name, k, inputs in (("tau", d * (d + 1) // 2, r + q), ("C", d * d, r)):
        if f"{name}.modes" in arrays:
            modes = arrays[f"{name}.modes"].shape[2]
            shapes[f"{name}.modes"] = (n, k, modes)
            shapes |= function_shapes(arrays, f"{name}.coefficients", inputs, modes)
    if "bend.w" in arrays:
        shapes |= function_shapes(arrays, "bend", r, R - r)
    return fault_of_numbers(arrays, shapes) or fault_of_cells(record(Cells, arrays, "cells."))


def fault_of_cells(cells):
    """Return what is wrong with the blocks of points, or None."""
    n = len(cells.order)
    ends = cells.start[0] == 0 and cells.start[-1] == n and (np.diff(cells.start) > 0).all()
    if not (ends and np.array_equal(np.sort(cells.order), np.arange(n))):
        return "its blocks do not hold each point once"
    if not ((cells.middle >= 0) & (cells.middle < n)).all():
        return "the middle of a block is no point"
    return None


def fault_of_axes(arrays, axes):
    """Return what is wrong with numbers of axes {name: number}, or None."""
    for name, number in sorted(axes.items()):
        if arrays[name].ndim != number:
            return f"{name} has {arrays[name].ndim} axes, expected {number}"
    return None


def fault_of_sizes(sizes, name):
    """Return what is wrong with the widths of layers, or None."""
    if sizes.ndim != 1 or sizes.dtype.kind not in "iu" or len(sizes) < 2 or sizes.min() < 1:
        return (f"{name} is an array of shape {sizes.shape} and type {sizes.dtype}, "
                f"{in_short(sizes.tolist())}: expected whole numbers of 1 or more, into each layer "
                "and out of the last")
    return None


def fault_of_scales(arrays, names):
    """Return which of the scales is not positive, or None."""
    for name in names:
        if not (arrays[name] > 0.0).all():
            return f"{name} has numbers that are not positive"
    return None


def fault_of_numbers(arrays, shapes):
    """Return what is wrong with shapes, types and values of arrays, or None. A unit of coordinates
    that do not vary may be infinite.
    """
    for name, shape in shapes.items():
        a = arrays[name]
        if a.shape != shape:
            return f"{name} has shape {a.shape}, expected {shape}"
        if a.dtype.kind not in ("iu" if is_whole(name) else "f"):
            expected = "integers" if is_whole(name) else "floating-point numbers"
            return f"{name} is of type {a.dtype}, expected {expected}"
        if name.endswith(".unit"):
            if not (a > 0.0).all():
                return f"{name} has numbers that are not positive"
            if arrays[name.replace("unit", "centers")][:, np.isinf(a)].any():
                return f"{name} is infinite of coordinates that vary"
        elif not np.isfinite(a).all():
            return f"{name} has numbers that are not finite"
    return None


def net_shapes(sizes, prefix):
    """Return {name: shape} of the weights of a `Network` with these widths of layers."""
    sizes = sizes.tolist()
    return {f"{prefix}W": (sum(n * m for n, m in pairwise(sizes)),),
            f"{prefix}b": (sum(sizes[1:]),)}


def latent_shapes(arrays, r):
    """Return {name: shape} of the latent coordinates of snapshots and at rest."""
    shape = arrays["xhat"].shape
    levels = shape[:2] if len(shape) == 3 else ("runs", "levels")
    return {"xhat": (*levels, r), "rest": (r,)}


def function_shapes(arrays, name, inputs, outputs):
    """Return {name: shape} of the arrays of a `Radial` with these numbers of inputs and outputs."""
    centers = arrays[f"{name}.centers"].shape[0]
    return {f"{name}.centers": (centers, inputs), f"{name}.unit": (inputs,),
            f"{name}.w": (centers, outputs), f"{name}.tail": (1 + inputs, outputs)}


def in_short(values):
    """Return a list as text; of a long one, its first values and how many there are."""
    if not isinstance(values, list) or len(values) <= SHOWN:
        return str(values)
    return f"{str(values[:SHOWN])[:-1]}, .. {len(values)} in all]"
