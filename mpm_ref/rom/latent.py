"""The reduced state, and the velocity of points that it stands for (X-cross-4).

vhat is fitted with dg/dxhat at the latent coordinates before they move. Which dg/dxhat turns it
back into velocities is a choice:

* "previous": dg/dxhat at the coordinates it was fitted with. The velocity that the grid gave is
  what the next step starts from, projected, no more.
* "latest": at the coordinates reached, as LDM-alg3 and LDM-alg4 are printed. Over a step it adds
  dt g''(vhat, vhat) to the velocity, an acceleration that no force causes and that does not vanish
  with dt.
* "difference": (x_n - x_{n-1}) / dt, as NSF has it. After a linear projection it adds half of what
  "latest" adds; after a nonlinear one, nothing along the manifold.
* "transported": the velocity of "previous", projected on dg/dxhat at the coordinates reached.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from .kinematics import placed
from .projection import project_position, project_velocity

VELOCITIES = ("previous", "latest", "difference", "transported")


class Latent(NamedTuple):
    """Reduced state between two steps."""

    xhat: np.ndarray        # (r,) latent coordinates
    vhat: np.ndarray        # (r,) their rates [1/s]
    before: np.ndarray      # (r,) coordinates that vhat was fitted at; at the start, xhat


class Points(NamedTuple):
    """Kinematics of points, from latent coordinates alone (LDM-eq14 to LDM-eq16)."""

    X: np.ndarray           # (n, d)    at rest [m]
    x: np.ndarray           # (n, d)    position [m]
    F: np.ndarray           # (n, d, d) deformation gradient
    v: np.ndarray           # (n, d)    velocity [m/s]


def at_start(xhat, vhat=None):
    """`Latent` of a body that starts from latent coordinates, at rest where no rates are given."""
    xhat = np.array(xhat, dtype=float)
    return Latent(xhat, np.zeros_like(xhat) if vhat is None else np.array(vhat, float), xhat.copy())


def initial(map, X, x=None, v=None, xhat=None):
    """`Latent` that fits positions x and velocities v (n, d) of points X at the start (LDM-eq17 to
    LDM-eq19),
    searched from xhat; without them, the body at rest.
    """
    from_here = np.zeros(map.r) if xhat is None else xhat
    fit = project_position(map, X, X if x is None else x, from_here).y
    if v is None:
        return at_start(fit)
    return at_start(fit, project_velocity(map.derivatives(X, fit)[2], v).y)


def moved(latent, xhat, vhat):
    """`Latent` after a step that reached xhat with rates fitted at the coordinates before."""
    return Latent(xhat, vhat, latent.xhat)


def points(map, latent, X, velocity):
    """`Points` of material points X, by a function of `velocities`."""
    return moving(placed(map, X, latent.xhat), velocity)


def moving(at, velocity):
    """`Points` of `Placed` ones, by a function of `velocities`."""
    return Points(at.X, at.x, at.F, velocity(at.X, at.x, at.G))


def velocities(map, latent, dt, X_samples):
    """{name: function (X, x, G) -> v} of VELOCITIES, in a step of length dt [s]."""
    def latest(X, x, G):
        return G @ latent.vhat

    def previous(X, x, G):
        return map.velocity(X, latent.before, latent.vhat)

    def difference(X, x, G):
        if np.array_equal(latent.before, latent.xhat):
            return previous(X, x, G)
        return (x - map.place(X, latent.before)) / dt

    @cache
    def rates():
        _, _, G_samples = map.derivatives(X_samples, latent.xhat)
        return project_velocity(G_samples, previous(X_samples, None, None)).y

    def transported(X, x, G):
        return G @ rates()

    return dict(zip(VELOCITIES, (previous, latest, difference, transported), strict=True))
