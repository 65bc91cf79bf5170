"""What is trained on where a body was filmed: marks in images, and how it began (NCLAW-real).

Segments restart from states that were observed (see `teacher`), and of a film that is the first one
alone. So an epoch runs from the start to its horizon, which grows to the whole run: the gradient is
exact. Restarts from the run's own later states, without their gradients, would see those further
than the horizon, but blame a law for errors that it made before.
"""

from typing import NamedTuple

import torch

from ..camera import project


class Film(NamedTuple):
    """Marks in images at time levels 0 .. k, in place of a `rollout.Trajectory`; tensors of doubles
    but for `marked`.
    """

    x: torch.Tensor         # (k + 1, m, 2) places of marks [px]; finite also where no frame is
    weight: torch.Tensor    # (k + 1,) of squared errors in the image, 0 where no frame is
    marked: torch.Tensor    # (m,) which points are marked; integer
    P: torch.Tensor         # (3, 4) of the camera, see `camera`
    depth: torch.Tensor     # (3,) unit vector along which it looks
    x_0: torch.Tensor       # (n, 3) [m] the state at the start, which is known
    v_0: torch.Tensor       # (n, 3) [m/s]
    C_0: torch.Tensor       # (n, 3, 3) [1/s]
    F_0: torch.Tensor       # (n, 3, 3)

    def at(self, levels):
        """The states (b, n, ..) at b time levels, all of them 0. Raises ValueError for others."""
        if levels.any():
            raise ValueError(f"states at time levels {levels.tolist()}: a film knows that at level "
                             "0 alone")
        return tuple(a.expand(len(levels), *a.shape) for a in self[5:])

    def restarts(self, cuts):
        """Where the one segment begins and ends, of those asked for at time levels `cuts`."""
        return cuts[:2]

    def off(self, name, a, levels):
        """Of positions a (b, n, 3) [m] at b time levels the weighted squared distance of marks in
        the image [px^2], of velocities [m/s] the squared component in depth, which the paper's
        prior has small; their mean over marks or points, summed over the levels.
        """
        if name == "v":
            return ((a @ self.depth) ** 2).mean(dim=1).sum()
        distances = project(self.P, a[:, self.marked]) - self.x[levels]
        return (self.weight[levels] * (distances ** 2).sum(dim=2).mean(dim=1)).sum()


def film_of(marks, P, start, every):
    """`Film` of `camera.Marks` in frames `every` steps apart, from a `Body` as it starts; P (3, 4)
    is the camera's. Frames weigh `every`, so that a mean over steps is one over frames.
    """
    frames, m, _ = marks.places.shape
    steps = every * (frames - 1)
    x, weight = torch.zeros(steps + 1, m, 2, dtype=torch.float64), torch.zeros(steps + 1).double()
    x[::every], weight[::every] = torch.from_numpy(marks.places), float(every)
    P = torch.from_numpy(P)
    q = start.particles
    return Film(x, weight, torch.from_numpy(marks.points), P, P[2, :3].clone(),
                *(torch.from_numpy(a.copy()) for a in (q.x, q.v, q.C, q.F)))
