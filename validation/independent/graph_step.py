"""One step of the graph network simulator, NCLaw's baseline "gnn" (NCLAW-methods) [GNS].

    point: (u - mean) / std of the last five u_k = x_k - x_{k-1}, distances to the walls / radius
    edge j -> i within the radius, itself included: r = (x_j - x_i) / radius, |r|
    m_ij = edges_k(e_ij, v_j, v_i),   w_i = points_k(v_i, sum_j m_ij),   e += m,   v += w
    a_i = mean + std answer(v_i),    x_1 = x_0 + u_0 + a

Distances to the walls are cut to [-1, 1]. All perceptrons but `answer` end in a layer norm. The
unit of time is a frame, so that velocities and accelerations are in m.
"""

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import KDTree

VARIANCE = 1e-5         # added to that of a layer norm


def perceptron(arrays, name, a):
    """Return the outputs (n, out) of the perceptron of a name in a file, at inputs a (n, in)."""
    W, b = ([arrays[f"{name}_{kind}{k}"].astype(float) for k in range(3)] for kind in "Wb")
    for k in range(3):
        a = a @ W[k] + b[k]
        a = np.maximum(a, 0.0) if k < 2 else a
    if f"{name}_gain" not in arrays:
        return a
    a = (a - a.mean(axis=1, keepdims=True)) / np.sqrt(a.var(axis=1, keepdims=True) + VARIANCE)
    return arrays[f"{name}_gain"] * a + arrays[f"{name}_shift"]


def edges(x, radius):
    """Return senders and receivers (k,) of all edges between points x (n, 3) [m]."""
    pairs = KDTree(x).query_pairs(radius, output_type="ndarray")
    own = np.arange(len(x))
    return (np.concatenate([pairs[:, 0], pairs[:, 1], own]),
            np.concatenate([pairs[:, 1], pairs[:, 0], own]))


def point_features(frames, walls, arrays):
    """Return the inputs (n, 21) of points in the last of frames (6, n, 3) [m].

    walls: places (2, 3) of the lower and the upper ones [m].
    """
    u = (np.diff(frames, axis=0) - arrays["v_mean"]) / arrays["v_std"]
    to_walls = np.hstack([frames[-1] - walls[0], walls[1] - frames[-1]]) / arrays["radius"]
    return np.hstack([*u, np.clip(to_walls, -1.0, 1.0)])


def accelerations(arrays, frames, walls):
    """Return the accelerations a (n, 3) [m per frame^2] after frames (6, n, 3) [m].

    arrays: those of a file of weights.
    """
    x, radius = frames[-1], float(arrays["radius"])
    senders, receivers = edges(x, radius)
    r = (x[senders] - x[receivers]) / radius
    v = perceptron(arrays, "points", point_features(frames, walls, arrays))
    e = perceptron(arrays, "edges", np.hstack([r, np.linalg.norm(r, axis=1, keepdims=True)]))
    into = csr_array((np.ones(len(e)), (receivers, np.arange(len(e)))), shape=(len(x), len(e)))
    k = 0
    while f"edges_{k}_W0" in arrays:
        message = perceptron(arrays, f"edges_{k}", np.hstack([e, v[senders], v[receivers]]))
        change = perceptron(arrays, f"points_{k}", np.hstack([v, into @ message]))
        e, v, k = e + message, v + change, k + 1
    return arrays["a_mean"] + arrays["a_std"] * perceptron(arrays, "answer", v)


def straight_flight(x, v, dt):
    """Return frames (6, n, 3) [m] up to x, dt [s] apart, of a flight with velocities v [m/s]."""
    return np.array([x - k * dt * v for k in range(5, -1, -1)])


def advance(arrays, frames, walls):
    """Return the positions (n, 3) [m] in the frame after frames (6, n, 3) [m]."""
    return 2.0 * frames[-1] - frames[-2] + accelerations(arrays, frames, walls)
