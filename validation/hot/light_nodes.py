"""What HOT's multigrid is slow at: modes of nodes that hardly touch matter.

The V-cycle M of a small bar, its coarsest level solved directly, is written out as a matrix, and
the eigenvalues of M H are counted: each is the share of its mode that one cycle removes. Few nodes
at the rim, with a particle or two in reach, form modes in which no particle is strained: they have
mass alone, their diagonal blocks say stiffness, and sweeps hardly move them. What such modes mean
for the particles is told by their part in the error where a solve ends.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky, eigh, solve_triangular

from mpm_ref.hot.multigrid.hierarchy import hierarchy

from ..common.registry import experiment
from .one_step import Step, after, difference, solved
from .stiffness import bar

DX, E, STEPS = 0.04, 1e9, 3         # of the bar and its middle
LIGHT = 0.1                         # of the median mass of a node
SLOW = 0.02                         # share that a cycle removes, at most
PAPER, EXACT = 1e-7, 1e-13


class Modes(NamedTuple):
    """Eigenvectors of M H, orthogonal in energy."""

    share: np.ndarray       # (k,)    removed by a cycle, ascending
    u: np.ndarray           # (n d, k)  of unit energy [m/s / sqrt(J)]
    dual: np.ndarray        # (n d, k)  H u: what measures their part in an error


def modes(H, index, **choices):
    """`Modes` of a V-cycle on a matrix H whose rows of held directions are zero."""
    n, d = index.shape
    free = np.flatnonzero(H.diagonal() > 0.0)
    A = H.toarray()[np.ix_(free, free)]
    L = cholesky(A, lower=True)
    grids = hierarchy(H, index, coarsest="direct", **choices)
    M = np.stack([grids.cycle(e.reshape(n, d)).reshape(-1)[free]
                  for e in np.eye(n * d)[free]], axis=1)
    S = L.T @ M @ L
    share, V = eigh(0.5 * (S + S.T))
    u, dual = np.zeros((2, n * d, len(free)))
    u[free] = solve_triangular(L.T, V, lower=False)
    dual[free] = L @ V
    return Modes(share, u, dual)


def part(found, which, e):
    """What of an error e (n, d) belongs to some modes (n, d), and its share of the energy."""
    c = found.dual.T @ e.reshape(-1)
    return (found.u[:, which] @ c[which]).reshape(e.shape), float(c[which] @ c[which] / (c @ c))


def on_light(found, which, m, d):
    """Smallest share of |u|^2 that modes have on light nodes."""
    light = np.repeat(m < LIGHT * np.median(m), d)
    squares = found.u[:, which] ** 2
    return float((squares[light].sum(axis=0) / squares.sum(axis=0)).min())


@experiment("hot.light_nodes", title="What HOT's multigrid is slow at: nodes at the rim of matter",
            profiles=("standard",), budget={"standard": 120})
def light_nodes(run):
    """Counts slow modes, says where they live, and what of HOT's error they are."""
    step: Step = after(bar(DX, E, "pn-mgpcg", STEPS, eps=1e-9), STEPS)
    exact = solved(step, "pn-mgpcg", eps=EXACT, flexible=True)
    system, m = step.stepper.system(step.pose), step.pose.unknowns.m
    H, d = system.matrix(exact.dv), system.index.shape[1]
    scale = f"{sum(len(b.id) for b in step.bodies)} particles, {len(m)} nodes, middle {E:.0e} Pa"
    rows = []
    for sweeps in (1, 2):
        found = modes(H, system.index, sweeps=sweeps)
        slow = found.share < SLOW
        run.record(f"hot.light_nodes.sweeps{sweeps}.slow", int(slow.sum()), comparator="info",
                   scale=scale, note=f"modes of {len(slow)} of which a cycle removes less than "
                   f"{SLOW:g}; {int((found.share < 0.5).sum())} less than a half")
        run.record(f"hot.light_nodes.sweeps{sweeps}.light", on_light(found, slow, m, d),
                   comparator="info", scale=scale, note="smallest share of a slow mode's squared "
                   f"velocities on nodes below {LIGHT:g} of the median mass")
        rows += [(sweeps, k, s) for k, s in enumerate(found.share)]
    record_error(run, (step, exact.dv), modes(H, system.index), scale)
    run.table("shares", ("sweeps", "mode", "share"), rows)


def record_error(run, against, found, scale):
    """The slow modes' part of what HOT leaves at the paper's tolerance and at a hundredth of it."""
    step, exact = against
    for eps in (PAPER, PAPER / 100.0):
        dv = solved(step, "hot", eps=eps).dv
        own, energy = part(found, found.share < SLOW, dv - exact)
        whole, felt = (difference(step, exact + e, exact)[0] for e in (dv - exact, own))
        run.record(f"hot.light_nodes.error.eps{eps:.0e}".replace("e-0", "e-"), energy,
                   comparator="info", scale=scale, note="slow modes' share of the error's energy; "
                   f"particles feel {felt:.1e} of it, of {whole:.1e} in all, relative to their "
                   "velocity increment")
