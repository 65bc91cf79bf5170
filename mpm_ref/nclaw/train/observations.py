"""Observations that laws are trained on: a trajectory, a part of one, or marks in images.

Each kind has `states(levels)` at the start of segments, `restarts(cuts)`, the time levels at which
segments may start, and `squared_error(name, a, levels)` of positions "x" or velocities "v".

Segments restart from observed states (`recipe`); with images that is the first state alone
(NCLAW-real). Then an epoch runs from the start to its horizon, which grows to the full run, and the
gradient is exact. Restarts from later states of the run itself, without their gradients, would
charge a law with errors that it made before.
"""

from typing import NamedTuple

import numpy as np
import torch

from ..camera import project


class Trajectory(NamedTuple):
    """Observed states at time levels 0 .. k; tensors of doubles."""

    x: torch.Tensor     # (k + 1, n, 3)    [m]
    v: torch.Tensor     # (k + 1, n, 3)    [m/s]
    C: torch.Tensor     # (k + 1, n, 3, 3) [1/s]
    F: torch.Tensor     # (k + 1, n, 3, 3)

    def states(self, levels):
        """Return the states (b, n, ..) at b time levels."""
        return tuple(a[levels] for a in self)

    def restarts(self, cuts):
        """Return the time levels at which segments begin, and the end: `cuts` as they are."""
        return cuts

    def squared_error(self, name, a, levels):
        """Return the squared errors of a field `a` (b, n, 3) at b time levels, their mean over
        points and axes, summed over the levels.
        """
        return mean_squared(a, getattr(self, name)[levels])


def trajectory_of(observed):
    """Return the `Trajectory` of `Observed`."""
    return Trajectory(*(torch.from_numpy(a) for a in (observed.x, observed.v, observed.C,
                                                      observed.F)))


def mean_squared(a, b):
    """Return the squared differences of a, b (b, n, 3), their mean over points and axes, summed
    over runs.
    """
    return ((a - b) ** 2).mean(dim=(1, 2)).sum()


class PartialTrajectory(NamedTuple):
    """Observed states at time levels 0 .. k with weights, in place of a `Trajectory`; tensors of
    doubles.

    States with weight 0 are never read; the first level must be observed. Weights with a mean of 1
    over the levels after the first keep the size of a loss.
    """

    x: torch.Tensor         # (k + 1, n, 3)    [m]
    v: torch.Tensor         # (k + 1, n, 3)    [m/s]
    C: torch.Tensor         # (k + 1, n, 3, 3) [1/s]
    F: torch.Tensor         # (k + 1, n, 3, 3)
    weight: torch.Tensor    # (k + 1, n) of squared errors

    def states(self, levels):
        """Return the states (b, n, ..) at b time levels."""
        return tuple(a[levels] for a in self[:4])

    def restarts(self, cuts):
        """Return the time levels at which segments begin, each the last observed one up to that of
        `cuts`, and the end.
        """
        observed = np.flatnonzero(self.weight.any(dim=1).numpy())
        begins = observed[np.searchsorted(observed, cuts[:-1], side="right") - 1]
        return [*np.unique(begins).tolist(), cuts[-1]]

    def squared_error(self, name, a, levels):
        """Return the weighted squared errors of a field `a` (b, n, 3) at b time levels, their mean
        over points and axes, summed over the levels.
        """
        weight = self.weight[levels]
        off = torch.where((weight > 0.0)[..., None], a - getattr(self, name)[levels], 0.0)
        return (weight * (off**2).mean(dim=2)).mean(dim=1).sum()


class ImageObservations(NamedTuple):
    """Marks in images at time levels 0 .. k, in place of a `Trajectory`; tensors of doubles
    but for `marked`.
    """

    x: torch.Tensor         # (k + 1, m, 2) places of marks [px]; finite also where no frame is
    weight: torch.Tensor    # (k + 1,) of squared errors in the image, 0 where no frame is
    marked: torch.Tensor    # (m,) numbers of the points that are marked; integer
    P: torch.Tensor         # (3, 4) of the camera, see `camera`
    depth: torch.Tensor     # (3,) unit vector along which it looks
    x_0: torch.Tensor       # (n, 3) [m] the state at the start, which is given
    v_0: torch.Tensor       # (n, 3) [m/s]
    C_0: torch.Tensor       # (n, 3, 3) [1/s]
    F_0: torch.Tensor       # (n, 3, 3)

    def states(self, levels):
        """Return the states (b, n, ..) at b time levels, all of them 0. Raises ValueError for
        others.
        """
        if levels.any():
            raise ValueError(f"states at time levels {levels.tolist()}: images give them at "
                             "level 0 alone")
        return tuple(a.expand(len(levels), *a.shape) for a in self[5:])

    def restarts(self, cuts):
        """Return the begin and the end of the one segment, of those asked for at time levels
        `cuts`.
        """
        return cuts[:2]

    def squared_error(self, name, a, levels):
        """Return a sum over time levels for positions or velocities a (b, n, 3).

        Of positions [m] it is the weighted squared distance of marks in the image [px^2], of
        velocities [m/s] the squared component in depth, which the paper's prior has small; both are
        means over marks or points.
        """
        if name == "v":
            return ((a @ self.depth) ** 2).mean(dim=1).sum()
        distances = project(self.P, a[:, self.marked]) - self.x[levels]
        return (self.weight[levels] * (distances ** 2).sum(dim=2).mean(dim=1)).sum()


def observe_images(marks, P, start, every):
    """Return the `ImageObservations` of `camera.Marks` in frames `every` steps apart.

    P (3, 4) is the camera's; start is the `Body` at the start. Frames have the weight `every`, so
    that a mean over steps is one over frames.
    """
    frames, m, _ = marks.places.shape
    steps = every * (frames - 1)
    x, weight = torch.zeros(steps + 1, m, 2, dtype=torch.float64), torch.zeros(steps + 1).double()
    x[::every], weight[::every] = torch.from_numpy(marks.places), float(every)
    P = torch.from_numpy(P)
    q = start.particles
    return ImageObservations(x, weight, torch.from_numpy(marks.points), P, P[2, :3].clone(),
                *(torch.from_numpy(a.copy()) for a in (q.x, q.v, q.C, q.F)))
