"""Particles that enter and leave a run: sources, which repeat a block of particles, and sinks.

    t_k = start + k period,   period = length/|v|

Block k of a source enters at the first state with t >= t_k, moved by v (t - t_k): a stream without
gaps, since the block before has moved by its length. Adaptive steps end at t_k, as at frames. All
blocks have the same sample, at rest but for v. Which blocks enter after a step is a function of the
times before and after it alone, so that a resumed run has the same bits.

A source may sway: block k is displaced by s_i = A_i sin(2 pi f_i t_k) along each axis i, as it
enters and, with its constant velocity v, afterwards. The sway adds nothing to v. So a stream is a
staircase of blocks, each shifted sideways from the one before by the difference of their s: it
carries as much a second as one that stands still, and along v has no gaps unless s has a part
along v, which parts blocks or lets them overlap. What is held (`hold` of a scene) is the place of
the block that entered last.

All particles of a source belong to one body. Its number of particles in a whole run is known before
the run: block k has the numbers from k n to (k + 1) n - 1 of `Body.id`, n particles a block.
"""

from dataclasses import dataclass
from math import ceil, floor, inf, pi, sin

import numpy as np

from .body import Body, append, change_rows, select_rows
from .core.levelset import distances
from .energy import energy
from .explicit import initial_stress
from .monitor import noise_of

EVEN = 1e-9                     # of a period: so near to its time a block is due
MOST = 50_000_000               # particles of a source in a run


@dataclass(frozen=True)
class SourceSway:
    """The displacement of a source that sways: amplitude sin(2 pi frequency t) along each axis.

    Raises ValueError for other than finite amplitudes, with a finite frequency >= 0 for each.
    """

    amplitude: tuple        # d numbers [m]
    frequency: tuple        # d numbers [1/s]

    def __post_init__(self):
        a, f = np.asarray(self.amplitude, float), np.asarray(self.frequency, float)
        if a.shape != f.shape or not (np.isfinite(a).all() and ((f >= 0.0) & (f < inf)).all()):
            raise ValueError(f"a sway of amplitude {self.amplitude} and frequency "
                             f"{self.frequency}: expected finite numbers, and for each amplitude a "
                             "frequency >= 0")

    def value(self, t):
        """Return the displacement (d,) [m] at time t [s] of the run."""
        return np.array([a * sin(2.0 * pi * f * t)
                         for a, f in zip(self.amplitude, self.frequency, strict=True)])


@dataclass(frozen=True)
class EntryTimes:
    """The times start + k period at which blocks enter."""

    start: float            # of the first block [s]
    period: float           # [s]
    blocks: int             # in the whole run; infinite without end

    def due(self, t):
        """Return the number of blocks that have entered by time t [s]."""
        passed = floor((t - self.start) / self.period + EVEN) + 1
        return min(max(passed, 0), self.blocks)

    def time(self, k):
        """Return the time at which block k enters [s]; infinite after the last one."""
        return self.start + k * self.period if k < self.blocks else inf


@dataclass(frozen=True)
class PlaceOfLastBlock:
    """A schedule (see `core.motion`): the displacement of the block that entered last."""

    sway: SourceSway
    times: EntryTimes

    def value(self, t):
        """Return the displacement (d,) [m]; before the first block, that of the first block."""
        return self.sway.value(self.times.time(max(self.times.due(t) - 1, 0)))


@dataclass(frozen=True)
class ParticleSource:
    """A block of particles that enters a run again and again, one block behind the other.

    Blocks enter with the given velocity, also where the source sways. Raises ValueError for times,
    a velocity or a number of particles that make no stream.
    """

    body: int               # number of the body that grows
    block: Body             # as it enters, numbered from 0; of which no array is changed
    velocity: np.ndarray    # (d,) [m/s]
    length: float           # of a block along the velocity [m]
    start: float            # time of the first block [s]
    blocks: int             # in the whole run
    sway: SourceSway | None = None

    def __post_init__(self):
        speed = float(np.linalg.norm(self.velocity))
        if not 0.0 < speed < inf or not 0.0 < self.length < inf:
            raise ValueError(f"a source with speed {speed:g} m/s and blocks of {self.length:g} m: "
                             "expected positive, finite numbers")
        if not self.start >= 0.0 or self.blocks < 1:
            raise ValueError(f"a source with {self.blocks} blocks from t = {self.start:g} s on: "
                             "expected at least one block, from a time >= 0 on")
        if self.blocks * len(self.block.id) > MOST:
            raise ValueError(f"{self.blocks} blocks of {len(self.block.id)} particles: expected at "
                             f"most {MOST} particles in all; take longer blocks or an earlier stop")

    @property
    def speed(self):
        """Return |v| [m/s]."""
        return float(np.linalg.norm(self.velocity))

    @property
    def period(self):
        """Return the time between two blocks [s]."""
        return self.length / self.speed

    @property
    def particles(self):
        """Return the number of particles of the whole run."""
        return self.blocks * len(self.block.id)

    @property
    def times(self):
        """Return the `EntryTimes` of its blocks."""
        return EntryTimes(self.start, self.period, self.blocks)

    def due(self, t):
        """Return the number of blocks that have entered by time t [s]."""
        return self.times.due(t)

    def time(self, k):
        """Return the time at which block k enters [s]; infinite after the last one."""
        return self.times.time(k)

    def place(self, k):
        """Return the displacement (d,) [m] of block k from where it is sampled, as it enters."""
        if self.sway is None:
            return np.zeros_like(self.velocity)
        return self.sway.value(self.time(k))

    def extremes(self):
        """Return the block's positions at both ends of its sway, (2 N, d) [m]: no block enters
        outside of their bounding box.
        """
        x = self.block.particles.x
        reach = 0.0 if self.sway is None else np.abs(self.sway.amplitude)
        return np.concatenate((x - reach, x + reach)).astype(x.dtype)

    def all_particles(self):
        """Return the body with all particles of the run, each where its block enters."""
        body = change_rows(self.block, lambda a: np.concatenate(self.blocks * [a]))
        if self.sway is not None:
            n = len(self.block.id)
            for k in range(self.blocks):
                body.particles.x[k * n:(k + 1) * n] += self.place(k)
        return body._replace(id=np.arange(self.particles))

    def entering(self, k, t):
        """Return block k as it enters at time t [s], with its stress."""
        moved = self.velocity * (t - self.time(k))
        if self.sway is not None:
            moved = moved + self.place(k)
        n = len(self.block.id)
        block = change_rows(self.block, np.copy)._replace(id=k * n + np.arange(n))
        block.particles.x[:] = self.block.particles.x + moved
        initial_stress(block)
        return block


@dataclass(frozen=True)
class ParticleSink:
    """A shape (see `core.levelset`) that takes the particles out of a run that are in it after a
    step.
    """

    shape: tuple
    name: str = ""

    def holds(self, x):
        """Return which of the points x (N, d) are in the sink, or on its surface."""
        return distances(np.asarray(x, dtype=float), self.shape) <= 0.0


def blocks_until(source, stop, end):
    """Return the number of blocks of a source (start, period) before `stop` [s], and up to `end`
    [s] of the run; either may be infinite, not both. Raises ValueError where no block fits.
    """
    start, period = source
    before = ceil((stop - start) / period - EVEN) if stop < inf else inf
    up_to = floor((end - start) / period + EVEN) + 1 if end < inf else inf
    if min(before, up_to) < 1:
        raise ValueError(f"no block enters from start = {start:g} s to {min(stop, end):g} s: "
                         "expected an earlier start")
    return int(min(before, up_to))


def first_bodies(bodies, sources):
    """Return the bodies of a run's start: those of sources with the blocks that are due then."""
    bodies = list(bodies)
    for source in sources:
        body = select_rows(source.block, np.zeros(len(source.block.id), dtype=bool))
        for k in range(source.due(0.0)):
            body = append(body, source.entering(k, 0.0))
        bodies[source.body] = body
    return tuple(bodies)


def total_bodies(problem):
    """Return the bodies with as many particles as they have in the whole run, those that enter
    later where their block enters; masses and volumes at rest are those of the run.
    """
    bodies = list(problem.bodies)
    for source in problem.sources:
        bodies[source.body] = source.all_particles()
    return tuple(bodies)


def next_entry(sources, t):
    """Return the time of the next block of any source after time t [s]; infinite without one."""
    return min((source.time(source.due(t)) for source in sources), default=inf)


def take_out(problem, state):
    """Remove the particles that are in a sink from the bodies of a state."""
    bodies = list(state.bodies)
    for k, body in enumerate(bodies):
        gone = np.zeros(len(body.id), dtype=bool)
        for sink in problem.sinks:
            gone |= sink.holds(body.particles.x)
        if gone.any():
            bodies[k] = select_rows(body, ~gone)
            _enter_account(problem, state, select_rows(body, gone), -1.0)
    state.bodies = tuple(bodies)


def let_in(problem, state, before):
    """Add the blocks that are due at the time of a state to its bodies, and were not at the time
    before [s]; return whether there is one.
    """
    entered, bodies = False, list(state.bodies)
    for source in problem.sources:
        for k in range(source.due(before), source.due(state.t)):
            block, entered = source.entering(k, state.t), True
            bodies[source.body] = append(bodies[source.body], block)
            _enter_account(problem, state, block, 1.0)
    state.bodies = tuple(bodies)
    return entered


def _enter_account(problem, state, body, sign):
    """Add (sign = 1) or subtract the energy of a body that enters or leaves. What leaves may have
    gained energy within the limits, which the account of the others then allows.
    """
    if state.account is not None:
        change = energy((body,), problem.gravity, problem.inertia)
        noise = noise_of(problem, (body,)) if sign > 0.0 else (
            problem.limits.growth * (change.kinetic + change.elastic))
        state.account = state.account.changed(change, sign, noise)


def check_streams(problem):
    """Raise ValueError for a part of a problem that has no form with sources and sinks."""
    if not (problem.sources or problem.sinks):
        return
    if problem.contacts:
        raise ValueError("sources or sinks with contacts of bodies: a field of a body may become "
                         "empty; expected a scene without [[contact]]")
    if problem.budget is not None:
        raise ValueError("energy budget with sources or sinks: it has no term for what enters and "
                         "leaves; expected a run without it")
    if not any(len(body.id) for body in problem.bodies):
        raise ValueError("no particle is there at t = 0: expected a source that starts at 0, or "
                         "another body")
