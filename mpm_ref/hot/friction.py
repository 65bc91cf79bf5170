"""Coulomb friction as a potential, for loads of the planes that are those of the solve before.

A node that slides along planes with normal impulses l_k and friction mu_k loses, in the step,

    D(u) = w f(|B (u - c)|),    w = sum_k mu_k |l_k|,    c = sum_k mu_k |l_k| v_k / w

of energy, with the projector B on what the planes leave free, velocities v_k of the planes, and

    f(y) = y            for y >= eps
         = y^2/eps - y^3/(3 eps^2) + eps/3        below

so that the friction is w along -B (u - c), and grows from 0 to w while the node creeps at less than
eps [m/s] [LiFerguson2020]. The loads l_k are held constant while the sum of E (HOT-eq1) and of D is
minimised, and are then updated, until they no longer change.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from ..core.jit import kernel
from ..core.tensor import dot, lin, mat, mlin, mv, outer, put_mat, put_vec, vec


class Friction(NamedTuple):
    """Friction at K nodes of a step."""

    node: np.ndarray    # (K,)        number of the node
    w: np.ndarray       # (K,)        friction when it slides [kg m/s]
    c: np.ndarray       # (K, d)      velocity of what it rubs on [m/s]
    B: np.ndarray       # (K, d, d)   projector on what planes leave free
    eps: float          # [m/s]       speed below which it creeps


@kernel
def dissipation(y, eps):
    """f, f'/y and f'' of a speed y >= 0 [m/s]."""
    if y >= eps:
        return y, 1.0 / y, 0.0
    return (y * y / eps - y * y * y / (3.0 * eps * eps) + eps / 3.0, (2.0 - y / eps) / eps,
            2.0 * (1.0 - y / eps) / eps)


@kernel
def slip(friction, k, u, like):
    """B (u - c) of the k-th node, and its size."""
    t = lin(1.0, vec(u, friction.node[k], like), -1.0, vec(friction.c, k, like))
    t = mv(mat(friction.B, k, like), t)
    return t, sqrt(dot(t, t))


@kernel
def dissipated(friction, u, like):
    """sum of D over the nodes of velocities u (n, d) [J]."""
    D = 0.0
    for k in range(len(friction.node)):
        _, y = slip(friction, k, u, like)
        D += friction.w[k] * dissipation(y, friction.eps)[0]
    return D


@kernel
def add_forces(friction, u, g, like):
    """g_i += dD/du_i."""
    for k in range(len(friction.node)):
        t, y = slip(friction, k, u, like)
        i, pull = friction.node[k], friction.w[k] * dissipation(y, friction.eps)[1]
        put_vec(g, i, lin(1.0, vec(g, i, like), pull, t))


@kernel
def fill_blocks(friction, u, H, like):
    """H_k = d2D/du_k^2, positive semi-definite: w (f'/y (B - t t^T/y^2) + f'' t t^T/y^2)."""
    for k in range(len(friction.node)):
        t, y = slip(friction, k, u, like)
        _, across, along = dissipation(y, friction.eps)
        bend = (along - across) / (y * y) if y > 0.0 else 0.0
        A = mlin(across, mat(friction.B, k, like), bend, outer(t, t))
        put_mat(H, k, mlin(friction.w[k], A, 0.0, A))


def energy(friction, u):
    """Return sum of D [J] at the velocities u (n, d) [m/s]."""
    return dissipated(friction, u, tuple(range(u.shape[1])))


def add_gradient(friction, u, g):
    """Add dD/du at the velocities u (n, d) [m/s] to g (n, d) [kg m/s]."""
    add_forces(friction, u, g, tuple(range(u.shape[1])))


def blocks(friction, u):
    """Return d2D/du^2 (K, d, d) [kg] of each node at the velocities u (n, d) [m/s]."""
    H = np.empty_like(friction.B)
    fill_blocks(friction, u, H, tuple(range(u.shape[1])))
    return H
