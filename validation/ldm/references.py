"""Test runs of a study, full order, and what reduced runs of them are off by."""

from functools import cache
from typing import NamedTuple

import numpy as np

from mpm_ref.rom.fields.pod import basis, modes
from mpm_ref.rom.fields.polynomial_manifold import curved
from mpm_ref.rom.study.full_model import ldm_full_model

from .networks import trained
from .reduced_runs import compared, reconstructed
from .studies import STUDIES

MODES = 40          # that curved maps follow with
ORIGIN = "from the centre of the held end"


class References(NamedTuple):
    """Runs that reduced ones are compared with."""

    study: str              # whose training runs POD modes are made of
    cases: tuple            # `Case` of each
    x: tuple                # full-order positions (k + 1, n, d) of each [m]
    of: int                 # test runs that the study has

    @property
    def X(self):
        """Points (n, d) at rest [m]."""
        return self.cases[0].X

    @property
    def scale(self):
        """How much it is, in words."""
        return (f"{len(self.X)} particles, {len(self.x[0]) - 1} steps, {len(self.x)} of {self.of} "
                "test runs")

    def on(self, map, rest, way, seed=0):
        """`Errors` of reduced runs on a map."""
        return compared(self.cases, self.x, map, way, rest, seed)

    def near(self, map, rest):
        """`Errors` of the nearest states of a map."""
        return reconstructed(self.X, self.x, map, rest)

    def errors(self, name, way, seed=0):
        """`Errors` of reduced runs on a trained map."""
        model = trained(name)
        return self.on(model.field, model.rest, way, seed)

    def linear(self, r, way, seed=0):
        """`Errors` of reduced runs on as many POD modes."""
        return self.on(pod(self.study, r), np.zeros(r), way, seed)

    def nearest(self, name):
        """`Errors` of the nearest states of a trained map."""
        model = trained(name)
        return self.near(model.field, model.rest)

    def nearest_linear(self, r):
        """`Errors` of the nearest states of as many POD modes."""
        return self.near(pod(self.study, r), np.zeros(r))


def references(study, count=None):
    """`References` of some test runs of a study, evenly among them, or of all."""
    runs = study.test[::-(-len(study.test) // count)] if count else study.test
    cases = tuple(ldm_full_model(study.scene(*study.mu[k])) for k in runs)
    return References(study.name, cases, tuple(study.run(runs).x), len(study.test))


@cache
def training(name):
    """X, x and F of all training runs of a study, full order."""
    full = STUDIES[name].run(STUDIES[name].train)
    return full.X, *full.flat()


@cache
def pod(name, r):
    """`Modes` of the training runs of a study."""
    return modes(*training(name), r)


@cache
def based(name, lam_F=0.0, early=(0, 1.0)):
    """`Basis` of the training runs of a study, in a norm with lam_F [m^2]; early = (levels, weight)
    has the first time levels of each run weigh so much more.
    """
    levels, weight = early
    X, x, F = training(name)
    w = np.ones((len(STUDIES[name].train), len(x) // len(STUDIES[name].train)))
    w[:, :levels] = weight
    return basis(X, x, F, MODES, lam_F, w.ravel()), w.ravel()


@cache
def bent(name, r, degree, lam_F=0.0, early=(0, 1.0)):
    """Map of r coordinates over the modes of `based`: `Modes` for degree 1, else `Curved`."""
    found, w = based(name, lam_F, early)
    if degree == 1:
        return found.modes._replace(U=found.modes.U[..., :r], slope=found.modes.slope[..., :r])
    return curved(found, r, degree, w)


def share(run, name, errors, scale, note="", **rule):
    """Record `Errors` in per cent: the paper's, which depends on the origin, and others beside."""
    origin, centroid, displacement = (100.0 * error for error in errors)
    run.record(name, origin, unit="%", scale=scale, note=f"{ORIGIN}; from the centroid "
               f"{centroid:.3g} %, of the displacement {displacement:.3g} %"
               + (f"; {note}" if note else ""), **rule)


def mean_of(found, what):
    """Mean of several `Errors`, and in words: of how many of what, and the largest."""
    worst = 100.0 * max(errors.origin for errors in found)
    mean = type(found[0])(*np.mean(found, axis=0))
    return mean, f"mean of {len(found)} {what}, the largest {worst:.3g} %"
