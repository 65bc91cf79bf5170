"""F-bar: particles of a cell change their volume together, against volumetric locking.

Each particle that cannot change its volume binds its nodes by a constraint; where there are more of
these than nodes can follow, a body locks. F-bar [deSouzaNeto1996], in the increments of
[Coombs2018] and by sums over particles as in [ZhaoJiangChoo2023], keeps one a cell. In a step with
G_p = I + dt L_p,

    J_c = sum_p w_cp V0_p det G_p / sum_p w_cp V0_p           mean growth of volume in cell c
    J_p = sum_c w_cp J_c,    Gbar_p = (J_p/det G_p)^(1/d) G_p,    F <- Gbar_p F

Hence F, and the stress, the return map and the energy with it, are those of averaged volumes. The
weight w_cp is the mean of the linear splines of the cell's 2^d corners at x_p: the product over the
axes of

    1/4 - u/2,   1/2,   1/4 + u/2      of the cell before, the particle's own, the one behind

u in [-1/2, 1/2) is the particle's place from the middle of its cell [cells]. From one cell to the
next an alternating field averages out at every u, so that no checkerboard of the pressure is left.
"""

import numpy as np

from .deform import growth
from .jit import CHUNKS, chunk, kernel, parallel_if_many, prange
from .order import slabs_of
from .precision import converted, with_rounded_spacing
from .spline import STENCILS
from .stencil import column, locate, node, product
from .tensor import det, identity, mlin, put_mat, vec

NODES = STENCILS[3]         # the nodes between which the three cells per axis lie
CELLS = (0, 1, 2)


@kernel
def cell_weights(s):
    """w[a][k] of the cells between the nodes k and k + 1 of the stencil `NODES`, by the offset s
    from its first node [cells].
    """
    if len(s) == 2:
        return _per_axis(s[0]), _per_axis(s[1])
    else:
        return _per_axis(s[0]), _per_axis(s[1]), _per_axis(s[2])


@kernel
def _per_axis(s):
    u = s - 1.5
    return 0.25 - 0.5 * u, 0.5, 0.25 + 0.5 * u


@kernel
def scatter_growth(particles, cells, grown, dt, members):
    """Add V0_p and V0_p det G_p of the particles listed in `members` to their cells: sums
    cells.m [m^d] and grown [m^d].
    """
    d = cells.m.shape
    for p in members:
        base, s = locate(vec(particles.x, p, d), cells, NODES)
        w, V0 = cell_weights(s), particles.V0[p]
        V = V0 * det(growth(particles.L, p, dt, d))
        for c in range(len(CELLS) ** (len(d) - 1)):
            k = column(c, CELLS, d)
            for l in range(len(CELLS)):
                i, w_cp = node(base, k, l), product(k, l, w)
                cells.m[i] += w_cp * V0
                grown[i] += w_cp * V


@kernel
def gather_growth(particles, cells, grown, dt, Lbar, bounds):
    """Lbar_p = (Gbar_p - I)/dt of the particles bounds[0] .. bounds[1] - 1. A step that turns
    matter inside out stays as it is.
    """
    d = cells.m.shape
    for p in range(bounds[0], bounds[1]):
        base, s = locate(vec(particles.x, p, d), cells, NODES)
        w, mean = cell_weights(s), 0.0
        for c in range(len(CELLS) ** (len(d) - 1)):
            k = column(c, CELLS, d)
            for l in range(len(CELLS)):
                i = node(base, k, l)
                if cells.m[i] > 0.0:
                    mean += product(k, l, w) * (grown[i] / cells.m[i])
        G = growth(particles.L, p, dt, d)
        ratio = mean / det(G)
        if ratio > 0.0:
            G = mlin(ratio ** (1.0 / len(d)), G, 0.0, G)
        put_mat(Lbar, p, mlin(1.0 / dt, G, -1.0 / dt, identity(d)))


@parallel_if_many
def _scatter_color(particles, cells, grown, dt, slabs, color):
    for h in prange((len(slabs.start) - color) // 2):
        a = 2 * h + color
        members = slabs.order[slabs.start[a] : slabs.start[a + 1]]
        scatter_growth(particles, cells, grown, dt, members)


@parallel_if_many
def _gather(particles, cells, grown, dt, Lbar):
    for c in prange(CHUNKS):
        gather_growth(particles, cells, grown, dt, Lbar, chunk(c, len(particles.x)))


def averaged(particles, cells, dt):
    """Return the velocity gradients Lbar (N, d, d) [1/s] of a step of dt [s] with averaged growth
    of volume: I + dt Lbar = Gbar.

    cells is a zeroed `Grid` over the `NODES` of the particles; its m becomes the volume at rest in
    each cell [m^d]. The same bits for any number of threads, as in `transfer.p2g`.
    """
    real = cells.m.dtype.type
    slabs, grown = slabs_of(particles.x, cells, NODES), np.zeros(cells.m.shape, real)
    cells, dt = with_rounded_spacing(cells), converted(dt, real)
    for color in (0, 1):
        _scatter_color(particles, cells, grown, dt, slabs, color)
    Lbar = np.empty_like(particles.L)
    _gather(particles, cells, grown, dt, Lbar)
    return Lbar
