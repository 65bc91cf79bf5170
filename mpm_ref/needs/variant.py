"""A scene after some removals, the probes that it shares with the scene as given, and the change.

A quantity is compared as it is, with these exceptions: positions are those of the probes that are
left, energies of a symmetric half count twice, and of a section in 2D the vectors have two
components, and energies, impulses and forces are multiplied by the length of the matter.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import msgspec
import numpy as np

from ..scene import SceneError
from ..scene.quantity_records import AXES, quantity_of
from ..sweep.difference import largest_change, relative_difference, running_maximum
from ..sweep.quantity import ENERGIES, OutputQuantity
from .ingredients import named_scene, removals_of, removed
from .plane import plane_removals
from .symmetry import mirror_removals

ALONG_AXES = "side", "axis", "point", "lower", "upper"     # keys of quantities
VECTORS = "centroid", "path", "region", "impulse", "force"
PER_LENGTH = (*ENERGIES, "impulse", "force")               # in a section


@dataclass(frozen=True)
class SceneVariant:
    """A scene, the probes left of it, the share of the matter that it stands for, and the removals
    that led to it.
    """

    scene: object
    probes: tuple               # of (body, X (n, d))
    rows: tuple                 # of (body, indices (n,) of these probes among those at first)
    axes: tuple                 # of the scene at first that are left
    share: float = 1.0
    length: float = 1.0         # along an axis that was removed [m]
    removals: tuple = ()

    @cached_property
    def offers(self):
        """Return {label: `Removal`} of what can be removed from the scene."""
        return {removal.label: removal
                for removal in (*plane_removals(self.scene), *removals_of(self.scene),
                                *mirror_removals(self.scene))}

    def without(self, removal):
        """Return the variant after a `Removal`. Raises SceneError where that is no scene."""
        scene = removed(self.scene, removal)
        masks = [probe_mask(body, X, removal) for body, X in self.probes]
        left = [k for k, mask in enumerate(masks) if mask.any()]
        axes = tuple(range(len(self.axes))) if removal.axes is None else removal.axes
        return replace(
            self, scene=scene, removals=(*self.removals, removal),
            probes=tuple((self.probes[k][0], self.probes[k][1][masks[k]][:, axes]) for k in left),
            rows=tuple((self.rows[k][0], self.rows[k][1][masks[k]]) for k in left),
            axes=tuple(self.axes[a] for a in axes), length=self.length * removal.length,
            share=self.share * (1.0 if removal.plane is None else 0.5))

    def quantity(self, text):
        """Return the text in this scene of a quantity of the scene as given.

        Raises SceneError for one along an axis that was removed.
        """
        record = quantity_of(text)
        keys = {key: in_axes(getattr(record, key), self.axes)
                for key in record.__struct_fields__ if key in ALONG_AXES}
        if None in keys.values():
            raise SceneError(f"quantity {text!r} is along the axis that is removed")
        return msgspec.structs.replace(record, **keys).text


def in_axes(value, axes):
    """Return a key of a quantity, "x+", "x" or a vector, in a scene of these axes alone; None for
    an axis that is none of them.
    """
    if not isinstance(value, str):
        return tuple(value[a] for a in axes)
    axis = AXES.index(value[0])
    return AXES[axes.index(axis)] + value[1:] if axis in axes else None


def first_variant(scene, probes):
    """Return the variant of a scene as given, with names for its parts."""
    rows = tuple((body, np.arange(len(X))) for body, X in probes)
    return SceneVariant(named_scene(scene), tuple(probes), rows, tuple(range(scene.dim)))


def probe_mask(body, X, removal):
    """Return which probes (n,) of a body are left after a removal."""
    if removal.body == body:
        return np.zeros(len(X), dtype=bool)
    if removal.plane is None:
        return np.ones(len(X), dtype=bool)
    axis, c = removal.plane
    return X[:, axis] > c


def changes(base, observation, variant, first):
    """Return {quantity: largest relative change (T,) so far} of a variant's run.

    base: the `RunObservation` of the scene as given; first: its `SceneVariant`.
    """
    result = {}
    for text, reference in base.values.items():
        kind = OutputQuantity(text).kind
        values = observation.values[variant.quantity(text)]
        if kind == "positions":
            reference = reference[:, columns(text, variant, first)]
        elif kind in VECTORS:
            reference = reference[:, variant.axes]
        if kind in ENERGIES:
            values = values / variant.share
        if kind in PER_LENGTH:
            values = values * variant.length
        scale = largest_change(reference)
        if OutputQuantity(text).at_end:
            reference, values = reference[[0, -1]], values[[0, -1]]
        error = relative_difference(values, reference, scale)
        result[text] = running_maximum(error)
    return result


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
