"""The fields of a study, made of its runs, and how far they are off these."""

import numpy as np

from ..fields.network import Networks, learned
from ..fields.pod_fields import spanned
from .errors import MEASURED, Squares

BLOCK = 3.0         # size of blocks of points [dx]


def made(study, histories):
    """`Spanned` fields of a study from its `Histories`, and the latent coordinates (s, k + 1, r) of
    the states kept. Raises ValueError for more modes than these hold.
    """
    map = study.tables.map
    return spanned(histories, map.sizes, BLOCK * study.base.dx, map.stress_sees_parameters)


def of_run(fields, whole, mu):
    """The fields, `Spanned` or `Networks`, in the run of a `Whole` scene with parameters mu, where
    the stress is told them.
    """
    if isinstance(fields, Networks):
        return learned(whole.X, fields, mu, BLOCK * whole.problem.dx)
    return fields.of(mu) if len(fields.mu) else fields


def misfit(fields, histories, xhat):
    """`Errors` of the fields' positions at latent coordinates xhat (s, k + 1, r) beside the
    `Histories` of these runs, at MEASURED points.
    """
    some = np.arange(0, len(histories.X), -(-len(histories.X) // MEASURED))
    squares, (n, d) = Squares(histories.X[some]), histories.X.shape
    map, points = (fields.g, squares.X) if isinstance(fields, Networks) else (fields, some)
    for y, x in zip(np.reshape(xhat, (-1, fields.r)), histories.x.reshape(-1, n, d), strict=True):
        squares.add(map.place(points, y), x[some])
    return squares.errors
