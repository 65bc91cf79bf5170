"""A perceptron and its derivatives for many points at once, layer by layer: products of matrices.

    A_0 = A,   Z_l = A_l W_l + b_l,   A_{l+1} = elu(Z_l),   y = A_{L-1} W_{L-1} + b_{L-1}

The same numbers as `network`, to round-off, which walks point by point; faster, since
the products are those of BLAS and the exponentials of NumPy. With the slopes D_l = elu'(Z_l)
= exp(min(Z_l, 0)),

    dy_k/dA_l = (dy_k/dA_{l+1} * D_l) W_l^T        one pass back for every output
    dy        = (.. (u W_0 * D_0) W_1 * D_1 ..)    one pass forward for a direction u

Points are taken ROWS at a time, so that a batch stays in the cache, and threads share the batches,
each with BLAS of its own: the numbers do not depend on the threads. On how many points share its
batch, a point's depend to round-off.
"""

from concurrent.futures import ThreadPoolExecutor

import numba
import numpy as np

from ..core.blas import one_thread

ROWS = 1024
WORTH = 2           # batches for which a thread is worth its start


def batches(n):
    """Slices of n points."""
    return [slice(start, min(start + ROWS, n)) for start in range(0, n, ROWS)]


def over(n, work):
    """Call work(rows) for all batches of n points, on as many threads as kernels run on."""
    parts = batches(n)
    threads = min(len(parts) // WORTH, numba.get_num_threads())
    with one_thread():
        if threads < 2:
            for rows in parts:
                work(rows)
            return
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(work, parts))


def forward(layers, A):
    """Outputs (n, d) of inputs A (n, in), and the slopes D_l (n, width) of all hidden layers."""
    slopes = []
    for W, b in layers[:-1]:
        Z = A @ W
        Z += b
        D = np.minimum(Z, 0.0)
        np.exp(D, out=D)
        np.maximum(Z, 0.0, out=Z)
        Z += D
        Z -= 1.0                        # elu(z) = max(z, 0) + exp(min(z, 0)) - 1
        slopes.append(D)
        A = Z
    W, b = layers[-1]
    return A @ W + b, slopes


def backward(layers, slopes, k):
    """Gradients (n, in) of output k with respect to the inputs."""
    U = layers[-1][0][:, k]
    for (W, _), D in zip(layers[-2::-1], slopes[::-1], strict=True):
        U = (U * D) @ W.T
    return U


def directional(layers, slopes, u):
    """Derivative (n, d) of the outputs in a direction u (in,) of the inputs."""
    U = u
    for (W, _), D in zip(layers[:-1], slopes, strict=True):
        U = (U @ W) * D
    return U @ layers[-1][0]
