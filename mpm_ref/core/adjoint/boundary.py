"""Adjoint of the conditions: bars of velocities after them become bars of velocities before.

At a node the velocity after is a function u(v) of the one before alone, smooth but for the surfaces
where it passes from one branch to another (see `contact`). The derivative is that of the branch
taken. Shapes, motions and coefficients of friction are data and have no bar:

    held by a prescribed, sticky or noslip part, or squeezed       0
    left as it is                                                  I
    projected on planes with orthonormal basis e_k                 P = I - sum_k e_k e_k^T
    the same with friction                                         see `rub_bar`
"""

from ..boundary import by_node
from ..contact import STICKY, load, nearest, projected, rest, strongest
from ..jit import CHUNKS, chunk, kernel, parallel, prange
from ..tensor import dot, fill, identity, lin, norm, put_vec, vec


@kernel
def meet_bar(contacts, pairs, v, bar):
    """(du/dv)^T bar of u = `meet`(v)."""
    zero = fill(0.0, v)
    if strongest(contacts, pairs, v) <= STICKY:
        return zero
    found, planes = nearest(contacts, pairs, v)
    if not found:
        return zero
    u, basis, _ = projected(contacts, planes, v)
    of_u, of_change = rub_bar(contacts, planes, (u, v), basis, bar)
    return lin(1.0, rest(of_u, basis), -1.0, of_change)


@kernel
def rub_bar(contacts, planes, velocities, basis, bar):
    """Bars of u and of the change u - v from that of u - lost t, see `contact.rub`:

    t = rest(u - drift/grip),   lost = grip/|t|, or 1 where the node sticks
    grip = sum_k mu_k |l_k|,   drift = sum_k mu_k |l_k| v_k,   l_k = load of the change on plane k
    """
    u, v = velocities
    change = lin(1.0, u, -1.0, v)
    grip, drift = grips(contacts, planes, change)
    of_change = fill(0.0, v)
    if grip == 0.0:
        return bar, of_change
    t = rest(lin(1.0, u, -1.0 / grip, drift), basis)
    of_t, of_grip = slide_bar(t, grip, bar)
    of_t = rest(of_t, basis)
    of_grip += dot(of_t, drift) / grip**2
    for k in planes:
        if k >= 0:
            l, mu = load(contacts, k, planes, change), contacts.mu[contacts.part[k]]
            of_l = mu * (of_grip - dot(of_t, vec(contacts.v, k, v)) / grip)
            of_l = of_l if l > 0.0 else -of_l
            of_change = lin(1.0, of_change, of_l, loading(contacts, k, planes, v))
    return lin(1.0, bar, 1.0, of_t), of_change


@kernel
def grips(contacts, planes, change):
    """Grip and drift of the planes that bear a change."""
    grip, drift = 0.0, fill(0.0, change)
    for k in planes:
        if k >= 0:
            w = contacts.mu[contacts.part[k]] * abs(load(contacts, k, planes, change))
            grip, drift = grip + w, lin(1.0, drift, w, vec(contacts.v, k, change))
    return grip, drift


@kernel
def slide_bar(t, grip, bar):
    """Bars of t and grip from that of -lost t."""
    size = norm(t)
    if not grip < size:
        return lin(-1.0, bar, 0.0, bar), 0.0
    along = dot(t, bar) / size
    of_t = lin(-grip / size, bar, grip * along / size**2, t)
    return of_t, -along


@kernel
def loading(contacts, k, planes, like):
    """The vector q with l_k = q . change: the loads of the unit vectors."""
    e = identity(like)
    if len(like) == 2:
        return load(contacts, k, planes, e[0]), load(contacts, k, planes, e[1])
    else:
        return (load(contacts, k, planes, e[0]), load(contacts, k, planes, e[1]),
                load(contacts, k, planes, e[2]))


@kernel
def settle_bars(contacts, start, v, bars, like, bounds):
    """Bars of the nodes bounds[0] .. bounds[1] - 1 of those in contact, in place."""
    for a in range(bounds[0], bounds[1]):
        i, pairs = contacts.node[start[a]], (start[a], start[a + 1])
        put_vec(bars, i, meet_bar(contacts, pairs, vec(v, i, like), vec(bars, i, like)))


@parallel
def _settle_all(contacts, start, v, bars, like):
    for c in prange(CHUNKS):
        settle_bars(contacts, start, v, bars, like, chunk(c, len(start) - 1))


def solve_adjoint(touched, grid, bars):
    """Change bars.v from that of the velocities after the conditions to that of those before.

    touched is what `Conditions.touched` found for the grid; grid.v holds the velocities before.
    """
    d = grid.m.ndim
    if not touched[0]:
        return
    contacts, start = by_node(*touched)
    if len(contacts.node):
        v, flat = grid.v.reshape(-1, d), bars.v.reshape(-1, d)
        _settle_all(contacts, start, v, flat, grid.m.shape)
