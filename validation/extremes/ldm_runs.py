"""Reduced runs at their extremes: how each ended, beside the full-order run, and what its watch
said (see `mpm_ref.rom.study.monitor`).

A run is bad where its error is above BAD times what is usual for its map, and above TOLERABLE. It
ends in one of four ways: it stopped with a sentence; the watch flagged it in some step; it is fine;
or it is silent: bad, and neither stopped nor flagged. No run may be silent.
"""

from itertools import islice
from typing import NamedTuple

import numpy as np
import threadpoolctl

from mpm_ref.body import restore_order
from mpm_ref.core.grid import OutOfRange
from mpm_ref.monitor import Unstable
from mpm_ref.rom.fields.pod import basis
from mpm_ref.rom.step import BREAKDOWNS
from mpm_ref.rom.study.errors import Squares
from mpm_ref.rom.study.monitor import NoBodyLeft, checked_states, map_monitor
from mpm_ref.rom.study.run import ldm_run
from mpm_ref.rom.study.samples import random_draw
from mpm_ref.simulate import simulate

from ..common.scenes import threads_for
from ..ldm.networks import trained

BAD = 5.0           # times the error that is usual for the map
TOLERABLE = 1.0     # [%], the axis of LDM's Figure 9
STOPPED, FLAGGED, FINE, SILENT = "stopped", "flagged", "fine", "silent"
STOPS = (NoBodyLeft, *BREAKDOWNS)


class Reduction(NamedTuple):
    """A map to run on, and what it was trained with."""

    name: str
    map: object
    xhat: np.ndarray        # (s, k + 1, r) training latents
    rest: np.ndarray        # (r,) of the body at rest


def learned(name):
    """`Reduction` of a trained map."""
    model = trained(name)
    return Reduction(name, model.field, model.xhat, model.rest)


def linear(snapshots, r):
    """`Reduction` of r POD modes of `Snapshots`."""
    found = basis(snapshots.X, *snapshots.flat(), r)
    return Reduction(f"pod-{r}", found.modes, found.xhat.reshape(*snapshots.x.shape[:2], r),
                     np.zeros(r))


class End(NamedTuple):
    """How a run ended, and the extremes of what its watch saw."""

    error: float            # of the position from the origin, as far as both runs went [%]
    steps: int              # made
    first: int              # the step that was flagged first, -1 for none
    flags: str              # what was ever out of bounds
    beyond: float           # largest
    off: float              # largest [dx]
    coverage: float         # smallest
    rank: int               # smallest
    lost: float             # largest
    J: float                # smallest
    said: str               # the sentence with which it stopped, "" if it ran to its end

    def kind(self, usual):
        """Which of the four ends it is, for a map whose usual error is so [%]."""
        if self.said:
            return STOPPED
        if self.flags:
            return FLAGGED
        return FINE if self.error <= max(BAD * usual, TOLERABLE) else SILENT


def ended(case, x, reduction, way, pick=None, keep=None):
    """`End` of a reduced run of a `Case` beside the full model's x (k + 1, n, d), or as much as
    there is of it; pick as of `march`. (`Latent`, x) of each state is appended to the list keep.
    Of a run whose samples are refused there is the start.
    """
    said = "" if pick else refused(case, reduction.map, way)
    sums, sights = Squares(case.X), []
    with threads_for((case.problem.bodies[0],)), threadpoolctl.threadpool_limits(1):
        monitor = map_monitor(case, reduction.map, reduction.xhat)
        try:
            reduced = ldm_run(case, reduction.map, way, reduction.rest)
            if pick is not None:
                reduced = reduced._replace(make_sampler=lambda xhat: pick)
            states = checked_states(reduced, monitor)
            for state, sight in islice(states, 1 if said else None):
                latent = state.latent
                at = reduction.map.place(case.X, latent.xhat)
                if len(sights) < len(x):
                    sums.add(at, x[len(sights)])
                if keep is not None:
                    keep.append((latent, at))
                sights.append(sight)
        except STOPS as stop:
            said = " ".join(str(stop).split())
    with np.errstate(divide="ignore"):      # a body that does not move
        error = 100.0 * sums.errors.origin
    return of_sights(sights, reduction.map.r, error, said)


def refused(case, map, way):
    """The sentence with which the samples of a way are refused, "" where they suffice."""
    try:
        random_draw(case, map, way)
    except ValueError as refusal:
        return str(refusal)
    return ""


def of_sights(sights, r, error, said):
    """`End` from the `StateCheck`s of a run."""
    flagged = [k for k, sight in enumerate(sights) if sight.out_of_bounds]
    flags = dict.fromkeys(word for sight in sights for word in sight.out_of_bounds)
    beyond, blind, off, coverage, lost, J, *_ = zip(*sights, strict=True)
    return End(error, len(sights) - 1, flagged[0] if flagged else -1, " ".join(flags), max(beyond),
               max(off), min(coverage), r - max(blind), max(lost), min(J), said)


def full(problem):
    """x (k + 1, n, d) of a full-order run as far as it goes, and its sentence if it stopped."""
    rows = []
    with threads_for(problem.bodies):
        try:
            for frame in simulate(problem):
                body = frame.state.bodies[0]
                rows.append(restore_order(body.particles.x, body.id))
        except (Unstable, OutOfRange) as stop:
            return np.array(rows), str(stop)
    return np.array(rows), ""


class Trial(NamedTuple):
    """A run of an experiment."""

    map: str
    what: str
    scheme: str
    points: int             # samples
    usual: float            # error of the map [%]
    end: End

    @property
    def kind(self):
        """Which of the four ends it is."""
        return self.end.kind(self.usual)


def record_silent(run, name, trials, scale, note=""):
    """Record how many runs were silent, and the share of the bad ones that were: the misses of the
    watch.
    """
    silent = [t for t in trials if t.kind == SILENT]
    bad = [t for t in trials if not t.end.error <= max(BAD * t.usual, TOLERABLE)]
    count = {kind: sum(t.kind == kind for t in trials) for kind in (STOPPED, FLAGGED, FINE)}
    ways = ", ".join(f"{n} {kind}" for kind, n in count.items())
    words = [f"{t.map}, {t.what}, {t.scheme} with {t.points}: {t.end.error:.3g} %" for t in silent]
    run.record(f"{name}.silent", len(silent), unit="runs", paper=0, comparator="=",
               scale=f"{scale}, {len(trials)} runs",
               note="; ".join(filter(None, (ways, note, *words[:6]))))
    run.record(f"{name}.misses", len(silent) / max(len(bad), 1), comparator="info", scale=scale,
               note=f"share of the {len(bad)} runs with errors above {BAD:g} times the map's usual "
                    f"one, and above {TOLERABLE:g} %, that were neither flagged nor stopped")


def table_of(run, trials):
    """Write the trials as a table."""
    run.table("runs", (*Trial._fields[:-1], "kind", *trials[0].end._fields),
              [(*t[:-1], t.kind, *t.end) for t in trials])
