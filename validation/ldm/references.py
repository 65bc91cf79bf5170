"""Full-order test runs of a study, and the errors of reduced runs of them."""

from functools import cache
from math import inf
from typing import NamedTuple

import numpy as np
import threadpoolctl

from mpm_ref.rom.fields.pod import basis, modes
from mpm_ref.rom.fields.polynomial_manifold import curved
from mpm_ref.rom.projection import project_position
from mpm_ref.rom.step import BREAKDOWNS
from mpm_ref.rom.study.errors import PositionErrors, Squares
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import ldm_run

from ..common.position_errors import record_position_errors
from ..common.scenes import threads_for
from .networks import trained
from .studies import STUDIES

MODES = 40          # that curved maps follow with
ORIGIN = "from the centre of the held end"


class References(NamedTuple):
    """Full-order test runs that reduced runs are compared with."""

    study: str              # whose training runs POD modes are made of
    cases: tuple            # `FullModel` of each
    x: tuple                # full-order positions (k + 1, n, d) of each [m]
    total: int              # test runs that the study has

    @property
    def X(self):
        """Points (n, d) at rest [m]."""
        return self.cases[0].X

    @property
    def scale(self):
        """Describe the size of the runs in words."""
        return (f"{len(self.X)} particles, {len(self.x[0]) - 1} steps, "
                f"{len(self.x)} of {self.total} test runs")

    def run_errors(self, g, rest, options, seed=0):
        """Return the `PositionErrors` of reduced runs on a map g."""
        return run_errors(self.cases, self.x, g, options, rest, seed)

    def nearest_errors(self, g, rest):
        """Return the `PositionErrors` of the nearest states of a map g."""
        return nearest_state_errors(self.X, self.x, g, rest)

    def network_errors(self, name, options, seed=0):
        """Return the `PositionErrors` of reduced runs on a trained map."""
        model = trained(name)
        return self.run_errors(model.field, model.rest, options, seed)

    def pod_errors(self, r, options, seed=0):
        """Return the `PositionErrors` of reduced runs on r POD modes."""
        return self.run_errors(pod(self.study, r), np.zeros(r), options, seed)

    def nearest_network_errors(self, name):
        """Return the `PositionErrors` of the nearest states of a trained map."""
        model = trained(name)
        return self.nearest_errors(model.field, model.rest)

    def nearest_pod_errors(self, r):
        """Return the `PositionErrors` of the nearest states of r POD modes."""
        return self.nearest_errors(pod(self.study, r), np.zeros(r))


def run_errors(cases, references, g, options, rest, seed=0):
    """Return the `PositionErrors` of reduced runs of `FullModel`s on a map g over all runs;
    infinite where a run does not reach its end. references: the full-order x (k + 1, n, d) of each.
    """
    sums = Squares(cases[0].X)
    with threads_for((cases[0].problem.bodies[0],)), threadpoolctl.threadpool_limits(1):
        for k, (one, x) in enumerate(zip(cases, references, strict=True)):
            states = ldm_run(one, g, options, rest, seed + k).states()
            try:
                for state, reference in zip(states, x, strict=True):
                    sums.add(g.place(one.X, state.latent.xhat), reference)
            except BREAKDOWNS:
                return PositionErrors(inf, inf, inf)
    return sums.errors


def nearest_state_errors(X, references, g, rest):
    """Return the `PositionErrors` of the nearest states of a map g, without any dynamics: no
    reduced run on the map is expected to beat them.
    """
    sums = Squares(X)
    for x in references:
        xhat = rest
        for reference in x:
            xhat = project_position(g, X, reference, xhat).y
            sums.add(g.place(X, xhat), reference)
    return sums.errors


def references(study, count=None):
    """Return the `References` of `count` test runs of a study, evenly among them, or of all."""
    runs = study.test[::-(-len(study.test) // count)] if count else study.test
    cases = tuple(ldm_full_model(study.scene(*study.mu[k])) for k in runs)
    return References(study.name, cases, tuple(study.run(runs).x), len(study.test))


@cache
def training_snapshots(name):
    """Return X, x and F of all full-order training runs of a study."""
    full = STUDIES[name].run(STUDIES[name].train)
    return full.X, *full.flat()


@cache
def pod(name, r):
    """Return the POD `Modes` of the training runs of a study."""
    return modes(*training_snapshots(name), r)


@cache
def weighted_basis(name, lam_F=0.0, early=(0, 1.0)):
    """Return the `Basis` of the training runs of a study in a norm with lam_F [m^2], and the
    weights of the snapshots. early = (levels, weight): the first time levels of each run have that
    weight.
    """
    levels, weight = early
    X, x, F = training_snapshots(name)
    w = np.ones((len(STUDIES[name].train), len(x) // len(STUDIES[name].train)))
    w[:, :levels] = weight
    return basis(X, x, F, MODES, lam_F, w.ravel()), w.ravel()


@cache
def curved_map(name, r, degree, lam_F=0.0, early=(0, 1.0)):
    """Return a map of r coordinates over the modes of `weighted_basis`: `Modes` for degree 1, else
    `Curved`.
    """
    basis_of_runs, w = weighted_basis(name, lam_F, early)
    if degree == 1:
        modes = basis_of_runs.modes
        return modes._replace(U=modes.U[..., :r], slope=modes.slope[..., :r])
    return curved(basis_of_runs, r, degree, w)


def record_errors(run, name, errors, scale, note="", **rule):
    """Record `PositionErrors` in per cent."""
    record_position_errors(run, name, errors, scale, "; ".join(filter(None, (note, ORIGIN))),
                           **rule)


def record_seeds(run, name, errors, scale):
    """Record the `PositionErrors` {net: ..} of trainings of a map, their median, and their spread,
    the largest over the smallest.
    """
    for net, one in errors.items():
        record_errors(run, f"{name}.{net}", one, scale, comparator="info")
    origins = [one.origin for one in errors.values()]
    median = PositionErrors(*np.median(list(errors.values()), axis=0).tolist())
    record_errors(run, f"{name}.median", median, scale, f"of {len(errors)} trainings",
                  comparator="info")
    run.record(f"{name}.spread", max(origins) / min(origins), unit="1", scale=scale,
               comparator="info", note="the largest error of a training over the smallest")
