"""From which size on a reduced model of the arm is the cheapest: a model of what runs cost, fitted
to times of steps at three sizes and checked at a larger one, with the errors of `trade.reduced`.

Times are CPU times of one thread, medians of steps of all methods and sizes in turn, in memory that
the process keeps: pages that are cleared anew make steps of many points dearer, and no law of sizes
would hold. That errors fall with the size as they do between the three sizes is an extrapolation,
of which coarse runs of the larger size are a check. Errors of reduced models do not fall; the
smallest is taken.
"""

from typing import NamedTuple

import numba
import numpy as np

from mpm_ref.core.heap import keep_freed_memory
from mpm_ref.core.jit import set_threads
from mpm_ref.rom.study.full_model import ldm_full_model

from ..common.input_files import declare
from ..common.registry import experiment
from ..common.results import RESULTS, ProfileResults
from .arm import ENDS, arm, draws, simulated
from .arm_models import Training, coarse_method
from .reduced import ERROR, GAIN, GRIDS, SEED, errors
from .size_model import (
    ArmRunCost,
    Rivals,
    first_size,
    fit_grid_error,
    fit_power,
    fit_step,
    fit_tried,
    fit_windows,
    last_size,
)
from .size_timing import (
    carried_models,
    in_turn,
    median_step,
    readings,
    small_models,
    steppers,
)

FITTED = {"quick": (0.03, 0.02), "standard": tuple(GRIDS.values())}     # dx [m]
CHECK = {"quick": 0.015, "standard": 0.02 / 3.0}
TRAIN = 6                   # runs of the small arm that modes are of
COARSER = (2, 4)            # times as coarse, of runs that are read and corrected
WHOLE = ((2, "apic"), (2, "mls"), (4, "apic"))      # coarse runs of the check
COUNTS = 16, 2              # of the draws of `trade.reduced`, whose tests are taken
FACTOR, ERROR_FACTOR = 1.3, 1.5     # within which predictions hold; chosen before the measurement
SIZES = np.geomspace(1e4, 1e9, 501)
REDUCED = {"pod.few": "pod", "pod.all": "pod", "nsf.few": "nsf", "nsf.all": "nsf"}  # what is read
STEPS = ("particles", "method", "cpu", "points", "candidates", "samples", "predicted",
         "predicted_points", "fitted")
READS = ("particles", "name", "cpu", "predicted", "fitted")
RUNS = ("method", "error", "predicted_error", "cpu", "predicted")
GAINS = ("particles", "method", "cpu", "gain", "gain_full")


class SizeNeeded(NamedTuple):
    """Sizes [particles] from which on a method is cheaper; infinite: never until the largest."""

    method: str
    error: float            # that it is taken to have
    equal_full: float       # as cheap as the full-order run within the error
    gain_full: float        # GAIN times as cheap
    equal: float            # ... as the cheapest rival, on any grid
    until: float            # up to which it is as cheap; 0: at none
    gain: float
    equal_steps: float      # ... without what is read from states
    best: float             # largest gain beside the cheapest rival
    best_at: float          # size of it
    step_limit: float       # CPU seconds of a step of the largest body
    rival_limit: float      # CPU seconds of the steps of the run on the grid that has the error
                            # however many particles the body has


class Timed(NamedTuple):
    """Median times of steps, and of what is read, at several sizes."""

    particles: dict         # {dx: N}
    steps: dict             # {(dx, method): `Step`}
    reads: dict             # {(dx, name): [s]}


@experiment("trade.reduced-size", title="From which size on a reduced model pays: a cost model",
            profiles=("quick", "standard"), budget={"quick": 30, "standard": 400})
def reduced_size(run):
    """Fit the cost model, compare it with a larger size, and record the sizes that it predicts."""
    keep_freed_memory()
    threads = numba.get_num_threads()
    set_threads(1)
    try:
        compare(run)
    finally:
        set_threads(threads)


def compare(run):
    """Record the check of the cost model, and at standard what it predicts."""
    fitted, check = FITTED[run.profile], CHECK[run.profile]
    timed = time_sizes(run, (*fitted, check))
    steps, reads = step_costs(timed, fitted), read_costs(timed, fitted)
    record_steps(run, timed, steps, check)
    run.table("reads", READS, [(timed.particles[dx], name, cpu, reads[name], int(dx != check))
                               for (dx, name), cpu in timed.reads.items()])
    if run.profile == "standard":
        rivals = rivals_of(run, timed, steps, reads)
        costs = run_costs(rivals, steps, reads)
        record_whole_runs(run, rivals, check)
        record_gains(run, rivals, costs)
        record_sizes(run, rivals, costs)


# Times.

def time_sizes(run, sizes):
    """Return what is `Timed` on grids of these spacings [m]."""
    mu, (test,) = draws(TRAIN, 1, SEED)
    small, rounds = small_models(mu, sizes[0]), run.choose(quick=3, standard=7)
    models = {dx: carried_models(small, dx) for dx in run.progress(sizes, "sizes")}
    steps = {(dx, name): step for dx, one in models.items()
             for name, step in steppers(one, test, dx).items()}
    found = in_turn(steps, rounds, run.progress)
    particles = {dx: int(found[dx, "full.apic"][0].points) for dx in sizes}
    del steps
    reads = {(dx, name): read for dx, one in models.items()
             for name, read in readings(one, test, dx, COARSER).items()}
    return Timed(particles, {key: median_step(each) for key, each in found.items()},
                 {key: float(np.median(each))
                  for key, each in in_turn(reads, rounds, run.progress).items()})


def step_costs(timed, fitted):
    """Return {method: `StepCost`} by the times on grids of these spacings."""
    N, costs = np.array([timed.particles[dx] for dx in fitted]), {}
    for name in dict.fromkeys(method for _, method in timed.steps):
        steps = [timed.steps[dx, name] for dx in fitted]
        cpu, points, candidates, samples = map(np.array, zip(*steps, strict=True))
        if candidates.any():
            windows = fit_windows(N, points, samples.mean())
            costs[name] = fit_step(N, cpu, windows, fit_tried(N, candidates, windows))
        else:
            costs[name] = fit_step(N, cpu)
    return costs


def read_costs(timed, fitted):
    """Return {name: CPU seconds of a point} of what is read, the mean over the spacings."""
    return {name: float(np.mean([timed.reads[dx, name] for dx in fitted]))
            for name in dict.fromkeys(name for _, name in timed.reads)}


def record_steps(run, timed, costs, check):
    """Record times and points of steps of the largest size over the predicted ones."""
    rows = []
    for (dx, name), step in timed.steps.items():
        N, cost = float(timed.particles[dx]), costs[name]
        points = float(cost.windows.count(N)) if cost.windows else N
        rows.append((int(N), name, *step, float(cost.seconds(N)), points, int(dx != check)))
        if dx == check:
            record_step(run, rows[-1], bool(cost.windows))
    run.table("steps", STEPS, rows)


def record_step(run, row, is_sampled):
    """Record the time, and the points of samples, of a step of a row of STEPS."""
    one = dict(zip(STEPS, row, strict=True))
    name, scale = f"trade.reduced-size.{one['method']}", f"{one['particles']} particles"
    band = {"comparator": "band", "bound": (1.0 / FACTOR, FACTOR)}
    run.record(f"{name}.step", one["cpu"] / one["predicted"], unit="1", scale=scale,
               note=f"CPU time of a step over the predicted one, {1e3 * one['cpu']:.3g} ms over "
               f"{1e3 * one['predicted']:.3g}",
               **(band if run.profile == "standard" else {"comparator": "info"}))
    if is_sampled:
        run.record(f"{name}.points", one["points"] / one["predicted_points"], unit="1",
                   scale=scale, note=f"integration points over the predicted ones, "
                   f"{one['points']:.0f} over {one['predicted_points']:.0f}", **band)


# Errors.

def measured_methods():
    """Return the errors and times that `trade.reduced` has at standard, an input of this
    experiment, as {column: array}.
    """
    declare("results/standard/trade.reduced.methods.csv")
    return ProfileResults(RESULTS / "standard").table("trade.reduced", "methods")


def rivals_of(run, timed, steps, reads):
    """Return the `Rivals`, with the errors of `trade.reduced`; record how far these are from the
    law of coarser grids.
    """
    table = measured_methods()
    size, n, method, error = (table[name] for name in ("size", "particles", "method", "error"))
    dx = np.array([GRIDS[one] for one in size])
    coarse = {name: float(name.split(".", 1)[1].rsplit(".", 1)[0]) if "coarse" in name else 1.0
              for name in method}
    c = np.array([coarse[name] for name in method])
    own = np.array([name.startswith("coarse") and name.endswith("apic") for name in method])
    law, left = fit_grid_error(c[own], dx[own], error[own])
    run.record("trade.reduced-size.error.left", 100.0 * np.expm1(left), unit="%",
               comparator="info", scale=f"{own.sum()} errors of `trade.reduced`",
               note=f"misfit of B dx^p (c^p - 1), root mean square; p = {law.p:.3g}, "
               f"B = {law.B:.3g} m^-p")
    others = {coarse[name]: fit_power(n[method == name], error[method == name])
              for name in dict.fromkeys(method) if name.endswith(".mls")}
    middle = np.mean(ENDS, axis=1)
    count = np.mean([arm(middle, dx).steps / np.cbrt(N) for dx, N in timed.particles.items()])
    volume = np.mean([N * dx**3 for dx, N in timed.particles.items()])
    full, other = (ArmRunCost(steps[f"full.{transfer}"], count) for transfer in ("apic", "mls"))
    return Rivals(full, other, reads["carry.2"], law, others, volume)


def record_whole_runs(run, rivals, check):
    """Record errors and times of coarse runs of the largest size over the predicted ones."""
    _, tests = draws(*COUNTS, SEED)
    X = ldm_full_model(arm(tests[0], check)).X
    full = [simulated(arm(mu, check)) for mu in run.progress(tests, "full-order runs")]
    N = float(len(X))
    rows = [("full.apic", 0.0, 0.0, float(np.mean([one.cpu for one in full])),
             float(rivals.full.seconds(N)))]
    for times, transfer in run.progress(WHOLE, "coarse runs"):
        method = coarse_method(times, Training(check, tests, []), transfer)
        found = [method.positions(mu) for mu in tests]
        cost, law = ((rivals.full, rivals.error.value(times, check)) if transfer == "apic" else
                     (rivals.other, rivals.others[times].value(N)))
        rows.append((method.name, errors(X, found, full)[0], float(law),
                     float(np.mean([one.cpu for one in found])),
                     float(rivals.coarse(cost, times).seconds(N))))
    for method, error, law, cpu, predicted in rows:
        name, scale = f"trade.reduced-size.{method}", f"{len(X)} particles, {len(tests)} tests"
        run.record(f"{name}.run", cpu / predicted, unit="1", comparator="band",
                   bound=(1.0 / FACTOR, FACTOR), scale=scale, note="CPU time of a run over the "
                   f"predicted one, {cpu:.3g} s over {predicted:.3g}; not in turn")
        if law:
            run.record(f"{name}.error", error / law, unit="1", comparator="band",
                       bound=(1.0 / ERROR_FACTOR, ERROR_FACTOR), scale=scale,
                       note=f"error of the displacement over the extrapolated one, "
                       f"{100.0 * error:.3g} % over {100.0 * law:.3g}")
    run.table("runs", RUNS, rows)


def record_gains(run, rivals, costs):
    """Record the time of the full run over that of a reduced one, as `trade.reduced` has them, over
    the predicted gain: that of the size with the largest misfit.
    """
    table = measured_methods()
    N, method, cpu = (table[name] for name in ("particles", "method", "cpu_run"))
    for name in REDUCED:
        own = N[method == name]
        gains = cpu[(method == "full.apic") & np.isin(N, own)] / cpu[method == name]
        predicted = rivals.full.seconds(own) / costs[name].seconds(own)
        ratios = gains / predicted
        run.record(f"trade.reduced-size.{name}.gain-measured",
                   float(ratios[np.argmax(np.abs(np.log(ratios)))]), unit="1", comparator="band",
                   bound=(1.0 / FACTOR, FACTOR), scale="the sizes of `trade.reduced`",
                   note="CPU time of the full run over that of a reduced one, over the predicted "
                   "gain, where it is farthest off: " + "; ".join(
                       f"{one:.3g} over {other:.3g} at {n:.0f} particles"
                       for n, one, other in zip(own, gains, predicted, strict=True)))


# Sizes.

def run_costs(rivals, steps, reads):
    """Return {method: `ArmRunCost`} of what is learned."""
    found = {name: ArmRunCost(steps[name], rivals.full.steps, reads[read])
             for name, read in REDUCED.items()}
    return found | {f"corrected.{times}": ArmRunCost(rivals.other.step, rivals.other.steps,
                                                  reads[f"corrected.{times}"], times)
                    for times in COARSER}


def record_sizes(run, rivals, costs):
    """Record the largest gain of each method, with its smallest error and with ERROR where it has
    a larger one, and the sizes from which on it pays.
    """
    table = measured_methods()
    rows, curves = [], []
    for method, cost in costs.items():
        least = float(table["error"][table["method"] == method].min())
        for error in dict.fromkeys((least, min(least, ERROR))):
            one = size_needed(method, error, rivals, cost)
            rows.append(one)
            record_size(run, one, "" if error == least else ".as-1-percent")
        gains = (rivals.cheapest(SIZES, least) / cost.seconds(SIZES),
                 rivals.cheapest(SIZES, least, False) / cost.seconds(SIZES))
        curves += [(N, method, *row) for N, *row in
                   zip(SIZES, cost.seconds(SIZES), *gains, strict=True)][::10]
    run.table("sizes", SizeNeeded._fields, rows)
    run.table("gains", GAINS, curves)


def size_needed(method, error, rivals, cost):
    """Return the `SizeNeeded` of a method with an error and a `ArmRunCost`."""
    seconds = cost.seconds(SIZES)
    full, best = (rivals.cheapest(SIZES, error, any_grid) / seconds for any_grid in (False, True))
    bare = (rivals._replace(carry=0.0).cheapest(SIZES, error)
            / cost._replace(read=0.0).seconds(SIZES))
    at = int(np.argmax(best))
    N = rivals.volume * (rivals.error.B / error) ** (3.0 / rivals.error.p)
    return SizeNeeded(
        method, error, first_size(SIZES, full, 1.0), first_size(SIZES, full, GAIN),
        first_size(SIZES, best, 1.0), last_size(SIZES, best, 1.0), first_size(SIZES, best, GAIN),
        first_size(SIZES, bare, 1.0), float(best[at]), float(SIZES[at]),
        float(cost.step.seconds(SIZES[-1] / cost.coarser**3)), float(rivals.full.seconds(N)))


def record_size(run, one, word):
    """Record the largest gain of a `SizeNeeded`."""
    def text(size, until=0.0):
        if np.isfinite(size):
            return f"from {size:.2g} particles on"
        return f"up to {until:.2g} particles" if until else "never"

    run.record(f"trade.reduced-size.{one.method}.gain{word}", one.best, unit="x",
               comparator="info", scale=f"{SIZES[0]:.0e} to {SIZES[-1]:.0e} particles, predicted",
               note=f"largest, at {one.best_at:.2g} particles, with an error of "
               f"{100.0 * one.error:.3g} %; as cheap as the cheapest other run within it: "
               f"{text(one.equal, one.until)} ({text(one.equal_steps)} without reading all "
               f"points), {GAIN:g} "
               f"times as cheap: {text(one.gain)}; as the full-order run: {text(one.equal_full)} "
               f"and {text(one.gain_full)}")
