"""Relaxation of a particle's v and C to those of a grid that carries its old velocity.

The lag of a particle is what it has and the grid's old velocity does not give it; a share `flip` of
it stays (FLIP, and affine transfers with a relaxation time; docs/explanation/transfers.md).
"""

from .jit import kernel
from .state import affine
from .tensor import lin, mlin, outer, transpose


@kernel
def moment(C, p, D, like):
    """D C_p, the moment sum_i w_ip v_i r_ip^T of an affine field; zero where none is carried."""
    A = affine(C, p, like)
    return mlin(D, A, 0.0, A)


@kernel
def shift_spin(u, lag, flip, dt):
    """(q s^T - s q^T)/2 with q = flip lag and s = dt u.

    A particle with velocity u + q that moves by s gains the angular momentum m s x q about any
    point; a moment that is smaller by this one takes it back.
    """
    A = outer(lag, u)
    return mlin(0.5 * dt * flip, A, -0.5 * dt * flip, transpose(A))


@kernel
def blend_moment(B, flip, lag, spin, v_old):
    """B + flip lag - spin, where the old velocity is carried."""
    if v_old.ndim == 1:
        return B
    else:
        return mlin(1.0, mlin(1.0, B, flip, lag), -1.0, spin)


@kernel
def blend(u, flip, lag, v_old):
    """u + flip lag, where the old velocity is carried (FLIP)."""
    if v_old.ndim == 1:
        return u
    else:
        return lin(1.0, u, flip, lag)
