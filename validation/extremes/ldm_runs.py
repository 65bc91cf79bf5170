"""Reduced runs at their extremes: the end of each, compared with the full-order run, and the checks
of its monitor (see `mpm_ref.rom.study.monitor`).

A run is bad where its error is above BAD times the usual error of its map, and above TOLERABLE;
`verdicts` has the four verdicts.
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
from .blocks import message_of
from .verdicts import FLAGGED, SILENT, STOPPED, flag_history, verdict, verdict_counts

BAD = 5.0           # times the usual error of the map
TOLERABLE = 1.0     # [%], the axis of LDM's Figure 9
STOPS = (NoBodyLeft, *BREAKDOWNS)


class Reduction(NamedTuple):
    """A deformation map to run on, with the latent coordinates of its training."""

    name: str
    field: object
    xhat: np.ndarray        # (s, k + 1, r) training latents
    rest: np.ndarray        # (r,) of the body at rest


def trained_reduction(name):
    """Return the `Reduction` of a trained map."""
    model = trained(name)
    return Reduction(name, model.field, model.xhat, model.rest)


def pod_reduction(snapshots, r):
    """Return the `Reduction` to r POD modes of `Snapshots`."""
    modes = basis(snapshots.X, *snapshots.flat(), r)
    return Reduction(f"pod-{r}", modes.modes, modes.xhat.reshape(*snapshots.x.shape[:2], r),
                     np.zeros(r))


class ReducedEnd(NamedTuple):
    """The end of a reduced run, and the extremes of its monitor's checks."""

    error: float            # of the position from the origin, as far as both runs went [%]
    steps: int              # completed
    first: int              # the first step that was flagged, -1 for none
    flags: str              # all quantities that were ever out of bounds
    beyond: float           # largest
    off: float              # largest [dx]
    coverage: float         # smallest
    rank: int               # smallest
    lost: float             # largest
    J: float                # smallest
    departure: float        # largest
    message: str            # the sentence with which it stopped, "" if it ran to its end


def reduced_end(case, x, reduction, options, sampler=None, states_out=None):
    """Run a reduced model and return its `ReducedEnd`, with errors against the full model's
    positions x (k + 1, n, d) as far as they go. If the options' samples are refused, only the start
    is computed.

    sampler(t, latent) replaces the options' samples; (`Latent`, x) of each state is appended to the
    list states_out.
    """
    message = "" if sampler else sampling_refusal(case, reduction.field, options)
    sums, checks = Squares(case.X), []
    with threads_for((case.problem.bodies[0],)), threadpoolctl.threadpool_limits(1):
        monitor = map_monitor(case, reduction.field, reduction.xhat)
        try:
            reduced = ldm_run(case, reduction.field, options, reduction.rest)
            if sampler is not None:
                reduced = reduced._replace(make_sampler=lambda xhat: sampler)
            states = checked_states(reduced, monitor)
            for state, check in islice(states, 1 if message else None):
                latent = state.latent
                positions = reduction.field.place(case.X, latent.xhat)
                if len(checks) < len(x):
                    sums.add(positions, x[len(checks)])
                if states_out is not None:
                    states_out.append((latent, positions))
                checks.append(check)
        except STOPS as stop:
            message = " ".join(str(stop).split())
    with np.errstate(divide="ignore"):      # a body that does not move
        error = 100.0 * sums.errors.origin
    return summarize_checks(checks, reduction.field.r, error, message)


def sampling_refusal(case, field, options):
    """Return the sentence with which an option's samples are refused, "" where they suffice."""
    return message_of(lambda: random_draw(case, field, options))


def summarize_checks(checks, r, error, message):
    """Return the `ReducedEnd` from the `StateCheck`s of a run."""
    first, flags = flag_history(checks)
    beyond, blind, off, coverage, lost, J, *_ = zip(*checks, strict=True)
    return ReducedEnd(error, len(checks) - 1, first, flags, max(beyond), max(off), min(coverage),
                      r - max(blind), max(lost), min(J), max(c.departure for c in checks), message)


def full_positions(problem):
    """Run a full-order model as far as it goes. Returns x (k + 1, n, d), and its sentence if it
    stopped.
    """
    rows = []
    with threads_for(problem.bodies):
        try:
            for frame in simulate(problem):
                body = frame.state.bodies[0]
                rows.append(restore_order(body.particles.x, body.id))
        except (Unstable, OutOfRange) as stop:
            return np.array(rows), str(stop)
    return np.array(rows), ""


class ReducedTrial(NamedTuple):
    """A reduced run of an experiment."""

    model: str
    what: str
    scheme: str
    points: int             # samples
    usual: float            # error of the model [%]
    end: ReducedEnd

    @property
    def is_bad(self):
        """True where the error is above BAD times the usual one, and above TOLERABLE."""
        return not self.end.error <= max(BAD * self.usual, TOLERABLE)

    @property
    def kind(self):
        """The verdict on the run."""
        return verdict(self.end, self.is_bad)


def record_silent(run, name, trials, scale, note=""):
    """Record the number of silent runs, and their share among the bad ones."""
    silent = [t for t in trials if t.kind == SILENT]
    bad = [t for t in trials if t.is_bad]
    examples = [f"{t.model}, {t.what}, {t.scheme} with {t.points}: {t.end.error:.3g} %"
                for t in silent[:6]]
    run.record(f"{name}.silent", len(silent), unit="runs", paper=0, comparator="=",
               scale=f"{scale}, {len(trials)} runs",
               note="; ".join(filter(None, (verdict_counts(trials), note, *examples))))
    run.record(f"{name}.misses", len(silent) / max(len(bad), 1), comparator="info", scale=scale,
               note=f"share of the {len(bad)} runs with errors above {BAD:g} times the usual one "
                    f"of the model, and above {TOLERABLE:g} %, that were neither flagged nor "
                    "stopped")


def record_false_alarms(run, name, trials):
    """Record the share of good runs that were flagged or stopped; one that is refused before its
    first step is none.
    """
    good = [t for t in trials if not t.is_bad and t.end.steps > 0]
    alarms = [t for t in good if t.kind in (FLAGGED, STOPPED)]
    flags = sorted({flag for t in alarms for flag in t.end.flags.split()})
    run.record(f"{name}.false_alarms", len(alarms) / max(len(good), 1), comparator="info",
               scale=f"{len(good)} runs that are not bad", note="share flagged or stopped"
               + (f", as {', '.join(flags)}" if flags else ""))
