"""Points as braille characters: each character has two by four dots, which are about square."""

from typing import NamedTuple

import numpy as np

ACROSS, DOWN = 2, 4         # dots of a character
BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])   # (DOWN, ACROSS)
EMPTY = 0x2800              # the character without dots


class Region(NamedTuple):
    """A rectangle of a plane."""

    low: np.ndarray     # (2,) [m]
    high: np.ndarray    # (2,) [m]

    def including(self, x):
        """Return the smallest `Region` that has this one and all finite points x (n, 2) [m]."""
        x = x[np.isfinite(x).all(axis=1)]
        return Region(np.vstack((self.low, x)).min(axis=0), np.vstack((self.high, x)).max(axis=0))


def region_around(x):
    """Return the `Region` about the middle of points x (n, 2) [m], twice as wide and high as their
    longer side.
    """
    low, high = x.min(axis=0), x.max(axis=0)
    side = max(float((high - low).max()), np.finfo(float).tiny)
    return Region(0.5 * (low + high) - side, 0.5 * (low + high) + side)


def dots(x, region, columns, rows):
    """Return the dots (DOWN rows, ACROSS columns) bool, the uppermost row first, in which points x
    (n, 2) [m] lie, on one scale for both axes, with the middle of the region in the middle. Points
    outside, and those that are not finite, have none.
    """
    shape = np.array([ACROSS * columns, DOWN * rows])
    scale = float(np.max((region.high - region.low) / shape))       # of a dot [m]
    middle = 0.5 * (region.low + region.high)
    with np.errstate(invalid="ignore"):
        place = np.floor((x - middle) / scale + 0.5 * shape)
        place = np.where(x == region.high, np.minimum(place, shape - 1), place)
        place = np.where(x == region.low, np.maximum(place, 0), place)
        inside = ((place >= 0) & (place < shape)).all(axis=1)
    column, row = place[inside].astype(int).T
    result = np.zeros(shape[::-1], dtype=bool)
    result[shape[1] - 1 - row, column] = True
    return result


def characters(picture):
    """Return the lines of braille of dots (DOWN rows, ACROSS columns), bool."""
    rows, columns = picture.shape[0] // DOWN, picture.shape[1] // ACROSS
    cells = picture.reshape(rows, DOWN, columns, ACROSS)
    codes = EMPTY + np.einsum("rdca,da->rc", cells, BITS)
    return ["".join(map(chr, line)) for line in codes]
