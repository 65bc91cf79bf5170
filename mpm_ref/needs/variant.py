"""A scene after some removals, the probes that it shares with the scene as given, and the change.

A quantity is compared as it is, with these exceptions. Positions are those of the probes that are
left. Energies of a symmetric half count twice, and so do impulses and forces of a part that the
plane cuts in two; their component across the plane, and that of its mean position, is left out.
Of a section in 2D the vectors have two components, and energies, impulses and forces are multiplied
by the length of the matter.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import msgspec
import numpy as np

from ..scene import SceneError
from ..scene.quantity_records import AXES, quantity_of, wall_name
from ..sweep.difference import largest_change, relative_difference, running_maximum
from ..sweep.quantity import ENERGIES, OutputQuantity
from .ingredients import named_scene, removals_of, removed
from .plane import plane_removals
from .symmetry import mirror_removals

EXTENSIVE = (*ENERGIES, "impulse", "force")
VECTORS = "centroid", "path", "region", "impulse", "force"


@dataclass(frozen=True)
class SceneVariant:
    """A scene, the probes and axes left of it, its symmetric halves, and the removals that led to
    it.
    """

    scene: object
    probes: tuple               # of (body, X (n, d))
    rows: tuple                 # of (body, indices (n,) of these probes among those at first)
    axes: tuple                 # of the scene at first that are left
    halves: tuple = ()          # of `Half`, by the axes of the scene at first
    length: float = 1.0         # along an axis that was removed [m]
    removals: tuple = ()

    @cached_property
    def offers(self):
        """Return {label: `Removal`} of what can be removed from the scene."""
        return {removal.label: removal
                for removal in (*plane_removals(self.scene), *removals_of(self.scene),
                                *mirror_removals(self.scene, self.axes))}

    def without(self, removal):
        """Return the variant after a `Removal`. Raises SceneError where that is no scene."""
        scene = removed(self.scene, removal)
        masks = [probe_mask(body, X, removal) for body, X in self.probes]
        left = [k for k, mask in enumerate(masks) if mask.any()]
        axes = removal.axes or tuple(range(len(self.axes)))
        probes = [(body, X[mask][:, axes]) for (body, X), mask in zip(self.probes, masks)]
        rows = [(body, n[mask]) for (body, n), mask in zip(self.rows, masks)]
        return replace(
            self, scene=scene, removals=(*self.removals, removal),
            probes=tuple(probes[k] for k in left), rows=tuple(rows[k] for k in left),
            axes=tuple(self.axes[a] for a in axes), length=self.length * removal.length,
            halves=self.halves + self.halves_of(removal))

    def halves_of(self, removal):
        """Return the `Half` that a removal leaves, by the axes at first, in a tuple."""
        half = removal.half
        return () if half is None else (half._replace(axis=self.axes[half.axis]),)

    def quantity(self, text):
        """Return the text in this scene of a quantity of the scene as given.

        Raises SceneError for one along an axis, or of a half, that was removed.
        """
        record = quantity_of(text)
        for half in self.halves:
            if is_beyond(record, half):
                raise SceneError(f"quantity {text!r} is of the half that is removed")
        keys = {key: IN_AXES[key](getattr(record, key), self.axes)
                for key in record.__struct_fields__ if key in IN_AXES}
        if None in keys.values():
            raise SceneError(f"quantity {text!r} is along the axis that is removed")
        return msgspec.structs.replace(record, **keys).text

    def cuts_of(self, quantity):
        """Return the halves whose plane cuts in two what an `OutputQuantity` sums over: all matter,
        a body or a part. What is elsewhere than on the plane, as a path, is cut by none.
        """
        record = quantity.record
        if quantity.kind not in (*EXTENSIVE, "centroid"):
            return []
        name = getattr(record, "part", getattr(record, "body", None))
        return [half for half in self.halves if name is None or name in half.halved]


def is_beyond(record, half):
    """Return whether a quantity is, all or in part, of the half that was removed."""
    corner = getattr(record, "point", getattr(record, "lower", None))
    if corner is not None:
        return corner[half.axis] < half.c
    along = getattr(record, "side", getattr(record, "axis", None))
    return along in (f"{AXES[half.axis]}-", AXES[half.axis])


def vector_in(vector, axes):
    """Return the components of a vector along axes."""
    return tuple(vector[a] for a in axes)


def axis_in(text, axes):
    """Return the text of an axis, "x" or "x+", in a scene of these axes alone; None for another."""
    axis = AXES.index(text[0])
    return AXES[axes.index(axis)] + text[1:] if axis in axes else None


def part_in(name, axes):
    """Return the name of a part, which is another one for walls, in a scene of these axes alone."""
    walls = {wall_name(axis, side): (axis, side) for axis in range(3) for side in "-+"}
    if name not in walls:
        return name
    axis, side = walls[name]
    return wall_name(axes.index(axis), side) if axis in axes else None


IN_AXES = {"side": axis_in, "axis": axis_in, "point": vector_in, "lower": vector_in,
           "upper": vector_in, "part": part_in}      # by the keys of quantities


def first_variant(scene, probes):
    """Return the variant of a scene as given, with names for its parts."""
    rows = tuple((body, np.arange(len(X))) for body, X in probes)
    return SceneVariant(named_scene(scene), tuple(probes), rows, tuple(range(scene.dim)))


def probe_mask(body, X, removal):
    """Return which probes (n,) of a body are left after a removal."""
    if removal.body == body:
        return np.zeros(len(X), dtype=bool)
    if removal.half is None:
        return np.ones(len(X), dtype=bool)
    return X[:, removal.half.axis] > removal.half.c


def changes(base, observation, variant, first):
    """Return {quantity: largest relative change (T,) so far} of a variant's run.

    base: the `RunObservation` of the scene as given; first: its `SceneVariant`.
    """
    result = {}
    for text, reference in base.values.items():
        reference, values = comparable(text, reference, observation, variant, first)
        scale = largest_change(reference)
        if OutputQuantity(text).at_end:
            reference, values = reference[[0, -1]], values[[0, -1]]
        error = relative_difference(values, reference, scale)
        result[text] = running_maximum(error)
    return result


def comparable(text, reference, observation, variant, first):
    """Return (reference (T, k), values (T, k)) of a quantity that stand for the same matter.

    reference (T, n): values of the scene as given; the others as in `changes`.
    """
    quantity = OutputQuantity(text)
    values, halves = observation.values[variant.quantity(text)], variant.cuts_of(quantity)
    if quantity.kind == "positions":
        reference = reference[:, columns(text, variant, first)]
    elif quantity.kind in VECTORS:
        across = [half.axis for half in halves]
        left = [(k, a) for k, a in enumerate(variant.axes) if a not in across]
        values, reference = values[:, [k for k, _ in left]], reference[:, [a for _, a in left]]
    if quantity.kind in EXTENSIVE:
        values = values * variant.length * 2 ** len(halves)
    return reference, values


def columns(text, variant, first):
    """Return the columns of a quantity "positions[:BODY]" at first that are left in a variant."""
    name = OutputQuantity(text).record.body
    left, result, start = dict(variant.rows), [], 0
    for body, X in first.probes:
        if name not in (None, body):
            continue
        n, d = X.shape
        remaining = left.get(body, np.empty(0, dtype=int))
        result.append(start + (remaining[:, None] * d + np.array(variant.axes)).ravel())
        start += n * d
    return np.concatenate(result).astype(int)
