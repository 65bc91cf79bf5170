"""The reduced state, and the velocity of points that follows from it (X-cross-4).

In LDM, rates vhat are fitted with dg/dxhat at the latent coordinates before the step. The
velocities that they stand for depend on where dg/dxhat is evaluated, which is a choice; NSF has no
rates:

* "previous": dg/dxhat at the coordinates that the rates were fitted at. The next step
  starts from the velocity of the grid, projected.
* "latest": dg/dxhat at the coordinates reached, as LDM-alg3 and LDM-alg4 are printed. Over a step
  it adds dt g''(vhat, vhat) to the velocity, an acceleration that no force causes and that does not
  vanish with dt.
* "difference": (x_n - x_{n-1}) / dt, as NSF has it. After a linear projection it adds half of what
  "latest" adds; after a nonlinear one, nothing along the manifold.
* "transported": the velocity of "previous", projected on dg/dxhat at the coordinates reached.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from .evolution import EvolvedGradients
from .kinematics import evaluate
from .projection import project_position, project_velocity

VELOCITIES = ("previous", "latest", "difference", "transported")


class Latent(NamedTuple):
    """Reduced state between two steps."""

    xhat: np.ndarray                    # (r,) latent coordinates
    vhat: np.ndarray | None = None      # (r,) their rates [1/s]; None in a model without rates
    before: np.ndarray | None = None    # (r,) coordinates a step ago, which vhat was fitted at;
                                        # None at the start
    gradients: EvolvedGradients | None = None       # of a run that evolves F, after a step

    @property
    def fitted_at(self):
        """Latent coordinates (r,) that the rates were fitted at: at the start, the present ones."""
        return self.xhat if self.before is None else self.before

    def advance(self, xhat, vhat=None, gradients=None):
        """Return the `Latent` after a step that reached xhat, with rates fitted before it."""
        return Latent(xhat, vhat, self.xhat, gradients)


def start_state(xhat, vhat=None):
    """Return the `Latent` of a body that starts from latent coordinates, at rest without rates."""
    xhat = np.array(xhat, dtype=float)
    return Latent(xhat, np.zeros_like(xhat) if vhat is None else np.array(vhat, dtype=float))


def nearest(field, points, x, xhat):
    """Return the latent coordinates whose positions of points are nearest to x (n, d) [m], searched
    from xhat.
    """
    return project_position(field, points, x, xhat).y


def initial(g, X, x=None, v=None, xhat=None):
    """Return the `Latent` that fits positions x and velocities v (n, d) of points X at the start
    (LDM-eq17 to LDM-eq19), searched from xhat; without them, the body at rest.
    """
    fit = nearest(g, X, X if x is None else x, np.zeros(g.r) if xhat is None else xhat)
    if v is None:
        return start_state(fit)
    return start_state(fit, project_velocity(g.derivatives(X, fit)[2], v).y)


def velocities(field, latent, dt, samples, v0=None):
    """Return {name: function of `Kinematics` -> v (n, d) [m/s]} of VELOCITIES, in a step of length
    dt [s] with these points as samples. v0: velocities (n, d) [m/s] of numbered points at the
    start, which all but "latest" take there; without them, those of the rates.
    """
    def latest(state):
        return state.G @ latent.vhat

    def previous(state):
        if latent.before is None and v0 is not None:
            return v0[state.points]
        return field.velocity(state.points, latent.fitted_at, latent.vhat)

    def difference(state):
        if latent.before is None:
            return previous(state)
        return (state.x - field.place(state.points, latent.before)) / dt

    @cache
    def rates():
        state = evaluate(field, samples, latent.xhat)
        return project_velocity(state.G, previous(state)).y

    def transported(state):
        return state.G @ rates()

    return dict(zip(VELOCITIES, (previous, latest, difference, transported), strict=True))
