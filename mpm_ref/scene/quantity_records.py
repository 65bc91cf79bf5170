"""Records of the `[[quantity]]` tables of a scene file, and the texts that stand for them.

A quantity of interest is what `mpm-ref trade`, `limits` and `needs` measure; `sweep.quantity`
samples it. No run depends on it. The table with type = "front", side = "x+", body = "disk" and
at_end = true is the text "front:x+:disk@end" of the command line.
"""

from difflib import get_close_matches
from math import isfinite
from typing import Annotated, ClassVar, Literal, get_args

import msgspec
from msgspec import Meta

from ..shapes.quantities import Kind, Vector

AXES = "xyz"
EXPECTED = ("expected positions, centroid, path:X,Y, region:X0,Y0,X1,Y1, front:x+, profile:x, "
            "kinetic, elastic, gravity, energy, impulse:NAME, force:NAME or mean:J:X0,Y0,X1,Y1, "
            "with @end for the last state alone")
PartName = Annotated[str, Meta(min_length=1)]


class QuantityOfInterest(Kind, kw_only=True):
    """A quantity of interest of a run.

    `keys` names its keys in the order of the text; the numbers of keys in one group stand together.
    `usage` is what is expected of a text.
    """

    keys: ClassVar[tuple] = ()
    usage: ClassVar[str] = "this word alone"

    at_end: bool = False                        # the last state alone, not the whole run

    @property
    def text(self):
        """Return the text that stands for the quantity on the command line."""
        words = [group_text([getattr(self, key) for key in group]) for group in self.keys]
        kind = self.__struct_config__.tag
        return ":".join([kind, *filter(None, words)]) + ("@end" if self.at_end else "")


class BoxQuantity(QuantityOfInterest):
    """A quantity of the matter in a box with two given corners [m]."""

    lower: Vector
    upper: Vector

    def __post_init__(self):
        if any(a > b for a, b in zip(self.lower, self.upper)):
            raise ValueError(f"lower = {list(self.lower)}: expected at most `upper` = "
                             f"{list(self.upper)} on every axis")


class PositionsQuantity(QuantityOfInterest, tag="positions"):
    """The positions of the probes of a body, or of all bodies [m]."""

    keys = (("body",),)
    usage = "positions or positions:BODY"
    body: str | None = None


class CentroidQuantity(QuantityOfInterest, tag="centroid"):
    """The mean position of the mass of a body, or of all bodies [m]."""

    keys = (("body",),)
    usage = "centroid or centroid:BODY"
    body: str | None = None


class PathQuantity(QuantityOfInterest, tag="path"):
    """The position of the probe that starts nearest to a point [m]."""

    keys = (("point",),)
    usage = "path:X,Y or path:X,Y,Z, 2 numbers or 3"
    point: Vector


class RegionQuantity(BoxQuantity, tag="region"):
    """The mean position of the probes that start in a box [m]."""

    keys = (("lower", "upper"),)
    usage = "region:X0,Y0,X1,Y1, the lower and the upper corner of a box"


class FrontQuantity(QuantityOfInterest, tag="front"):
    """The farthest material along an axis, of a body or of all [m]."""

    keys = (("side",), ("body",))
    usage = "front:x+ or front:x+:BODY, an axis with its side"
    side: Literal["x-", "x+", "y-", "y+", "z-", "z+"]
    body: str | None = None


class ProfileQuantity(QuantityOfInterest, tag="profile"):
    """Quantiles of the mass along an axis, of a body or of all [m]."""

    keys = (("axis",), ("body",))
    usage = "profile:x or profile:x:BODY"
    axis: Literal["x", "y", "z"]
    body: str | None = None


class KineticQuantity(QuantityOfInterest, tag="kinetic"):
    """The kinetic energy [J]."""


class ElasticQuantity(QuantityOfInterest, tag="elastic"):
    """The elastic energy [J]."""


class GravityQuantity(QuantityOfInterest, tag="gravity"):
    """The potential energy of gravity [J]."""


class EnergyQuantity(QuantityOfInterest, tag="energy"):
    """The total energy [J]."""


class ImpulseQuantity(QuantityOfInterest, tag="impulse"):
    """The impulse of a part of the boundary conditions on the matter since the start [N s]."""

    keys = (("part",),)
    usage = "impulse:NAME, the name of a part"
    part: PartName


class ForceQuantity(QuantityOfInterest, tag="force"):
    """The mean force of a part on the matter between two times of observation [N]."""

    keys = (("part",),)
    usage = "force:NAME, the name of a part"
    part: PartName


class MeanQuantity(BoxQuantity, tag="mean"):
    """The mean of J, speed [m/s] or pressure [Pa] over the matter in a box."""

    keys = (("field",), ("lower", "upper"))
    usage = "mean:J:X0,Y0,X1,Y1, one of J, speed and pressure in a box"
    field: Literal["J", "speed", "pressure"]


Quantities = (
    PositionsQuantity | CentroidQuantity | PathQuantity | RegionQuantity | FrontQuantity
    | ProfileQuantity | KineticQuantity | ElasticQuantity | GravityQuantity | EnergyQuantity
    | ImpulseQuantity | ForceQuantity | MeanQuantity)
KINDS = {kind.__struct_config__.tag: kind for kind in get_args(Quantities)}


# texts

def group_text(values):
    """Return the text of the values of a group of keys: numbers with commas, or a name."""
    if isinstance(values[0], tuple):
        return ",".join(number_text(number) for vector in values for number in vector)
    return values[0]


def number_text(number):
    """Return the shortest usual text of a number that reads back as it."""
    return short if float(short := f"{number:g}") == number else repr(number)


def quantity_of(text):
    """Return the record that a text such as "front:x+@end" stands for.

    Raises ValueError, in one sentence, for a text that names no quantity.
    """
    words, at, when = text.partition("@")
    tag, _, rest = words.partition(":")
    kind = KINDS.get(tag.strip())
    if kind is None or (at and when.strip() != "end"):
        near = get_close_matches(tag.strip(), KINDS, 1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise ValueError(f"quantity {text!r}: {hint}{EXPECTED}")
    tables = {"type": tag.strip(), "at_end": bool(at)}
    try:
        return msgspec.convert(tables | arguments(kind, rest.strip()), kind)
    except (ValueError, msgspec.ValidationError):
        raise ValueError(f"quantity {text!r}: expected {kind.usage}") from None


def arguments(kind, text):
    """Return {key: value} of a kind of quantity from the text after its name.

    Raises ValueError for words that it has no key for, and for what is no number.
    """
    if text and not kind.keys:
        raise ValueError(f"{text!r}: expected nothing")
    values = {}
    for group, word in zip(kind.keys, text.split(":", max(len(kind.keys) - 1, 0))):
        if word.strip():
            values |= group_values(group, word.strip())
    return values


def group_values(group, word):
    """Return {key: value} of a group of keys from its word. Raises ValueError."""
    if group[0] not in ("point", "lower"):
        return {group[0]: word}
    numbers = [float(part) for part in word.split(",")]
    if len(numbers) % len(group) or not all(map(isfinite, numbers)):
        raise ValueError(f"{word!r}: expected finite numbers, as many for each of {group}")
    n = len(numbers) // len(group)
    return {key: numbers[k * n:(k + 1) * n] for k, key in enumerate(group)}


# the scene that a quantity belongs to

def part_names(scene):
    """Return the names of a scene's parts in the order of their impulses; "collider0" and the like
    where the scene gives none.
    """
    colliders = [part.name or f"collider{k}" for k, part in enumerate(scene.collider)]
    fixed = [part.name or f"fixed{k}" for k, part in enumerate(scene.fixed)]
    sides = [wall_name(axis, side) for axis in range(scene.dim) for side in "-+"]
    return [*colliders, *fixed, *(sides if scene.walls is not None else [])]


def wall_name(axis, side):
    """Return the name of the wall at an end, side "-" or "+", of an axis 0, 1 or 2."""
    return f"wall {AXES[axis]}{side}"


def check_quantity(quantity, scene):
    """Raise ValueError, which begins with the key, for a quantity that does not fit a scene: an
    unknown body or part, an axis or a corner of another dimension, an impulse of implicit steps.
    """
    check_name(quantity, "body", [body.name for body in scene.body])
    if hasattr(quantity, "part") and scene.integrator != "explicit":
        raise ValueError(f"part = {quantity.part!r}: implicit steps state no impulses of parts; "
                         'expected the integrator "explicit", or another quantity')
    check_name(quantity, "part", part_names(scene))
    for key in ("side", "axis"):
        value = getattr(quantity, key, "x")
        if value[0] not in AXES[:scene.dim]:
            raise ValueError(f"{key} = {value!r}: expected one of the axes "
                             f"{', '.join(AXES[:scene.dim])} (dim = {scene.dim})")
    for key in ("point", "lower", "upper"):
        value = getattr(quantity, key, None)
        if value is not None and len(value) != scene.dim:
            raise ValueError(f"{key} = {list(value)}: expected {scene.dim} numbers "
                             f"(dim = {scene.dim})")


def check_name(quantity, key, names):
    """Raise ValueError for a key of a quantity that is a name and not one of some names."""
    name = getattr(quantity, key, None)
    if name is None:
        return
    if "@" in name or name != name.strip():
        raise ValueError(f"{key} = {name!r}: expected a name without @, and without spaces at its "
                         "ends, which no text of a quantity can hold; rename it")
    if name in names:
        return
    near = get_close_matches(name, names, 1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    expected = f"expected one of {', '.join(names)}" if names else (
        "expected a quantity without it: the scene has no collider, fixed region or wall")
    raise ValueError(f"{key} = {name!r}: {hint}{expected}")
