"""Scales of round-off: the error of each entry of a stage in a correct code, in units of eps.

A scale is measured. The plain twin computes the stages SAMPLES times in double precision, each time
from inputs that are perturbed at random by up to an ulp; its distances to the plain twin in
extended precision show the effect of rounding, of inputs and of all operations, on each entry.
Errors of first order are proportional to eps, so that the scales serve every precision.

    scale of an entity = ROUNDINGS * its size + SAFETY * root mean square of its distances / eps

Samples may all be rounded in the same way, hence the first term. An entity is a pair, a node, a
particle or an entry of a sum; its size is its Euclidean norm. Tolerances follow in `recording`.
"""

import numpy as np
import scipy.sparse as sp

from ..hot.multigrid.projectors import diagonal_blocks
from ..plain.step import stress
from .schema import LOCATION

EPS = float(np.finfo(np.float64).eps)
SAMPLES = 8
SAFETY = 16.0           # factor of root mean squares, since the samples are few
ROUNDINGS = 4.0         # of an entry itself, that one code makes and another does not
FLOOR = 2.0**-24        # of the median scale of an array: no scale is taken as smaller
SEED = 20310
MATRIX_STEP = 2.0**-36   # perturbation of a matrix, in units of its scales
MATRIX_SAMPLES = 8
SOLVE_FACTOR = 2.0       # factor of root mean squares of samples of solutions


def size(a, first=1):
    """Return the Euclidean norms of an array's entries over all axes from `first` on."""
    return np.sqrt((a * a).sum(axis=tuple(range(first, a.ndim))))


def entity_size(a, location):
    """Return the sizes of the entities of an array, with the location of its `schema.Array`."""
    if location in ("body", "parameters", "step"):
        return abs(a)
    first = 2 if location == "pairs" else 1
    return size(a, first) if a.ndim > first else abs(a)


# perturbed inputs

def perturb(a, rng, sizes, ulps=1.0):
    """Return an array (N, ..) with random errors of up to `ulps` ulps of `sizes` (N,)."""
    if a is None:
        return None
    scale = np.reshape(sizes, (-1,) + (1,) * (a.ndim - 1))
    noise = EPS * ulps * scale * rng.uniform(-1.0, 1.0, a.shape)
    return a + noise.astype(a.dtype)


def perturb_body(q, rng, ulps=1.0):
    """Return a body of the plain twin whose state, masses and volumes have random errors.

    Errors are of up to `ulps` ulps of the size of each particle's entry: zeros stay zero. The
    stress is that of the perturbed state.
    """
    arrays = {name: a for name, a in q._asdict().items() if isinstance(a, np.ndarray)}
    q = q._replace(**{name: perturb(a, rng, size(a[:, None]), ulps)
                      for name, a in arrays.items()})
    return q._replace(tau=stress(q.F, q.y, q))


def perturb_constrained(v, sizes, rng):
    """Return nodal vectors v (.., d), those after the boundary conditions, with random errors.

    Errors are of up to an ulp of `sizes`, {index of a node: size of the inputs of its conditions}.
    A condition takes components away; the remainder is round-off of another size in every code, and
    exactly 0 in some.
    """
    v = v.copy()
    for i, entering in sizes.items():
        v[i] = perturb(v[i], rng, np.full(len(v[i]), entering))
    return v


# scales

def scale(exact, samples, location, count=1):
    """Return the scale of each entity of an array, from its exact values and samples of it.

    `count` is the number of terms of sums over all particles or nodes: another code may add them
    one by one.
    """
    rounding = ROUNDINGS * entity_size(exact, location).astype(float)
    if location in ("body", "parameters", "step"):
        rounding = np.sqrt(count) * rounding
    return rounding + SAFETY * deviation(exact, samples, location)


def deviation(exact, samples, location):
    """Return the root mean squares of the samples' distances to the exact values, over eps."""
    off = [entity_size((a - exact).astype(float), location) / EPS for a in samples]
    return np.sqrt(np.mean(np.square(off), axis=0))


def scales(exact, samples, count=1):
    """Return {key: scale} of all arrays {key: array} of a step, from samples of the same arrays."""
    S = {key: scale(a, [sample[key] for sample in samples], array_location(key), count)
         for key, a in exact.items()}
    return {key: s if array_location(key) == "parameters" else with_floor(s)
            for key, s in S.items()}


def array_location(key):
    """Return the location of the array of a key: "nodes", "particles", .. (see `schema.Array`)."""
    return LOCATION[key.split("/")[-1]]


def with_floor(S):
    """Return scales none of which is below FLOOR times the median of those that are not 0."""
    positive = S[S > 0.0]
    return np.maximum(S, FLOOR * np.median(positive)) if positive.size else S


def median_scale(S):
    """Return the median of the scales that are not 0, or 0 if all are."""
    positive = S[S > 0.0]
    return float(np.median(positive)) if positive.size else 0.0


def with_stress_error(S, volumes):
    """Return scales {key: scale} in which each body's elastic energy has an error of first order.

    At rest the energy is at its minimum, and samples in double precision show an error of second
    order; in single precision that is larger. A stress that is off by its scale changes the energy
    by V0 times that at a strain of 1. `volumes` has the rest volumes (N,) of each body.
    """
    S = dict(S)
    for name, V0 in volumes.items():
        energy = S[f"{name}/energy"].copy()
        energy[1] += (V0 * S[f"{name}/tau"]).sum()
        S[f"{name}/energy"] = energy
    return S


# approximate inverses, which have no plain twin: the matrix and the right-hand side are perturbed

def rms_spread(samples):
    """Return SOLVE_FACTOR times the root mean square, over the first axis, of sizes of entities."""
    return SOLVE_FACTOR * np.sqrt(np.mean([s * s for s in samples], axis=0))


def perturb_matrix(A, B, rng):
    """Return B (A + MATRIX_STEP Z) B, with Z symmetric and its blocks of the size of sqrt(D_i D_j).

    By Cauchy and Schwarz no sum over particles has larger terms.
    """
    n, d = len(B), B.shape[1]
    root = np.sqrt(size(diagonal_blocks(A)))
    row = np.repeat(np.arange(n), np.diff(A.indptr))
    Z = (root[row] * root[A.indices])[:, None, None] * rng.normal(size=(len(row), d, d))
    Z = np.einsum("kab,kbc,kcd->kad", B[row], Z, B[A.indices])
    Z = sp.bsr_array((Z, A.indices, A.indptr), shape=A.shape)
    off = sp.bsr_array(A + MATRIX_STEP / np.sqrt(2.0) * (Z + Z.T), blocksize=(d, d))
    off.sort_indices()
    return off


def solve_scale(solve, system, A, b, S_b):
    """Return the scale (n,) of solve(A, b), for b (n, d) with the scale S_b (n,)."""
    rng, exact = np.random.default_rng(0), solve(A, b)
    changes = []
    for _ in range(MATRIX_SAMPLES):
        db = MATRIX_STEP * S_b[:, None] * system.project(rng.normal(size=b.shape))
        perturbed_solution = solve(perturb_matrix(A, system.unknowns.B, rng), b + db)
        changes.append(size(perturbed_solution - exact) / MATRIX_STEP)
    return size(exact) + rms_spread(changes)
