"""Inverses of diagonal blocks: by cofactors where a node moves freely, else as `projectors` do."""

import numpy as np

from ....core.jit import kernel
from ....core.tensor import cofactor, det, mat, mlin, put_mat, trace, transpose
from ..projectors import inverses, surely_regular


@kernel
def _invert(D, out, like):
    for i in range(len(D)):
        block, scale = mat(D, i, like), trace(mat(D, i, like))
        if scale > 0.0:
            block = mlin(1.0 / scale, block, 0.0, block)
        size = scale * det(block)
        if size > 0.0:
            put_mat(out, i, mlin(1.0 / size, transpose(cofactor(block)), 0.0, block))


def inverse_blocks(D, B):
    """Pseudo-inverses (n, d, d) of diagonal blocks D on the ranges of projectors B, as
    `projectors.inverses`.
    """
    out = np.empty_like(D)
    _invert(D, out, (0,) * D.shape[1])
    other = np.flatnonzero(~surely_regular(D))
    out[other] = inverses(D[other], B[other])
    return out
