"""Contact of bodies with a velocity field each, at the nodes that two fields or more reach.

Each body fills a share phi of the space around a node, whose gradient G points into the body. The
normal from body 1 to body 2 is along G_2 - G_1. Two flat bodies that touch fill all space; a gap of
width g leaves about g |G_2 - G_1|/2 empty. A step may close the gap, not more: seen from their
common centre of mass, two bodies lose the rest of their approach, and friction slows their sliding
by at most mu times that.

Fields that are glued to each other, directly or through others, move as one. Where more than two
fields reach a node, each pair in turn gives back its impulse and takes the one that the velocities
now ask for, until none changes. Before each round all go on in the direction of the steps before,
by the rule of conjugate gradients [Silcowitz2010].
"""

from itertools import combinations

import numpy as np

from .transfer import sum_to_nodes

LEAST_SLOPE = 1e-3      # of the shares in a cell: below it there is no normal, and nothing acts
CLOSE = 1e-12           # of the largest velocity between two fields: its change in the last sweep
SWEEPS = 500            # at most
ROUNDING = 1e-12        # of the energy: a gain that is none


def volume_share(V, ip, box, dx):
    """Return phi_i = sum_p w_ip V_p/dx^d and its gradient G_i = -sum_p V_p dw_ip/dx^d [1/m].

    V (N,) [m^d] is the volume of the particles as they are; arrays over the `NodeBox` box.
    """
    cells = V / dx ** ip.node.shape[-1]
    return (sum_to_nodes(ip.w * cells[:, None], ip, box),
            sum_to_nodes(-ip.dw * cells[:, None, None], ip, box))


def normal_and_gap(G, empty, dx):
    """Return the normal (d,) from body 1 to body 2 at one node and the width of the gap [m].

    G are the gradients (d,) of both bodies' shares there, empty is the share that no body fills.
    """
    difference = G[1] - G[0]
    slope = np.sqrt(difference @ difference)
    if not slope * dx > LEAST_SLOPE:
        return 0 * difference, 0.0
    return difference / slope, 2 * empty / slope


def velocities_after(m, v, n, gap_speed, mu):
    """Return the velocities of both bodies at one node after contact.

    m and v are their masses [kg] and velocities (d,) [m/s], n the normal from body 1 to body 2,
    gap_speed [m/s] that with which the gap would close in the step, mu the coefficient of friction.
    """
    total = m[0] + m[1]
    mean = (m[0] * v[0] + m[1] * v[1]) / total
    closing = n @ (v[0] - v[1])
    lost = closing - max(gap_speed, 0)
    if not lost > 0:
        return list(v)
    sliding = v[0] - v[1] - closing * n
    speed = np.sqrt(sliding @ sliding)
    kept = 0.0 if speed <= mu * lost else 1 - mu * lost / speed
    relative = (closing - lost) * n + kept * sliding
    return [mean + m[1] / total * relative, mean - m[0] / total * relative]


def touching_velocities(m, v, shares, friction, step):
    """Return the velocities of all fields over their box after contact.

    m, v: masses (..) [kg] and velocities (.., d) [m/s] of the fields over one `NodeBox`; shares:
    (phi, G) of each, see `volume_share`; friction: {(a, b): mu} of the fields a < b that touch, all
    others are glued; step: its length dt [s] and the grid spacing dx [m].
    """
    after = [u.copy() for u in v]
    for node in zip(*np.nonzero(sum(a > 0 for a in m) > 1), strict=True):
        fields = [k for k, a in enumerate(m) if a[node] > 0]
        matter = {k: (m[k][node], v[k][node], shares[k][1][node]) for k in fields}
        empty = 1 - sum(shares[k][0][node] for k in fields)
        for k, u in velocities_of_fields(matter, empty, friction, step).items():
            after[k][node] = u
    return after


def velocities_of_fields(matter, empty, friction, step):
    """Return {field: velocity (d,) after contact} at one node.

    matter is {field: (m, v, G)}; for the others see `touching_velocities` and `normal_and_gap`.
    """
    (dt, dx), groups = step, groups_of(list(matter), friction)
    m = [sum(matter[k][0] for k in group) for group in groups]
    v = [sum(matter[k][0] * matter[k][1] for k in group) / total
         for group, total in zip(groups, m, strict=True)]
    number = {k: i for i, group in enumerate(groups) for k in group}
    pairs = []
    for a, b in sorted(combinations(sorted(matter), 2), key=lambda pair: pair[::-1]):
        if number[a] != number[b]:
            n, gap = normal_and_gap((matter[a][2], matter[b][2]), empty, dx)
            pairs.append(((number[a], number[b]), (n, gap / dt, friction[a, b])))
    u = settled_velocities(m, v, pairs, True)
    if energy_between(m, u) > (1 + ROUNDING) * energy_between(m, v):
        u = settled_velocities(m, v, [(ends, (*terms[:2], 0)) for ends, terms in pairs], False)
    return {k: u[number[k]] for k in matter}


def groups_of(fields, friction):
    """Return the fields in lists, those that are glued to each other in one."""
    groups = []
    for k in fields:
        joined = [group for group in groups if any((j, k) not in friction for j in group)]
        groups = [group for group in groups if group not in joined]
        groups.append([j for group in joined for j in group] + [k])
    return groups


def settled_velocities(m, v, pairs, goes_on):
    """Return the velocities (d,) of groups of masses m and velocities v after all contacts: pairs
    are ((a, b), (n, gap_speed, mu)) of the groups a and b, see `velocities_after`; goes_on: whether
    there are steps on between rounds.
    """
    u, fastest = list(v), max((length(v[a] - v[b]) for (a, b), _ in pairs), default=0)
    inverse = [1 / m[a] + 1 / m[b] for (a, b), _ in pairs]
    impulse, change, ahead = ([0 * v[0] for _ in pairs] for _ in range(3))
    last = part = 0

    def give(j, dl):
        a, b = pairs[j][0]
        impulse[j], u[a], u[b] = impulse[j] + dl, u[a] - dl / m[a], u[b] + dl / m[b]

    for _ in range(SWEEPS):
        if goes_on:
            for j in range(len(pairs)):
                give(j, part * ahead[j])
                ahead[j] = part * ahead[j] + change[j]
        for j, ((a, b), terms) in enumerate(pairs):
            without = u[a] + impulse[j] / m[a], u[b] - impulse[j] / m[b]
            w, _ = velocities_after((m[a], m[b]), without, *terms)
            change[j] = m[a] * (without[0] - w) - impulse[j]
            give(j, change[j])
        both = list(zip(change, inverse, strict=True))
        if not max((length(dl) * over_m for dl, over_m in both), default=0) > CLOSE * fastest:
            break
        size = sum(dl @ dl * over_m for dl, over_m in both)
        part, last = size / last if size < last else 0, size
    return u


def energy_between(m, v):
    """Return the kinetic energy [J] of masses m with velocities v, seen from their mean one."""
    mean = sum(a * u for a, u in zip(m, v, strict=True)) / sum(m)
    return sum(a * ((u - mean) @ (u - mean)) for a, u in zip(m, v, strict=True)) / 2


def length(x):
    """Return the Euclidean length of a vector."""
    return np.sqrt(x @ x)
