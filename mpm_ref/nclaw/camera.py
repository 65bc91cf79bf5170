"""A pinhole camera and its images of marked points of a body (NCLAW-real).

    h = P (x, 1),    place in the image = (h_0, h_1)/h_2 [px]

with P = K [R | -R c] for a camera at c. Images have no blur, and no mark is occluded.
"""

from typing import NamedTuple

import numpy as np


class Marks(NamedTuple):
    """Marked points in frames 0 .. f."""

    points: np.ndarray      # (m,) numbers of the points that are marked
    places: np.ndarray      # (f + 1, m, 2) in the image [px]


def pinhole(place, focal, middle):
    """Return P (3, 4) of a camera at `place` (3,) [m] that looks along -z, with y upwards.

    focal: focal length; middle (2,): the image of its axis; rows count downwards; all in px.
    """
    K = np.array([[focal, 0.0, middle[0]], [0.0, focal, middle[1]], [0.0, 0.0, 1.0]])
    R = np.diag([1.0, -1.0, -1.0])
    return K @ np.column_stack([R, -R @ np.asarray(place, float)])


def project(P, x):
    """Return the places (.., 2) [px] in the image of points x (.., 3) [m]; arrays or tensors, both
    alike.
    """
    h = x @ P[:, :3].T + P[:, 3]
    return h[..., :2] / h[..., 2:]


def front_layer(x):
    """Return the numbers of the points x (n, 3) in the layer nearest to a camera of `pinhole`."""
    return np.flatnonzero(x[:, 2] > x[:, 2].max() - 1e-9)


def observe_marks(P, x, points, noise, rng):
    """Return the `Marks` of some points in frames x (f + 1, n, 3), each place with normal noise
    [px].
    """
    places = project(P, x[:, points])
    return Marks(points, places + noise * rng.normal(size=places.shape))
