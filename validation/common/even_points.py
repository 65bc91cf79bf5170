"""The points of a body that pictures show, where it has too many."""

import numpy as np


def even_subset(X, most):
    """Return at most so many numbers of points X (n, d), evenly spread: each next point is the one
    farthest from those chosen before. Every k-th point of a lattice would show as stripes.
    """
    if len(X) <= most:
        return np.arange(len(X))
    chosen, distance = [0], np.full(len(X), np.inf)
    while len(chosen) < most:
        distance = np.minimum(distance, ((X - X[chosen[-1]])**2).sum(axis=1))
        chosen.append(int(distance.argmax()))
    return np.sort(chosen)
