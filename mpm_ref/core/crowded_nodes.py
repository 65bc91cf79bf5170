"""Contact at nodes that three velocity fields or more share, where impulses act on each other.

Fields that are glued to each other, directly or through others, are a group: they have its mass M
and its mean velocity. Two bodies 1 and 2 of different groups A and B have the law of `body_contact`
with an impulse l between these groups. All laws hold at once, by projected Gauss-Seidel sweeps over
the pairs of a node in the order of their fields:

    l <- P(l + m (v_A - v_B)),      1/m = 1/M_A + 1/M_B

P takes m max(g, 0)/dt from the normal part, leaves nothing where the rest is negative, and a
tangential part of at most mu times the rest. Space that a third body fills is no gap:

    g = 2 (1 - sum_k phi_k)/|G_2 - G_1|,    over all bodies k of the node

Near-parallel normals and light fields between heavy ones let sweeps converge slowly. So each one is
preceded by a step on, along the direction of the steps before, with its length and its restarts by
the rule of conjugate gradients [Silcowitz2010]. Sweeps end where none would change a velocity
between two groups by more than CLOSE of the largest one before contact, and after SWEEPS at the
latest; large friction can make them go in circles. Impulses are opposite and act at one point:
momentum and its moment are exact at any sweep. Without friction no number of sweeps alone adds
energy: each lowers the energy plus sum (n . l) max(g, 0)/dt, whose second part begins with 0 and is
never negative. Otherwise that is sure of the solution only: a node that has gained energy after the
last sweep is solved without friction, by sweeps alone. With friction solutions need not be unique.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from .body_contact import Shared, impulse, normal_and_gap, shared_nodes
from .jit import CHUNKS, chunk, kernel, parallel_if_many, prange
from .mass_nodes import in_order_of_space
from .tensor import dot, fill, lin, norm, put_vec, vec

CLOSE = 1e-12       # of the largest velocity between groups: its change in the last sweep
SWEEPS = 500        # at most
ROUNDING = 1e-12    # of the energy: a gain that is none


class Crowd(NamedTuple):
    """Nodes that three grids or more share, with an entry for each field at each node."""

    start: np.ndarray       # (K + 1,)  entries of node k are start[k] .. start[k + 1] - 1
    field: np.ndarray       # (E,)      number of the field, ascending at each node
    node: np.ndarray        # (E,)      index in the flattened arrays of its grid


class FieldRules(NamedTuple):
    """The rule between each two of F fields."""

    glued: np.ndarray       # (F, F)    whether they share their velocities
    mu: np.ndarray          # (F, F)    coefficient of friction of those that do not


class CrowdState(NamedTuple):
    """The fields at the nodes of a `Crowd`, by entry."""

    m: np.ndarray           # (E,)      mass [kg]
    v: np.ndarray           # (E, d)    velocity before contact, that of the group [m/s]
    u: np.ndarray           # (E, d)    velocity after contact, at the first entry of a group [m/s]
    phi: np.ndarray         # (E,)      share of space, and its gradient; see `VolumeShare`
    G: np.ndarray           # (E, d)
    group: np.ndarray       # (E,)      first entry of the group
    M: np.ndarray           # (E,)      mass of the group [kg]


class CrowdPairs(NamedTuple):
    """Each two fields at the nodes of a `Crowd`."""

    start: np.ndarray       # (K + 1,)  pairs of node k are start[k] .. start[k + 1] - 1
    first: np.ndarray       # (P,)      first entry of the group of each
    second: np.ndarray      # (P,)
    n: np.ndarray           # (P, d)    normal
    gap: np.ndarray         # (P,)      width of the gap [m]
    mu: np.ndarray          # (P,)      coefficient of friction
    l: np.ndarray           # (P, d)    impulse on the second group [kg m/s]
    dl: np.ndarray          # (P, d)    its change by the last sweep
    ahead: np.ndarray       # (P, d)    direction of the steps between sweeps


# which nodes

def meetings(grids):
    """Return the nodes that grids share: {(a, b): `Shared`} of those that the grids a < b share
    with each other alone, and the `Crowd` of the others.
    """
    pairs = {}
    for a, b in combinations(range(len(grids)), 2):
        nodes = shared_nodes(grids[a], grids[b])
        if len(nodes.first):
            pairs[a, b] = nodes
    crowded = [crowded_nodes(field, pairs) for field in range(len(grids))]
    crowd = crowd_of(grids, crowded)
    if len(crowd.node):
        rest = {(a, b): without(nodes, crowded[a]) for (a, b), nodes in pairs.items()}
        pairs = {pair: nodes for pair, nodes in rest.items() if len(nodes.first)}
    return pairs, crowd


def crowded_nodes(field, pairs):
    """Return the nodes of a field that more than one of the pairs has, {(a, b): `Shared`}."""
    lists = [nodes[pair.index(field)] for pair, nodes in pairs.items() if field in pair]
    if len(lists) < 2:
        return np.empty(0, dtype=np.int64)
    nodes, count = np.unique(np.concatenate(lists), return_counts=True)
    return nodes[count > 1]


def without(nodes, crowded):
    """Return `Shared` nodes without those whose index in the first grid is one of `crowded`."""
    rest = ~np.isin(nodes.first, crowded, assume_unique=True)
    return Shared(nodes.first[rest], nodes.second[rest])


def crowd_of(grids, crowded):
    """Return the `Crowd` of the nodes of each grid, a list of indices in its flattened arrays."""
    index = [np.stack(np.unravel_index(nodes, grid.m.shape), axis=-1) + grid.origin
             for grid, nodes in zip(grids, crowded, strict=True)]
    field = np.repeat(np.arange(len(grids)), [len(nodes) for nodes in crowded])
    index, node = np.concatenate(index), np.concatenate(crowded)
    order = in_order_of_space(index)
    index = index[order]
    changes = np.flatnonzero((index[1:] != index[:-1]).any(axis=1)) + 1
    start = np.concatenate(([0], changes, [len(index)])) if len(index) else np.zeros(1, np.int64)
    return Crowd(start, field[order], node[order])


# contact at them

def settle_crowd(grids, crowd, shares, rules, dt):
    """Change the velocities of grids at the nodes of a `Crowd` by the `FieldRules` of their fields,
    in a step of dt [s]; those before forces, too, of fields that are glued.

    shares is {field: `VolumeShare`} near these nodes, of the fields that are not glued to all
    others.
    """
    state, _ = crowd_solution(grids, crowd, shares, rules, dt)
    put_rows(grids, crowd, "v", state.u[state.group])
    if grids[0].v_old.ndim > 1:
        v_old = rows_of(grids, crowd, "v_old")
        average(state, v_old, tuple(range(grids[0].m.ndim)))
        put_rows(grids, crowd, "v_old", v_old)


def crowd_solution(grids, crowd, shares, rules, dt):
    """Return `CrowdState` and `CrowdPairs` after contact; see `settle_crowd`."""
    d = grids[0].m.ndim
    like = tuple(range(d))
    state, pairs = state_of(grids, crowd, shares), empty_pairs(crowd, d)
    group_fields(crowd, rules.glued, state)
    average(state, state.v, like)
    state.u[:] = state.v
    form_pairs(crowd, rules, state, pairs, grids[0].dx, like)
    _settle_all(crowd, state, pairs, dt, like)
    return state, pairs


def state_of(grids, crowd, shares):
    """Return the `CrowdState` of grids before contact, without groups."""
    E, d = len(crowd.node), grids[0].m.ndim
    phi, G = np.zeros(E), np.zeros((E, d))
    for field, share in shares.items():
        rows = np.flatnonzero(crowd.field == field)
        k = share.slot.reshape(-1)[crowd.node[rows]]
        phi[rows], G[rows] = share.phi[k], share.G[k]
    return CrowdState(rows_of(grids, crowd, "m"), rows_of(grids, crowd, "v"), np.empty((E, d)), phi,
                      G, np.empty(E, np.int64), np.empty(E))


def rows_of(grids, crowd, name):
    """Return the values of an array of the grids, by its name, at the entries of a `Crowd`."""
    flat = [flat_rows(grid, name) for grid in grids]
    rows = np.empty((len(crowd.node), *flat[0].shape[1:]))
    for field, values in enumerate(flat):
        entries = crowd.field == field
        rows[entries] = values[crowd.node[entries]]
    return rows


def put_rows(grids, crowd, name, rows):
    """Set the values of an array of the grids, by its name, at the entries of a `Crowd`."""
    for field, grid in enumerate(grids):
        entries = crowd.field == field
        flat_rows(grid, name)[crowd.node[entries]] = rows[entries]


def flat_rows(grid, name):
    """Return a view of an array of a grid, by its name, with one axis for all nodes."""
    values, d = getattr(grid, name), grid.m.ndim
    return values.reshape(-1, *values.shape[d:])


def empty_pairs(crowd, d):
    """Return `CrowdPairs` in d dimensions without impulses."""
    size = np.diff(crowd.start)
    start = np.concatenate(([0], np.cumsum(size * (size - 1) // 2)))
    P = start[-1]
    first, second = np.zeros(P, np.int64), np.zeros(P, np.int64)
    n, l, dl, ahead = np.zeros((4, P, d))
    return CrowdPairs(start, first, second, n, np.zeros(P), np.zeros(P), l, dl, ahead)


@kernel
def group_fields(crowd, glued, state):
    """Number the groups by their first entries, and sum their masses."""
    for k in range(len(crowd.start) - 1):
        first, last = crowd.start[k], crowd.start[k + 1]
        for j in range(first, last):
            state.group[j], state.M[j] = j, 0.0
            for i in range(first, j):
                a, b = state.group[i], state.group[j]
                if a != b and glued[crowd.field[i], crowd.field[j]]:
                    for c in range(first, j + 1):
                        if state.group[c] == max(a, b):
                            state.group[c] = min(a, b)
        for i in range(first, last):
            state.M[state.group[i]] += state.m[i]


@kernel
def average(state, v, like):
    """Give all entries of v (E, d) the mean of their group. A group of one keeps its bits."""
    for i in range(len(v)):
        a = state.group[i]      # <= i
        part = lin(state.m[i] / state.M[a], vec(v, i, like), 0.0, vec(v, i, like))
        put_vec(v, a, part if a == i else lin(1.0, vec(v, a, like), 1.0, part))
    for i in range(len(v)):
        put_vec(v, i, vec(v, state.group[i], like))


@kernel
def form_pairs(crowd, rules, state, pairs, dx, like):
    """Normals, gaps, frictions and groups of the pairs of all nodes."""
    for k in range(len(crowd.start) - 1):
        empty, p = 1.0, pairs.start[k]
        for i in range(crowd.start[k], crowd.start[k + 1]):
            empty -= state.phi[i]
        for j in range(crowd.start[k], crowd.start[k + 1]):
            for i in range(crowd.start[k], j):
                n, gap = normal_and_gap(vec(state.G, i, like), vec(state.G, j, like), empty, dx)
                put_vec(pairs.n, p, n)
                pairs.first[p], pairs.second[p] = state.group[i], state.group[j]
                pairs.gap[p], pairs.mu[p] = gap, rules.mu[crowd.field[i], crowd.field[j]]
                p += 1


@kernel
def settle_crowded(crowd, state, pairs, dt, like, bounds):
    """Velocities after contact at the nodes bounds[0] .. bounds[1] - 1 of a crowd."""
    for k in range(bounds[0], bounds[1]):
        entries = crowd.start[k], crowd.start[k + 1]
        ends = pairs.start[k], pairs.start[k + 1]
        solve(state, pairs, ends, (dt, True), like)
        before = energy_between(state, state.v, entries, like)
        if energy_between(state, state.u, entries, like) > (1.0 + ROUNDING) * before:
            for i in range(entries[0], entries[1]):
                put_vec(state.u, i, vec(state.v, i, like))
            for p in range(ends[0], ends[1]):
                pairs.mu[p] = 0.0
                put_vec(pairs.l, p, fill(0.0, like))
            solve(state, pairs, ends, (dt, False), like)


@kernel
def solve(state, pairs, bounds, step, like):
    """Find the impulses of the pairs bounds[0] .. bounds[1] - 1 of a node; step is the length of
    the time step [s], and whether there are steps on between sweeps.
    """
    fastest, last, part, (dt, goes_on) = 0.0, 0.0, 0.0, step
    for p in range(bounds[0], bounds[1]):
        fastest = max(fastest, norm(between(state, pairs, p, like)))
    for _ in range(SWEEPS):
        if goes_on:
            step_on(state, pairs, bounds, part, like)
        change, size = sweep(state, pairs, bounds, dt, like)
        if not change > CLOSE * fastest:
            return
        part = size / last if size < last else 0.0
        last = size


@kernel
def between(state, pairs, p, like):
    """Velocity of the first group of pair p less that of the second [m/s]."""
    return lin(1.0, vec(state.u, pairs.first[p], like),
               -1.0, vec(state.u, pairs.second[p], like))


@kernel
def mass_between(state, pairs, p):
    """Mass m of pair p, 1/m = 1/M_A + 1/M_B [kg]."""
    M1, M2 = state.M[pairs.first[p]], state.M[pairs.second[p]]
    return M1 * M2 / (M1 + M2)


@kernel
def give(state, pairs, p, dl, like):
    """Change the impulse of pair p by dl, and the velocities of its groups."""
    a, b = pairs.first[p], pairs.second[p]
    put_vec(pairs.l, p, lin(1.0, vec(pairs.l, p, like), 1.0, dl))
    put_vec(state.u, a, lin(1.0, vec(state.u, a, like), -1.0 / state.M[a], dl))
    put_vec(state.u, b, lin(1.0, vec(state.u, b, like), 1.0 / state.M[b], dl))


@kernel
def sweep(state, pairs, bounds, dt, like):
    """Improve the impulses of the pairs bounds[0] .. bounds[1] - 1, and velocities. Return the
    largest change of one between two groups [m/s], and sum |dl|^2/m over the pairs [J].
    """
    change, size = 0.0, 0.0
    for p in range(bounds[0], bounds[1]):
        if pairs.first[p] != pairs.second[p]:
            m, n, l = mass_between(state, pairs, p), vec(pairs.n, p, like), vec(pairs.l, p, like)
            ending = lin(1.0, l, m, between(state, pairs, p, like))
            load = dot(n, ending) - m * max(pairs.gap[p], 0.0) / dt
            dl = lin(1.0, impulse(ending, n, load, pairs.mu[p]), -1.0, l)
            give(state, pairs, p, dl, like)
            put_vec(pairs.dl, p, dl)
            change, size = max(change, norm(dl) / m), size + dot(dl, dl) / m
    return change, size


@kernel
def step_on(state, pairs, bounds, part, like):
    """Go on from a sweep by a part of the direction of the steps before, which the sweep bends."""
    for p in range(bounds[0], bounds[1]):
        ahead = vec(pairs.ahead, p, like)
        give(state, pairs, p, lin(part, ahead, 0.0, ahead), like)
        put_vec(pairs.ahead, p, lin(part, ahead, 1.0, vec(pairs.dl, p, like)))


@kernel
def energy_between(state, v, bounds, like):
    """Kinetic energy [J] of the groups of a node that moves with their mean velocity; its entries
    are bounds[0] .. bounds[1] - 1, and v (E, d) the velocities at the first entry of a group.
    """
    M, mean, energy = 0.0, fill(0.0, like), 0.0
    for i in range(bounds[0], bounds[1]):
        if state.group[i] == i:
            M += state.M[i]
            mean = lin(1.0, mean, state.M[i] / M, lin(1.0, vec(v, i, like), -1.0, mean))
    for i in range(bounds[0], bounds[1]):
        if state.group[i] == i:
            w = lin(1.0, vec(v, i, like), -1.0, mean)
            energy += 0.5 * state.M[i] * dot(w, w)
    return energy


@parallel_if_many
def _settle_all(crowd, state, pairs, dt, like):
    for c in prange(CHUNKS):
        settle_crowded(crowd, state, pairs, dt, like, chunk(c, len(crowd.start) - 1))
