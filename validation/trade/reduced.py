"""When a reduced or learned model pays: error of the displacement against CPU time, training
included, on a soft arm with six parameters of which few runs are known.

The cost of N runs is that of the training runs, of the fit, and N times that of a run; full-order
runs and those on coarser grids have no training. A way is the cheapest for an error if no other one
with at most this error costs less.
"""

from typing import NamedTuple

import numpy as np

from mpm_ref.rom.study.errors import Squares

from ..common.registry import experiment
from .arm import arm, draws, simulated
from .arm_models import (
    Training,
    coarse_way,
    corrected_way,
    full_way,
    looked_up_ways,
    nsf_ways,
    pod_ways,
)

QUICK = {"2k": 0.04}
GRIDS = {"13k": 0.02, "43k": 0.04 / 3.0, "101k": 0.01}     # dx [m]
SMALL = 0.015               # dx above which all ways are tried, on more tests [m]
COARSER = (2, 4)
FIELDS = ("x", "F", "tau", "C")
ERROR, GAIN = 0.01, 5.0     # of the displacement, and the times that a model that pays is cheaper
SEED = 1                    # of the parameters' draws; settings were chosen on those of seed 0
TRAINED = ("corrected", "pod", "nsf", "curved")     # ways that the training runs are needed for
LOOKED_UP = ("nearest", "linear", "interpolated")
COLUMNS = ("size", "particles", "way", "error", "worst", "cpu_run", "cpu_fit", "cpu_data",
           "cpu_pairs")


class Counts(NamedTuple):
    """Numbers of runs."""

    train: int
    test: int


class Row(NamedTuple):
    """A way at a size."""

    size: str
    particles: int
    way: str
    error: float        # of the displacement, over all tests, levels and points
    worst: float        # ... of the worst test
    cpu_run: float      # CPU seconds of a run, mean
    cpu_fit: float      # ... of what is computed from the training runs
    cpu_data: float     # ... of the training runs
    cpu_pairs: float    # ... of those on a coarser grid

    @property
    def first(self):
        """CPU seconds before the first run."""
        return self.cpu_fit + self.cpu_data + self.cpu_pairs


@experiment("trade.reduced", title="When a reduced or learned model pays: a soft arm",
            profiles=("quick", "standard"), budget={"quick": 8, "standard": 1800})
def reduced(run):
    """Measure every way at each size; record the cheapest of those that keep the error."""
    rows = []
    for size, dx in run.progress(run.choose(quick=QUICK, standard=GRIDS).items(), "sizes"):
        counts = Counts(*run.choose(quick=(4, 1), standard=(16, 3 if dx > SMALL else 2)))
        found = rows_of(run, size, dx, counts)
        record_size(run, size, found, counts)
        rows += found
    run.table("ways", COLUMNS, rows)


def rows_of(run, size, dx, counts):
    """Return the `Row`s of a size, on a grid of spacing dx [m]."""
    train, test = draws(*counts, SEED)
    runs = [simulated(arm(mu, dx), FIELDS) for mu in run.progress(train, "training runs")]
    training = Training(dx, train, runs)
    data, pairs = sum(one.cpu for one in runs), {}
    tests = [simulated(arm(mu, dx)) for mu in test]
    whole = float(np.mean([one.cpu for one in runs + tests]))
    rows = [Row(size, len(training.X), "full.apic", 0.0, 0.0, whole, 0.0, 0.0, 0.0)]
    for times in run.choose(quick=COARSER[:1], standard=COARSER):
        pairs[times] = [simulated(arm(mu, times * dx)) for mu in train]
    for way in run.progress([*ways(run, training, pairs)], "ways"):
        rows.append(measured(way, size, (training, test, tests),
                             (data, sum(one.cpu for one in pairs.get(way.pairs, ())))))
    return rows


def ways(run, training, pairs):
    """Yield all `Way`s but the full-order run; at quick without reduced models."""
    yield full_way(training.dx, "mls")
    yield from looked_up_ways(training)
    for times, coarse in pairs.items():
        yield coarse_way(times, training)
        yield corrected_way(times, training, coarse)
    if run.profile == "standard":
        yield from nsf_ways(training)
        yield from pod_ways(training, training.dx > SMALL)


def measured(way, size, known, spent):
    """Return the `Row` of a `Way`; known: the `Training`, the tests' parameters and `ArmRun`s;
    spent: CPU seconds of the training runs and of those on the way's coarser grid.
    """
    training, test, tests = known
    answers = [way.answer(mu) for mu in test]
    total, worst = Squares(training.X), 0.0
    for answer, reference in zip(answers, tests, strict=True):
        if answer.x is None or not np.isfinite(answer.x).all():
            total, worst = None, np.inf
            break
        own = Squares(training.X)
        for x, expected in zip(answer.x, reference.x.astype(float), strict=True):
            own.add(x, expected)
            total.add(x, expected)
        worst = max(worst, own.errors.displacement)
    error = total.errors.displacement if total else np.inf
    is_trained = way.name.startswith((*TRAINED, *LOOKED_UP))
    return Row(size, len(training.X), way.name, error, worst,
               float(np.mean([answer.cpu for answer in answers])), way.fit,
               spent[0] if is_trained else 0.0, spent[1] if way.pairs else 0.0)


def record_size(run, size, rows, counts):
    """Record the error of each way of a size that comes to an end, and what the cheapest trained
    one gains at ERROR.
    """
    one, name = rows[0], f"trade.reduced.{size}"
    scale = f"{one.particles} particles, {counts.train} training runs, {counts.test} tests"
    for row in (row for row in rows[1:] if np.isfinite(row.error)):
        run.record(f"{name}.{row.way}", 100.0 * row.error, unit="%", comparator="info", scale=scale,
                   note=f"of the displacement, worst test {100.0 * row.worst:.3g} %; a run takes "
                   f"{row.cpu_run:.3g} CPU s, the full-order one {one.cpu_run:.3g}; before the "
                   f"first run {row.first:.3g}")
    if run.profile == "standard":
        record_gain(run, name, rows, scale)


def record_gain(run, name, rows, scale):
    """Record how many times the cheapest way without training, within ERROR, takes the time of the
    cheapest trained one, and after how many runs its training has paid.
    """
    within = [row for row in rows if row.error <= ERROR]
    plain = min((row for row in within if not row.first), key=lambda row: row.cpu_run)
    trained = min((row for row in within if row.first), key=lambda row: row.cpu_run, default=None)
    gain = plain.cpu_run / trained.cpu_run if trained else 0.0
    pays = trained.first / (plain.cpu_run - trained.cpu_run) if gain > 1.0 else np.inf
    note = ("no trained way is within the error" if trained is None else
            f"CPU time of a run of {plain.way} over that of {trained.way}; the training has paid "
            f"after {pays:.3g} runs")
    run.record(f"{name}.gain", gain, unit="x", comparator=">=", bound=GAIN, scale=scale,
               note=f"at {100.0 * ERROR:g} % of the displacement; {note}")
