"""A reduced run of a scene and the full-order one, step by step."""

from typing import NamedTuple

import numpy as np

from mpm_ref.body import restore_order
from mpm_ref.core.blas import one_thread
from mpm_ref.rom.study.errors import PositionErrors, Squares
from mpm_ref.rom.study.full_model import FullModel, ldm_full_model
from mpm_ref.rom.study.run import RunOptions, ldm_run
from mpm_ref.scene import build
from mpm_ref.simulate import simulate

from ..common.scenes import threads_for
from .networks import trained

SHOWN = RunOptions("lagrangian", "linear", 50)
ALL = SHOWN._replace(points=None)       # as the paper's Table 4
ERROR_POINTS = 4000         # points that errors are of, at most


class PairedRun(NamedTuple):
    """A reduced run and the full-order run of the same scene."""

    full_model: FullModel
    X: np.ndarray           # (n, d) points at rest that are shown [m]
    reduced: np.ndarray     # (shots, n, d) their positions [m]
    full: np.ndarray        # (shots, n, d)
    xhat: np.ndarray        # (k + 1, r) latent coordinates
    errors: PositionErrors  # over all time levels
    tracked: int            # points that errors are of
    samples: int            # of a step

    @property
    def size(self):
        """Describe particles, steps and samples in words."""
        n, steps = len(self.full_model.X), self.full_model.problem.clock.steps
        samples = "all points" if self.samples == n else f"{self.samples} samples"
        return f"{n} particles, {steps} steps, {samples}"

    @property
    def scale(self):
        """Describe the size of the run, and the number of points that errors are of, in words."""
        return f"{self.size}, errors of {self.tracked} points"


def pair(scene, net, shots=None, shown=slice(None), options=SHOWN):
    """Return the `PairedRun` of a scene on a trained map: positions of the points `shown` at the
    steps `shots`, None for all of them.
    """
    one, model = ldm_full_model(scene), trained(net)
    tracked = slice(None, None, -(-len(one.X) // ERROR_POINTS))
    place, sums, frames, history = model.field.place, Squares(one.X[tracked]), [], []
    with threads_for(one.problem.bodies), one_thread():
        states = ldm_run(one, model.field, options, model.rest).states()
        for k, (x, (_, latent, report, _)) in enumerate(zip(positions(scene), states, strict=True)):
            sums.add(place(one.X[tracked], latent.xhat), x[tracked])
            history.append((latent.xhat, report))
            if shots is None or k in shots:
                frames.append((place(one.X[shown], latent.xhat), x[shown]))
    return PairedRun(one, one.X[shown], *np.stack(frames, axis=1),
                     np.array([xhat for xhat, _ in history]), sums.errors, len(sums.X),
                     history[-1][1].samples)


def positions(scene):
    """Yield x (n, d) of a full-order run, points in the body's own order."""
    for frame in simulate(build(scene)):
        body = frame.state.bodies[0]
        yield restore_order(body.particles.x, body.id)


def position_errors(X, states, reference):
    """Return the `PositionErrors` of states (k, n, d) of points X (n, d) against those of a
    reference run.
    """
    sums = Squares(X)
    for x, other in zip(states, reference, strict=True):
        sums.add(x, other)
    return sums.errors
