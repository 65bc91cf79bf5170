"""Slow modes of HOT's multigrid: those of nodes that hardly touch matter.

The V-cycle M of a small bar, its coarsest level solved directly, is written out as a matrix, and
the eigenvalues of M H are counted: each is the share of its mode that one cycle removes. Few nodes
at the rim, with a particle or two near them, form modes in which no particle is strained: they have
mass alone, their diagonal blocks say stiffness, and sweeps hardly move them. Their part in the
error where a solve ends shows their effect on the particles.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky, eigh, solve_triangular

from mpm_ref.hot.multigrid.hierarchy import hierarchy

from ..common.registry import experiment
from .one_step import ImplicitStep, difference, solve_step, step_after
from .stiffness import bar

DX, E, STEPS = 0.04, 1e9, 3         # of the bar and its middle
LIGHT = 0.1                         # of the median mass of a node
SLOW = 0.02                         # share that a cycle removes, at most
PAPER, EXACT = 1e-7, 1e-13


class CycleModes(NamedTuple):
    """Eigenvectors of M H, orthogonal in energy."""

    share: np.ndarray       # (k,)    removed by a cycle, ascending
    u: np.ndarray           # (n d, k)  of unit energy [m/s / sqrt(J)]
    dual: np.ndarray        # (n d, k)  H u: what measures their part in an error


def cycle_modes(H, index, **choices):
    """Return the `CycleModes` of a V-cycle on a matrix H whose rows of held directions are zero."""
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
    return CycleModes(share, u, dual)


def modal_part(modes, chosen, e):
    """Return the part (n, d) of an error e (n, d) in chosen modes, and its share of the energy."""
    c = modes.dual.T @ e.reshape(-1)
    return (modes.u[:, chosen] @ c[chosen]).reshape(e.shape), float(c[chosen] @ c[chosen] / (c @ c))


def light_share(modes, chosen, m, d):
    """Return the smallest share of |u|^2 that chosen modes have on light nodes."""
    light = np.repeat(m < LIGHT * np.median(m), d)
    squares = modes.u[:, chosen] ** 2
    return float((squares[light].sum(axis=0) / squares.sum(axis=0)).min())


@experiment("hot.light_nodes", title="What HOT's multigrid is slow at: nodes at the rim of matter",
            profiles=("standard",), budget={"standard": 120})
def light_nodes(run):
    """Record the number of slow modes, their place, and their part in HOT's error."""
    step: ImplicitStep = step_after(bar(DX, E, "pn-mgpcg", STEPS, eps=1e-9), STEPS)
    exact = solve_step(step, "pn-mgpcg", eps=EXACT, flexible=True)
    system, m = step.stepper.system(step.pose), step.pose.unknowns.m
    H, d = system.matrix(exact.dv), system.index.shape[1]
    scale = f"{step.particles} particles, {len(m)} nodes, middle {E:.0e} Pa"
    rows = []
    for sweeps in (1, 2):
        modes = cycle_modes(H, system.index, sweeps=sweeps)
        slow = modes.share < SLOW
        run.record(f"hot.light_nodes.sweeps{sweeps}.slow", int(slow.sum()), comparator="info",
                   scale=scale, note=f"modes of {len(slow)} of which a cycle removes less than "
                   f"{SLOW:g}; {int((modes.share < 0.5).sum())} less than a half")
        run.record(f"hot.light_nodes.sweeps{sweeps}.light", light_share(modes, slow, m, d),
                   comparator="info", scale=scale, note="smallest share of a slow mode's squared "
                   f"velocities on nodes below {LIGHT:g} of the median mass")
        rows += [(sweeps, k, s) for k, s in enumerate(modes.share)]
    record_error(run, (step, exact.dv), cycle_modes(H, system.index), scale)
    run.table("shares", ("sweeps", "mode", "share"), rows)


def record_error(run, reference, modes, scale):
    """Record the slow modes' part of HOT's error at the paper's tolerance and a hundredth of it.

    reference: the step and its exact increment.
    """
    step, exact = reference
    for eps in (PAPER, PAPER / 100.0):
        dv = solve_step(step, "hot", eps=eps).dv
        part, energy = modal_part(modes, modes.share < SLOW, dv - exact)
        total, felt = (difference(step, exact + e, exact)[0] for e in (dv - exact, part))
        run.record(f"hot.light_nodes.error.eps{eps:.0e}".replace("e-0", "e-"), energy,
                   comparator="info", scale=scale, note="slow modes' share of the error's energy; "
                   f"particles feel {felt:.1e} of it, of {total:.1e} in all, relative to their "
                   "velocity increment")
