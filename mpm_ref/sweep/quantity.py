"""Quantities of interest of a run, by a text such as "positions" or "front:x+@end".

    positions[:BODY]        all probes' positions                                        [m]
    centroid[:BODY]         mean position of the mass                                    [m]
    path:X,Y[,Z]            position of the material point that starts nearest to (X, Y) [m]
    region:X0,Y0,X1,Y1      mean position of the probes that start in a box              [m]
    front:AXIS+ | AXIS-     farthest material along an axis, such as front:x+            [m]
    profile:AXIS            quantiles of the mass along an axis: a distribution          [m]
    kinetic, elastic, gravity, energy       energies                                     [J]
    impulse:NAME            impulse of a collider, region or "walls" on the matter     [N s]
    mean:FIELD:X0,Y0,X1,Y1  mean of J, speed or pressure over the matter in a box

The suffix "@end" compares the last state alone, not the whole run. A difference is relative to the
largest change of the quantity during the reference run.
"""

import difflib
import re
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..energy import energy
from ..monitor import volume_ratio

AXES = "xyz"
QUANTILES = np.linspace(0.02, 0.98, 33)
ENERGIES = ("kinetic", "elastic", "gravity", "energy")
FIELDS = ("J", "speed", "pressure")
DEFAULT = ("positions",)
CHAOTIC = ("kinetic", "elastic")        # see `with_companions`
EXPECTED = ("expected positions, centroid, path:X,Y, region:X0,Y0,X1,Y1, front:x+, profile:x, "
            "kinetic, elastic, gravity, energy, impulse:NAME or mean:J:X0,Y0,X1,Y1, with @end for "
            "the last state alone")


class Snapshot(NamedTuple):
    """A state of a run as quantities read it."""

    problem: object
    bodies: tuple
    probes: dict            # body's name: (n, d) positions of its probes [m]
    starts: dict            # body's name: (n, d) their positions at the start [m]
    impulses: dict          # part's name: (d,) impulse since the start [N s]


@dataclass(frozen=True)
class OutputQuantity:
    """A quantity by its text; `sample` returns its value in a `Snapshot` as a vector.

    Raises ValueError, in one sentence, for a text that names no quantity.
    """

    text: str
    kind: str = field(init=False, default="")
    arguments: tuple = field(init=False, default=())
    at_end: bool = field(init=False, default=False)

    def __post_init__(self):
        name, at, when = self.text.partition("@")
        kind, *arguments = name.strip().split(":")
        if kind not in SAMPLES or (at and when.strip() != "end"):
            near = difflib.get_close_matches(kind, SAMPLES, 1)
            hint = f"did you mean {near[0]}? " if near else ""
            raise ValueError(f"quantity {self.text!r}: {hint}{EXPECTED}")
        object.__setattr__(self, "kind", kind)
        object.__setattr__(self, "arguments", tuple(argument.strip() for argument in arguments))
        object.__setattr__(self, "at_end", bool(at))

    def sample(self, snapshot):
        """Return the value (k,) in a `Snapshot`. Raises ValueError for arguments that do not fit
        the scene.
        """
        try:
            return np.atleast_1d(SAMPLES[self.kind](snapshot, *self.arguments)).ravel()
        except TypeError:
            raise ValueError(f"quantity {self.text!r}: {EXPECTED}") from None
        except ValueError as fault:
            raise ValueError(f"quantity {self.text!r}: {fault}") from None


def with_companions(texts, dim):
    """Return texts of quantities and of those that keep a meaning where paths diverge, each once:
    energies, and the profile along each axis.
    """
    profiles = [f"profile:{axis}" for axis in AXES[:dim]]
    return tuple(dict.fromkeys((*texts, *CHAOTIC, *profiles)))


def named_bodies(snapshot, name):
    """Return the bodies of a name, all for "". Raises ValueError for an unknown name."""
    chosen = [body for body in snapshot.bodies if name in ("", body.name)]
    if not chosen:
        names = ", ".join(body.name for body in snapshot.bodies)
        raise ValueError(f"body {name!r}: expected one of {names}")
    return chosen


def positions(snapshot, body=""):
    """Return the positions of all probes, (n d,)."""
    return np.concatenate([snapshot.probes[b.name] for b in named_bodies(snapshot, body)])


def centroid(snapshot, body=""):
    """Return the centre of mass (d,)."""
    bodies = named_bodies(snapshot, body)
    mass = sum(b.particles.m.sum() for b in bodies)
    return sum(b.particles.m @ b.particles.x for b in bodies) / mass


def path(snapshot, point):
    """Return the position (d,) of the probe that starts nearest to a point."""
    X = numbers(point, snapshot.problem.dim)
    starts = np.concatenate(list(snapshot.starts.values()))
    nearest = np.argmin(np.sum((starts - X) ** 2, axis=1))
    return np.concatenate(list(snapshot.probes.values()))[nearest]


def region(snapshot, box):
    """Return the mean position (d,) of the probes that start in a box."""
    low, high = corners(box, snapshot.problem.dim)
    starts = np.concatenate(list(snapshot.starts.values()))
    inside = ((low <= starts) & (starts <= high)).all(axis=1)
    if not inside.any():
        raise ValueError("no probe starts in this box; expected a box that "
                         "holds material")
    return np.concatenate(list(snapshot.probes.values()))[inside].mean(axis=0)


def front(snapshot, side, body=""):
    """Return the farthest material along an axis: the outermost particle and half its width."""
    axis, sign = axis_of(side[:-1], snapshot), {"+": 1.0, "-": -1.0}.get(side[-1:])
    if sign is None:
        raise ValueError("expected an axis with its side, such as x+")
    d = snapshot.problem.dim
    return sign * max(np.max(sign * b.particles.x[:, axis] + 0.5 * b.particles.V0 ** (1.0 / d))
                      for b in named_bodies(snapshot, body))


def profile(snapshot, axis, body=""):
    """Return quantiles (33,) of the mass along an axis, each particle as wide as it is at rest."""
    a, bodies = axis_of(axis, snapshot), named_bodies(snapshot, body)
    x = np.concatenate([b.particles.x[:, a] for b in bodies])
    m = np.concatenate([b.particles.m for b in bodies])
    width = np.concatenate([b.particles.V0 for b in bodies]) ** (1.0 / snapshot.problem.dim)
    edge = np.concatenate((x - 0.5 * width, x + 0.5 * width))
    slope = np.concatenate((m / width, -m / width))
    order = np.argsort(edge, kind="stable")
    edge, density = edge[order], np.cumsum(slope[order])
    share = np.concatenate(([0.0], np.cumsum(density[:-1] * np.diff(edge)))) / m.sum()
    return np.interp(QUANTILES, share, edge)


def energy_of(name):
    """Return the sampling function of an energy by its name."""
    def sample(snapshot):
        problem = snapshot.problem
        now = energy(snapshot.bodies, problem.gravity, problem.inertia)
        return now.sum if name == "energy" else getattr(now, name)
    return sample


def impulse(snapshot, name):
    """Return the impulse (d,) of a part of the conditions on the matter since the start."""
    if name not in snapshot.impulses:
        names = ", ".join(snapshot.impulses) or "none; the scene has no collider, region or wall"
        raise ValueError(f"expected one of {names}")
    return snapshot.impulses[name]


def mean(snapshot, name, box):
    """Return the mean of a field over the mass in a box; NaN where the box is empty."""
    if name not in FIELDS:
        raise ValueError(f"expected one of {', '.join(FIELDS)}")
    low, high = corners(box, snapshot.problem.dim)
    top = bottom = 0.0
    for body in snapshot.bodies:
        q = body.particles
        m = q.m * ((low <= q.x) & (q.x <= high)).all(axis=1)
        top, bottom = top + m @ particle_field(q, name), bottom + m.sum()
    return top / bottom if bottom else np.nan


def particle_field(particles, name):
    """Return the values (N,) of a field: J, speed [m/s], or pressure -tr(tau)/(d J) [Pa]."""
    if name == "J":
        return volume_ratio(particles)
    if name == "speed":
        return np.sqrt(np.einsum("pa,pa->p", particles.v, particles.v))
    tau = particles.tau
    trace = tau if tau.ndim == 1 else np.trace(tau, axis1=1, axis2=2) / tau.shape[1]
    return -trace / volume_ratio(particles)


def axis_of(name, snapshot):
    """Return the index of an axis by its letter. Raises ValueError."""
    known = AXES[:snapshot.problem.dim]
    if name not in known or len(name) != 1:
        raise ValueError(f"axis {name!r}: expected one of {', '.join(known)}")
    return known.index(name)


def corners(text, dim):
    """Return the two corners of a box (d,). Raises ValueError."""
    values = numbers(text, 2 * dim)
    return values[:dim], values[dim:]


def numbers(text, n):
    """Return n numbers separated by commas as an array. Raises ValueError."""
    parts = re.split(r"\s*,\s*", text)
    try:
        values = np.array([float(part) for part in parts])
    except ValueError:
        values = np.empty(0)
    if len(values) != n or not np.isfinite(values).all():
        raise ValueError(f"{text!r}: expected {n} numbers with commas between them")
    return values


SAMPLES = {
    "positions": positions, "centroid": centroid, "path": path, "region": region, "front": front,
    "profile": profile, **{name: energy_of(name) for name in ENERGIES}, "impulse": impulse,
    "mean": mean,
}
