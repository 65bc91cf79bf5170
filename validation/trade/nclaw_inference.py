"""Error and cost of a step of learned laws: by the width of their networks, the digits of the
weights and the length of the step.
"""

from math import ceil, log2
from time import process_time
from typing import NamedTuple

import numpy as np

from mpm_ref.explicit import deform_body
from mpm_ref.materials.learned.weights import PARTS
from mpm_ref.nclaw.bodies import copy_body, material_points
from mpm_ref.nclaw.study.compare import RunBroken, positions
from mpm_ref.scene import build

from ..common.registry import experiment
from ..common.scenes import threads_for, with_
from ..nclaw.environments import environment
from ..nclaw.evaluate import body_maker, compare
from ..nclaw.small_runs import measured
from ..nclaw.small_trainings import BASE, OF_WIDTH, last, small_nets
from ..nclaw.trained_laws import trained
from .front import front

NAMES = ("jelly", "plasticine")
DIGITS = {"quick": (24, 8), "standard": (53, 24, 16, 11, 8, 6, 4)}     # bits of a number, with the
                    # leading one: double 53, single 24, half 11, bfloat16 8
FACTORS = {"quick": (1.0, 4.0), "standard": (0.5, 1.0, 2.0, 4.0, 5.0, 10.0)}    # of the trained dt
EVERY = 20          # steps of the trained length between frames
SHORT = 200         # steps, quick
POINTS, REPEATS = 1000, 7
STRAIN = 0.05       # of random F that the time is measured at
ON_FRONT = "nothing is better and smaller"


class TimedStep(NamedTuple):
    """A run with another time step."""

    environment: str
    factor: float       # of the trained step
    cpu: float          # of the run [s]
    error: float        # beside the true laws with the trained step [m^2]
    true_cpu: float     # of the true laws with this step [s]
    true_error: float   # ... [m^2]


def point_cost(law, flow):
    """Return the median CPU seconds of law and flow for one point."""
    body = material_points(law, flow, np.eye(3) + STRAIN * np.random.default_rng(0).normal(
        size=(POINTS, 3, 3)))
    start, seconds = body.particles.F.copy(), []
    with threads_for((body,)):
        for _ in range(REPEATS + 1):
            body.particles.F[:] = start
            begin = process_time()
            deform_body(body, 0.0)
            seconds.append(process_time() - begin)
    return float(np.median(seconds[1:])) / POINTS


@experiment("trade.nclaw.width", title="NCLaw: error and cost by the width of the networks",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 120})
def width(run):
    """Vary the width of the two hidden layers; the paper's is 64."""
    names = run.choose(quick=[BASE], standard=[BASE, *OF_WIDTH])
    found = measured(run, names, full=False)
    found = [row for row in found if row.epoch == small_nets()[row.name].epochs]
    body = build(small_nets()[BASE].scene).bodies[0]
    true, rows = point_cost(body.law, body.flow), []
    costs = [learned_point_cost(last(row.name), body) for row in found]
    best = front(costs, [row.training_run for row in found])
    for row, seconds, on in zip(found, costs, best, strict=True):
        net = small_nets()[row.name]
        rows.append((net.width, seconds, true, row.training_run, row.thrown, row.cpu, int(on)))
        run.record(f"trade.nclaw.width.{net.width}", row.training_run, unit="m^2",
                   comparator="info", scale="216 particles, 100 epochs",
                   note=f"{1e6 * seconds:.3g} us of CPU time for both laws of a point, without "
                        f"the grid, the true laws {1e6 * true:.3g}; thrown differently "
                        f"{row.thrown:.3g} m^2")
    run.table("widths", ("width", "cpu_point", "true_cpu_point", "own", "thrown", "cpu_training",
                         "pareto"), rows)


def learned_point_cost(laws, body):
    """Return the `point_cost` of `LearnedLaws` in place of a body's own laws."""
    learned = body_maker(laws)(body)
    return point_cost(learned.law, learned.flow)


def round_weights(laws, bits):
    """Return `LearnedLaws` with weights rounded to a number of binary digits."""
    return laws._replace(**{part: getattr(laws, part)._replace(layers=tuple(
        tuple(round_digits(a, bits) for a in layer) for layer in getattr(laws, part).layers))
        for part in PARTS})


def round_digits(a, bits):
    """Return numbers rounded to a number of binary digits."""
    mantissa, exponent = np.frexp(a)
    return np.ldexp(np.round(mantissa * 2.0**bits), exponent - bits)


def weights_size(laws, bits):
    """Return the bytes of the weights of `LearnedLaws` with a number of digits: a sign replaces the
    leading digit, and the exponent is as wide as their range and zero need. Zero biases take none.
    """
    a = np.concatenate([a.ravel() for part in PARTS for layer in getattr(laws, part).layers
                        for a in layer if a.any()])
    exponents = np.frexp(a[a != 0.0])[1]
    return a.size * (bits + ceil(log2(np.ptp(exponents) + 2))) / 8


@experiment("trade.nclaw.digits", title="NCLaw: error and size by the digits of the weights",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 120})
def digits(run):
    """Round the weights alone; evaluation in doubles saves no time."""
    rows, bits = [], DIGITS[run.profile]
    for name in run.choose(quick=NAMES[:1], standard=NAMES):
        steps = run.choose(quick=SHORT, standard=environment(name).steps)
        laws = [round_weights(trained(name), k) for k in bits]
        found = compare(environment(name, steps=steps, every=EVERY), [*map(body_maker, laws)])
        sizes = [weights_size(one, k) for one, k in zip(laws, bits, strict=True)]
        best = front(sizes, [one.error for one in found])
        for k, size, one, on in zip(bits, sizes, found, best, strict=True):
            rows.append((name, k, size, *one, int(on)))
            words = f"weights of {size:.0f} bytes", ON_FRONT if on else "", one.why
            run.record(f"trade.nclaw.digits.{name}.{k}", one.error, unit="m^2", comparator="info",
                       scale=f"{steps} steps, 1000 particles",
                       note="; ".join(filter(None, words)))
    run.table("digits", ("environment", "bits", "bytes", "error", "step", "why", "pareto"), rows)


@experiment("trade.nclaw.dt", title="NCLaw: error and cost by the time step",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 120})
def time_step(run):
    """Compare with the true laws at the trained step, which true laws at another one also miss."""
    rows = []
    for name in run.choose(quick=NAMES[:1], standard=NAMES):
        rows += time_steps(name, FACTORS[run.profile],
                         run.choose(quick=SHORT, standard=environment(name).steps))
    best = {name: iter(front([row.cpu for row in own], [row.error for row in own]))
            for name in NAMES for own in [[row for row in rows if row.environment == name]]}
    for row in rows:
        run.record(f"trade.nclaw.dt.{row.environment}.{row.factor:g}", row.error, unit="m^2",
                   comparator="info", scale="1000 particles", note=f"{row.cpu:.3g} CPU s a run; "
                   f"the true laws with this step {row.true_cpu:.3g} CPU s, "
                   f"{row.true_error:.3g} m^2")
    run.table("steps", (*TimedStep._fields, "pareto"),
              [(*row, int(next(best[row.environment]))) for row in rows])


def time_steps(name, factors, steps):
    """Return the `TimedStep`s of an environment over the time of `steps` trained steps."""
    scene = environment(name, steps=steps, every=EVERY)
    x, _ = timed_run(scene, copy_body)
    rows = []
    for factor in factors:
        other = with_(scene, dt=factor * scene.dt, steps=round(steps / factor),
                      every=round(EVERY / factor))
        runs = [timed_run(other, make) for make in (body_maker(trained(name)), copy_body)]
        costs = [a for frames, cpu in runs for a in (cpu, frames_error(frames, x))]
        rows.append(TimedStep(name, factor, *costs))
    return rows


def timed_run(scene, make):
    """Return positions in frames as far as a run goes, and its CPU seconds."""
    problem, frames = build(scene), []
    with threads_for(problem.bodies):
        begin = process_time()
        try:
            for x in positions(problem, tuple(map(make, problem.bodies))):
                frames.append(x)
        except RunBroken:
            pass
        return frames, process_time() - begin


def frames_error(frames, x):
    """Return the mean squared error of frames [m^2]; infinite where some are missing."""
    if len(frames) < len(x):
        return np.inf
    return float(np.mean([np.mean((a - b) ** 2) for a, b in zip(frames, x, strict=True)]))
