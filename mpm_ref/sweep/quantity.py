"""Quantities of interest of a run, by a text such as "positions" or "front:x+@end".

    positions[:BODY]        all probes' positions                                        [m]
    centroid[:BODY]         mean position of the mass                                    [m]
    path:X,Y[,Z]            position of the material point that starts nearest to (X, Y) [m]
    region:X0,Y0,X1,Y1      mean position of the probes that start in a box              [m]
    front:AXIS+ | AXIS-     farthest material along an axis, such as front:x+            [m]
    profile:AXIS            quantiles of the mass along an axis: a distribution          [m]
    kinetic, elastic, gravity, energy       energies                                     [J]
    impulse:NAME            impulse of a collider, region or wall on the matter        [N s]
    force:NAME              its mean force between two times of observation, 0 at first  [N]
    mean:FIELD:X0,Y0,X1,Y1  mean of J, speed or pressure over the matter in a box

The suffix "@end" compares the last state alone, not the whole run. A difference is relative to the
largest change of the quantity during the reference run. `scene.quantity_records` reads the texts.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..energy import energy
from ..monitor import volume_ratio
from ..scene.quantity_records import AXES, QuantityOfInterest, check_quantity, quantity_of

QUANTILES = np.linspace(0.02, 0.98, 33)
ENERGIES = ("kinetic", "elastic", "gravity", "energy")
DEFAULT = ("positions",)
CHAOTIC = ("kinetic", "elastic")        # see `with_companions`
BESIDE = 0.1        # of the largest extent of all bodies: a path may start so far beside their box


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
    record: QuantityOfInterest = field(init=False)

    def __post_init__(self):
        object.__setattr__(self, "record", quantity_of(self.text))

    @property
    def kind(self):
        """Return the name of what is measured, the first word of the text."""
        return self.record.__struct_config__.tag

    @property
    def at_end(self):
        """Return whether the last state alone is compared."""
        return self.record.at_end

    def sample(self, snapshot):
        """Return the value (k,) in a `Snapshot` of a scene that it fits (see `check_quantities`).

        Raises ValueError where a region holds no material, or a path starts outside of it.
        """
        try:
            return np.atleast_1d(SAMPLES[self.kind](snapshot, self.record)).ravel()
        except ValueError as fault:
            raise ValueError(f"quantity {self.text!r}: {fault}") from None

    def series(self, samples, times):
        """Return the values (T, k) at times (T,) [s] from the samples (T, k) there.

        Those of a force are means since the time before, from samples of the impulse; 0 at first.
        """
        if self.kind != "force":
            return samples
        force = np.zeros_like(samples)
        force[1:] = np.diff(samples, axis=0) / np.diff(times)[:, None]
        return force


def check_quantities(texts, scene):
    """Raise ValueError, in one sentence, for the text of a quantity that does not fit a scene."""
    for text in texts:
        record = OutputQuantity(text).record
        try:
            check_quantity(record, scene)
        except ValueError as fault:
            raise ValueError(f"quantity {text!r}: {fault}") from None


def with_companions(texts, dim):
    """Return texts of quantities and of those that keep a meaning where paths diverge, each once:
    energies, and the profile along each axis.
    """
    profiles = [f"profile:{axis}" for axis in AXES[:dim]]
    return tuple(dict.fromkeys((*texts, *CHAOTIC, *profiles)))


def named_bodies(snapshot, name):
    """Return the bodies of a name, all for None."""
    return [body for body in snapshot.bodies if name in (None, body.name)]


def positions(snapshot, record):
    """Return the positions of all probes, (n d,)."""
    bodies = named_bodies(snapshot, record.body)
    return np.concatenate([snapshot.probes[body.name] for body in bodies])


def centroid(snapshot, record):
    """Return the centre of mass (d,)."""
    bodies = named_bodies(snapshot, record.body)
    mass = sum(b.particles.m.sum() for b in bodies)
    return sum(b.particles.m @ b.particles.x for b in bodies) / mass


def path(snapshot, record):
    """Return the position (d,) of the probe that starts nearest to a point."""
    starts = np.concatenate(list(snapshot.starts.values()))
    low, high = starts.min(axis=0), starts.max(axis=0)
    spare = BESIDE * (high - low).max()
    if np.any((record.point < low - spare) | (record.point > high + spare)):
        raise ValueError("the point lies outside of the box of all bodies at the start, from "
                         f"{point_text(low)} to {point_text(high)}; expected a point of a body")
    nearest = np.argmin(np.sum((starts - record.point) ** 2, axis=1))
    return np.concatenate(list(snapshot.probes.values()))[nearest]


def point_text(x):
    """Return a point (d,) as text [m]."""
    return f"({', '.join(f'{one:.4g}' for one in x)})"


def region(snapshot, record):
    """Return the mean position (d,) of the probes that start in a box."""
    starts = np.concatenate(list(snapshot.starts.values()))
    inside = is_inside(starts, record)
    if not inside.any():
        raise ValueError("no probe starts in this box; expected a box that "
                         "holds material")
    return np.concatenate(list(snapshot.probes.values()))[inside].mean(axis=0)


def front(snapshot, record):
    """Return the farthest material along an axis: the outermost particle and half its width."""
    axis, sign = AXES.index(record.side[0]), 1.0 if record.side[1] == "+" else -1.0
    d = snapshot.problem.dim
    return sign * max(np.max(sign * b.particles.x[:, axis] + 0.5 * b.particles.V0 ** (1.0 / d))
                      for b in named_bodies(snapshot, record.body))


def profile(snapshot, record):
    """Return quantiles (33,) of the mass along an axis, each particle as wide as it is at rest."""
    a, bodies = AXES.index(record.axis), named_bodies(snapshot, record.body)
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
    def sample(snapshot, record):
        problem = snapshot.problem
        now = energy(snapshot.bodies, problem.gravity, problem.inertia)
        return now.sum if name == "energy" else getattr(now, name)
    return sample


def impulse(snapshot, record):
    """Return the impulse (d,) of a part of the conditions on the matter since the start."""
    return snapshot.impulses[record.part]


def mean(snapshot, record):
    """Return the mean of a field over the mass in a box; NaN where the box is empty."""
    top = bottom = 0.0
    for body in snapshot.bodies:
        q = body.particles
        m = q.m * is_inside(q.x, record)
        top, bottom = top + m @ particle_field(q, record.field), bottom + m.sum()
    return top / bottom if bottom else np.nan


def is_inside(x, box):
    """Return the mask (N,) of points x (N, d) in a box with corners `lower` and `upper`."""
    return ((np.array(box.lower) <= x) & (x <= np.array(box.upper))).all(axis=1)


def particle_field(particles, name):
    """Return the values (N,) of a field: J, speed [m/s], or pressure -tr(tau)/(d J) [Pa]."""
    if name == "J":
        return volume_ratio(particles)
    if name == "speed":
        return np.sqrt(np.einsum("pa,pa->p", particles.v, particles.v))
    tau = particles.tau
    trace = tau if tau.ndim == 1 else np.trace(tau, axis1=1, axis2=2) / tau.shape[1]
    return -trace / volume_ratio(particles)


SAMPLES = {
    "positions": positions, "centroid": centroid, "path": path, "region": region, "front": front,
    "profile": profile, **{name: energy_of(name) for name in ENERGIES}, "impulse": impulse,
    "force": impulse, "mean": mean,
}
