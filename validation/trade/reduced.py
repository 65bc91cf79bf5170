"""When a reduced or learned model pays: error of the displacement against CPU time, training
included, on a soft arm with six parameters of which few runs are known.

The cost of N runs is that of the training runs, of the fit, and N times that of the steps of a run,
by one thread; what is set up before the first step is left out everywhere. Errors are those of
agreement with the full-order run, whatever its own error is. Full-order runs and those on coarser
grids have no training. A method is the cheapest for an error if no
other one with at most this error costs less.
"""

from typing import NamedTuple

import numba
import numpy as np

from mpm_ref.core.jit import set_threads
from mpm_ref.rom.study.errors import Squares

from ..common.registry import experiment
from .arm import arm, draws, simulated
from .arm_models import (
    Training,
    coarse_method,
    coarse_scene,
    corrected_method,
    full_method,
    looked_up_methods,
    nsf_methods,
    pod_methods,
)

QUICK = {"2k": 0.04}
GRIDS = {"13k": 0.02, "43k": 0.04 / 3.0, "101k": 0.01}     # dx [m]
SMALL = 0.015               # dx above which all methods are tried, on more tests [m]
COARSER = (2, 4)            # times as coarse, of the runs that are corrected
PLAIN = (1.25, 1.5, 1.75, 2, 4)     # ... and of those that are not
FIELDS = ("x", "F", "tau", "C")
ERROR, GAIN = 0.01, 5.0     # of the displacement, and the times that a model that pays is cheaper
SEED = 1                    # of the parameters' draws; settings were chosen on those of seed 0
TRAINED = ("corrected", "pod", "nsf", "curved")     # methods that need the training runs
LOOKED_UP = ("nearest", "linear", "interpolated")
COLUMNS = ("size", "particles", "method", "error", "worst", "cpu_run", "cpu_fit", "cpu_data",
           "cpu_pairs", "settings")


class Counts(NamedTuple):
    """Numbers of runs."""

    train: int
    test: int


class ArmCost(NamedTuple):
    """A method at a size."""

    size: str
    particles: int
    method: str
    error: float        # of the displacement, over all tests, levels and points
    worst: float        # ... of the worst test
    cpu_run: float      # CPU seconds of a run, mean
    cpu_fit: float      # ... of what is computed from the training runs
    cpu_data: float     # ... of the training runs
    cpu_pairs: float    # ... of those on a coarser grid
    settings: str = ""

    @property
    def first(self):
        """CPU seconds before the first run."""
        return self.cpu_fit + self.cpu_data + self.cpu_pairs


@experiment("trade.reduced", title="When a reduced or learned model pays: a soft arm",
            profiles=("quick", "standard"), budget={"quick": 8, "standard": 1800})
def reduced(run):
    """Measure every method at each size; record the cheapest of those that keep the error."""
    threads = numba.get_num_threads()
    set_threads(1)
    try:
        compare_sizes(run)
    finally:
        set_threads(threads)


def compare_sizes(run):
    """Record all methods of all sizes."""
    rows = []
    for size, dx in run.progress(run.choose(quick=QUICK, standard=GRIDS).items(), "sizes"):
        counts = Counts(*run.choose(quick=(16, 2), standard=(16, 3 if dx > SMALL else 2)))
        found = rows_of(run, size, dx, counts)
        record_size(run, size, found, counts)
        rows += found
    run.table("methods", COLUMNS, rows)


def rows_of(run, size, dx, counts):
    """Return the `ArmCost`s of a size, on a grid of spacing dx [m]."""
    train, test = draws(*counts, SEED)
    runs = [simulated(arm(mu, dx), FIELDS) for mu in run.progress(train, "training runs")]
    training = Training(dx, train, runs)
    data, pairs = sum(one.cpu for one in runs), {}
    tests = [simulated(arm(mu, dx)) for mu in test]
    whole = float(np.mean([one.cpu for one in runs + tests]))
    rows = [ArmCost(size, len(training.X), "full.apic", 0.0, 0.0, whole, 0.0, 0.0, 0.0)]
    for times in run.choose(quick=COARSER[:1], standard=COARSER):
        coarse = coarse_scene(times, dx)
        pairs[times] = [simulated(coarse(mu)) for mu in train]
    for method in run.progress([*methods(run, training, pairs)], "methods"):
        rows.append(measured(method, size, (training, test, tests),
                             (data, sum(one.cpu for one in pairs.get(method.pairs, ())))))
    return rows


def methods(run, training, pairs):
    """Yield all `ArmMethod`s but the full-order run; at quick without reduced models."""
    yield full_method(training.dx, "mls")
    yield from looked_up_methods(training)
    for times in run.choose(quick=COARSER[:1], standard=PLAIN):
        for transfer in ("apic", "mls"):
            yield coarse_method(times, training, transfer)
    for times, coarse in pairs.items():
        yield corrected_method(times, training, coarse)
    if run.profile == "standard":
        yield from nsf_methods(training, training.dx > SMALL)
        yield from pod_methods(training, training.dx > SMALL)


def measured(method, size, cases, spent):
    """Return the `ArmCost` of an `ArmMethod`; cases: the `Training`, the tests' parameters and
    `ArmRun`s; spent: CPU seconds of the training runs and of those on the method's coarser grid.
    """
    training, test, tests = cases
    found = [method.positions(mu) for mu in test]
    error, worst = errors(training.X, found, tests)
    is_trained = method.name.startswith((*TRAINED, *LOOKED_UP))
    return ArmCost(size, len(training.X), method.name, error, worst,
                      float(np.mean([positions.cpu for positions in found])), method.fit,
                      spent[0] if is_trained else 0.0, spent[1] if method.pairs else 0.0,
                      method.settings)


def errors(X, runs, tests):
    """Return the error of the displacement over all tests, and that of the worst, of
    `TimedPositions` compared with `ArmRun`s of points X (n, 3) at rest; infinite where one broke
    down.
    """
    if any(one.x is None or not np.isfinite(one.x).all() for one in runs):
        return np.inf, np.inf
    total, each = Squares(X), [Squares(X) for _ in tests]
    for one, test, own in zip(runs, tests, each, strict=True):
        for x, expected in zip(one.x, test.x.astype(float), strict=True):
            own.add(x, expected)
        total.sums += own.sums
    return total.errors.displacement, max(own.errors.displacement for own in each)


def record_size(run, size, rows, counts):
    """Record the error of each method of a size that comes to an end, and what the cheapest trained
    one gains at ERROR.
    """
    one, name = rows[0], f"trade.reduced.{size}"
    scale = f"{one.particles} particles, {counts.train} training runs, {counts.test} tests"
    for row in (row for row in rows[1:] if np.isfinite(row.error)):
        run.record(f"{name}.{row.method}", 100.0 * row.error, unit="%", comparator="info",
                   scale=scale, note=f"of the displacement, worst test {100.0 * row.worst:.3g} %; "
                   "a run takes "
                   f"{row.cpu_run:.3g} CPU s, the full-order one {one.cpu_run:.3g}; before the "
                   f"first run {row.first:.3g}{'; ' + row.settings if row.settings else ''}")
    record_correction(run, name, rows, scale)
    if run.profile == "standard":
        record_gain(run, name, rows, scale)


def record_correction(run, name, rows, scale):
    """Record the error of each corrected run over that of the same run without a correction."""
    error = {row.method: row.error for row in rows}
    for times in (times for times in COARSER if f"corrected.{times}" in error):
        run.record(f"{name}.corrected.{times}.left",
                   error[f"corrected.{times}"] / error[f"coarse.{times}.mls"], unit="1",
                   comparator="<=", bound=1.0, scale=scale,
                   note="error over that of the same coarse run without a correction")


def record_gain(run, name, rows, scale):
    """Record how many times the cheapest other method within ERROR takes the time of
    the cheapest trained one, and after how many runs its training has paid.
    """
    within = [row for row in rows if row.error <= ERROR]
    plain, trained = (min((row for row in within if row.method.startswith(TRAINED) == learned),
                          key=lambda row: row.cpu_run, default=None) for learned in (False, True))
    gain = plain.cpu_run / trained.cpu_run if trained else 0.0
    pays = ((trained.first - plain.first) / (plain.cpu_run - trained.cpu_run) if gain > 1.0
            else np.inf)
    note = ("no trained method is within the error" if trained is None else
            f"CPU time of a run of {plain.method} over that of {trained.method}; the training "
            f"has paid after {pays:.3g} runs")
    run.record(f"{name}.gain", gain, unit="x", comparator=">=", bound=GAIN, scale=scale,
               note=f"at {100.0 * ERROR:g} % of the displacement; {note}")
