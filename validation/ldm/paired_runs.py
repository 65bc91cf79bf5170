"""A reduced run of a scene beside the full one, step by step."""

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

SHOWN_WAY = RunOptions("lagrangian", "linear", 50)
ALL = SHOWN_WAY._replace(points=None)       # as the paper's Table 4
ERROR_POINTS = 4000         # points that errors are of, at most


class Pair(NamedTuple):
    """A reduced run beside the full one."""

    full_model: FullModel              # that was run
    X: np.ndarray           # (n, d) points at rest that are shown [m]
    reduced: np.ndarray     # (shots, n, d) their positions [m]
    full: np.ndarray        # (shots, n, d)
    xhat: np.ndarray        # (k + 1, r) latent coordinates
    errors: PositionErrors          # over all time levels
    tracked: int            # points that errors are of
    samples: int            # of a step

    @property
    def size(self):
        """How much was run, in words."""
        n, steps = len(self.full_model.X), self.full_model.problem.clock.steps
        samples = "all points" if self.samples == n else f"{self.samples} samples"
        return f"{n} particles, {steps} steps, {samples}"

    @property
    def scale(self):
        """How much was run, and of how many points the errors are, in words."""
        return f"{self.size}, errors of {self.tracked} points"


def pair(scene, net, shots=None, shown=slice(None), way=SHOWN_WAY):
    """`Pair` of a scene on a trained map: positions of the points `shown` at the steps `shots`,
    None for all of them.
    """
    one, model = ldm_full_model(scene), trained(net)
    tracked = slice(None, None, -(-len(one.X) // ERROR_POINTS))
    place, sums, kept, seen = model.field.place, Squares(one.X[tracked]), [], []
    with threads_for(one.problem.bodies), one_thread():
        states = ldm_run(one, model.field, way, model.rest).states()
        for k, (x, (_, latent, report, _)) in enumerate(zip(positions(scene), states, strict=True)):
            sums.add(place(one.X[tracked], latent.xhat), x[tracked])
            seen.append((latent.xhat, report))
            if shots is None or k in shots:
                kept.append((place(one.X[shown], latent.xhat), x[shown]))
    return Pair(one, one.X[shown], *np.stack(kept, axis=1), np.array([xhat for xhat, _ in seen]),
                sums.errors, len(sums.X), seen[-1][1].samples)


def positions(scene):
    """Yield x (n, d) of a full-order run, points in the body's own order."""
    for frame in simulate(build(scene)):
        body = frame.state.bodies[0]
        yield restore_order(body.particles.x, body.id)


def beside(X, found, reference):
    """`PositionErrors` of states found (k, n, d) of points X (n, d) beside those of another run."""
    sums = Squares(X)
    for x, other in zip(found, reference, strict=True):
        sums.add(x, other)
    return sums.errors
