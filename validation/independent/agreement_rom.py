"""The package's reduced steps against second implementations from the papers' equations alone.

Each function builds a small problem, runs it by the package's public interface and by one of the
plain files beside this one from the same data, and returns the largest difference over the largest
number of the package's result.
"""

from itertools import pairwise

import numpy as np

from mpm_ref.materials import FixedCorotated
from mpm_ref.rom import cubature
from mpm_ref.rom.fields.network import Decoder, DecoderUnits
from mpm_ref.rom.fields.perceptron import network
from mpm_ref.rom.fields.pod import modes
from mpm_ref.rom.fields.pod_fields import Sizes, fit_pod_fields
from mpm_ref.rom.latent import Latent, initial, start_state
from mpm_ref.rom.quadrature.eulerian import Eulerian
from mpm_ref.rom.quadrature.lagrangian import lagrangian
from mpm_ref.rom.step import MaterialPoints, ldm_stepper, nsf_stepper
from mpm_ref.rom.study.dataset import simulate_history, simulate_snapshots
from mpm_ref.rom.symmetric import tensor
from mpm_ref.scene import build, loads

from ..common.registry import experiment
from . import (
    cubature_weights,
    evolved_gradient,
    inversion,
    linear_projection,
    nonlinear_projection,
    preimages,
)
from .agreement import difference, record_checks

STEPS, POINTS, FEW = 20, 150, 12        # steps of a run, material points, samples where not all
BAR = f"""
dim = 3
dx = 0.05
dt = 5e-3
steps = {STEPS}
every = 1
gravity = [1.0, -2.0, -10.0]
unstable = "allow"

[[body]]
name = "bar"
density = 1000.0
shape = {{ type = "box", lower = [0.0, 0.0, 0.0], upper = [0.3, 0.1, 0.12] }}
sampling = {{ type = "poisson", count = {POINTS} }}
velocity = {{ linear = [0.1, 0.2, -0.5], angular = [1.0, 0.0, 2.0] }}
"""
PIC = """
material = { law = "fixed_corotated", E = 12500.0, nu = 0.3 }
[scheme]
transfer = "pic"
"""
WALL = """
[[fixed]]
name = "wall"
region = { type = "half_space", point = [0.0, 0.0, 0.0], normal = [1.0, 0.0, 0.0] }
"""
PLASTIC = """
material = { law = "hencky", E = 12500.0, nu = 0.3, flow = { type = "von_mises", tau_y = 400.0 } }
[scheme]
transfer = "apic"
"""
LDM_MODES, EVERY = 4, 4                 # modes of LDM's maps, steps from snapshot to snapshot
NSF_SIZES = Sizes(r=3, modes=6, tau=8, C=8, smoothing=1e-4)
WIDTHS = 9, 8                           # of a decoder's hidden layers
DECODER_DX, DECODER_DT, RHO = 0.1, 2e-3, 1000.0
LOW, HIGH = np.zeros(3), np.array([0.6, 0.3, 0.3])      # corners of a decoder's body [m]
LAW = FixedCorotated(3e3, 4e3)
GRAVITY = np.array([1.0, -2.0, -9.8])
SCALE = f"{POINTS} particles, {STEPS} steps"


def draws(count, seed=0):
    """Return the numbers of `count` of POINTS samples of each step, drawn from a seed."""
    rng = np.random.default_rng(seed)
    return [np.sort(rng.choice(POINTS, count, replace=False)) for _ in range(STEPS)]


def bar_with_modes(text):
    """Return the `Problem` of a bar, its particles at rest, and snapshots x and F of its run."""
    problem = build(loads(BAR + text))
    x, F = simulate_snapshots([build(loads(BAR + text))], np.zeros((1, 1))).flat()
    return problem, problem.bodies[0].particles, x[::EVERY], F[::EVERY]


def linear(count):
    """Return the difference in xhat over a run with so many samples in each step, by PIC in front
    of a wall.
    """
    problem, q, x, F = bar_with_modes(PIC + WALL)
    law, dx, dt = problem.bodies[0].law, problem.dx, problem.clock.dt
    g, samples = modes(q.x, x, F, LDM_MODES), draws(count)
    U, D = linear_projection.pod(q.x, x, F, LDM_MODES)
    sign = np.sign(np.einsum("pdk,pdk->k", U, g.U))
    model = ldm_stepper(g, lagrangian(q.x, q.m, q.V0, dx, 2), law, problem.gravity,
                        conditions=problem.conditions)
    latent = initial(g, q.x, v=q.v)
    states = [latent.xhat]
    for k, chosen in enumerate(samples):
        latent, _ = model.step(latent, chosen, k * dt, dt)
        states.append(latent.xhat)
    body = linear_projection.ModalBody(q.x, q.m, q.V0, U, D, law.mu, law.lam, dx, problem.gravity,
                                       lambda nodes: nodes[:, 0] <= 0.0)
    return difference(sign * linear_projection.run(body, q.v, samples, dt), np.array(states))


def linear_projection_agreement():
    """Return the larger difference of runs with all points and with few as samples."""
    return max(linear(POINTS), linear(FEW))


def decoded_body():
    """Return the points X (n, 3), layers and units of a decoder with random weights, latent
    coordinates and rates (r,), all drawn from a seed.
    """
    rng, r = np.random.default_rng(0), 3
    X = rng.uniform(LOW, HIGH, (POINTS, 3))
    sizes = (3 + r, *WIDTHS, 3)
    layers = [(rng.normal(size=(n, m)) / np.sqrt(n), 0.3 * rng.normal(size=m))
              for n, m in pairwise(sizes)]
    units = LOW, HIGH - LOW, np.array([0.02, -0.03, 0.01]), np.array([0.06, 0.04, 0.05])
    return X, layers, units, rng.uniform(-1.0, 1.0, r), rng.normal(size=r)


def nonlinear_projection_agreement():
    """Return the difference in xhat over a run with few samples on a decoder's map."""
    X, layers, units, xhat, vhat = decoded_body()
    V0 = np.random.default_rng(1).uniform(0.5, 1.5, POINTS) * np.prod(HIGH - LOW) / POINTS
    start, samples = (xhat, vhat, xhat - DECODER_DT * vhat), draws(FEW)
    model = ldm_stepper(Decoder(network(layers), DecoderUnits(*units)),
                        lagrangian(X, RHO * V0, V0, DECODER_DX, 2), LAW, GRAVITY,
                        projection="nonlinear")
    latent, states = Latent(*start), []
    for k, chosen in enumerate(samples):
        latent, _ = model.step(latent, chosen, k * DECODER_DT, DECODER_DT)
        states.append(latent.xhat)
    body = nonlinear_projection.DecodedBody(X, RHO * V0, V0, layers, units, LAW.mu, LAW.lam,
                                            DECODER_DX, GRAVITY)
    return difference(nonlinear_projection.run(body, start, samples, DECODER_DT), np.array(states))


def distance(X):
    """Return the signed distances (n,) of points X (n, 3) from the decoder's body at rest [m]."""
    return np.max(np.maximum(LOW - X, X - HIGH), axis=-1)


def preimages_agreement():
    """Return the largest difference in x, X, F, m and V0 of the quadrature points around a sample
    near a corner of a decoder's body; infinite where other points are inside.
    """
    X, layers, units, xhat, _ = decoded_body()
    sample, seeds = np.array([np.argmin(np.abs(X - 0.05).max(axis=1))]), X[::4]
    quadrature = Eulerian(X, RHO, distance, seeds, DECODER_DX, 2, close=1e-13)
    cloud = quadrature.cloud(Decoder(network(layers), DecoderUnits(*units)), xhat, sample)
    order = np.lexsort(np.rint(cloud.points.x / DECODER_DX * 4).T)
    ours = preimages.quadrature(
        lambda Y: nonlinear_projection.decode(layers, units, Y, xhat),
        (X[sample], seeds, RHO), lambda Y: distance(Y) <= 0.0, DECODER_DX)
    theirs = cloud.points.x, cloud.points.points, cloud.points.F, cloud.m, cloud.V0
    return max(difference(a, b[order]) for a, b in zip(ours, theirs, strict=True))


def inversion_agreement():
    """Return the difference in xhat over a run of NSF with few samples, on fields of a plastic bar
    in free flight.
    """
    run, problem = simulate_history(loads(BAR + PLASTIC), np.zeros(0)), build(loads(BAR + PLASTIC))
    dx, dt, samples = problem.dx, problem.clock.dt, draws(FEW)[0]
    fields, xhat = fit_pod_fields(run, NSF_SIZES, 4.0 * dx)
    model = nsf_stepper(fields, MaterialPoints(run.m, run.V0, run.v[0]), dx, 2, problem.gravity)
    latent = start_state(xhat[0, 0])
    states = [latent.xhat]
    for k in range(STEPS):
        latent, _ = model.step(latent, samples, k * dt, dt)
        states.append(latent.xhat)
    states = np.array(states)
    snapshots = run.x[0], tensor(run.tau[0], 3), run.C[0].reshape(-1, POINTS, 3, 3)
    ours = inversion.run(inversion.fit_fields(run.X, snapshots, NSF_SIZES.r, NSF_SIZES[1:4],
                                              NSF_SIZES.smoothing),
                         (run.m, run.V0, problem.gravity), run.v[0], samples, (dt, dx, STEPS))
    return difference(ours * np.sign((ours * states).sum(axis=0)), states)


def smooth_modes():
    """Return orthonormal modes (n, 3, R) of points, sums of waves drawn from a seed."""
    rng = np.random.default_rng(0)
    X, waves = rng.random((POINTS, 3)), 2.0 * rng.normal(size=(12, 3))
    A = np.stack([np.cos(X @ wave + a) for a in range(3) for wave in waves]).reshape(3, 12, POINTS)
    return np.linalg.qr(A.transpose(2, 0, 1).reshape(-1, 12))[0].reshape(POINTS, 3, 12)


def cubature_weights_agreement():
    """Return the largest difference in weights, their residual, and the residual of points without
    weights, of samples by a greedy search; infinite where other points are chosen.
    """
    U, r, others = smooth_modes(), 4, draws(FEW)[0]
    theirs = cubature.cubature(U, r, np.arange(POINTS), 2 * FEW)
    points = cubature_weights.greedy(U, r, 2 * FEW)
    if not np.array_equal(points, theirs.points):
        return np.inf
    w, misfit = cubature_weights.weights(U, r, points)
    return max(difference(w / w.mean(), theirs.w), difference(misfit, theirs.misfit),
               difference(cubature_weights.equal_weights(U, r, others),
                          cubature.misfit(U, r, others)))


def evolved_gradient_agreement():
    """Return the largest difference in xhat and F over a run with few samples whose quadrature
    points evolve F; infinite where other points are in the quadrature.
    """
    problem, q, x, F = bar_with_modes(PIC)
    law, dx, dt = problem.bodies[0].law, problem.dx, problem.clock.dt
    g, samples = modes(q.x, x, F, LDM_MODES), draws(3)
    model = ldm_stepper(g, lagrangian(q.x, q.m, q.V0, dx, 2), law, problem.gravity,
                        deformation_gradient="evolved")
    latent = initial(g, q.x, v=q.v)
    start, theirs = (latent.xhat, latent.vhat), []
    for k, chosen in enumerate(samples):
        latent, _ = model.step(latent, chosen, k * dt, dt)
        F = np.full((POINTS, 3, 3), np.nan)
        F[latent.gradients.numbers] = latent.gradients.F
        theirs.append((latent.xhat, F))
    body = q.x, q.m, q.V0, law, dx, problem.gravity
    ours = evolved_gradient.run(body, (g.U, g.slope), start, samples, dt)
    xhat, F = (np.array(a) for a in zip(*theirs, strict=True))
    F_ours = np.array([state.F for state in ours])
    if not np.array_equal(np.isnan(F), np.isnan(F_ours)):
        return np.inf
    return max(difference(np.array([state.xhat for state in ours]), xhat),
               difference(np.nan_to_num(F_ours), np.nan_to_num(F)))


ROUND_OFF = 1e-13       # of a step, relative: sums over hundreds of points in another order
LEAST_SQUARES = 1e-7    # of a run: see its notes
MINIMUM = ("either minimiser ends where the sum of squares falls by its round-off alone: "
           "coordinates are known to 1e-10 after a step, and later steps carry these errors on")
CHECKS = {      # name: (agreement, bound, scale, what is compared and how)
    "linear_projection": (
        linear_projection_agreement, STEPS * ROUND_OFF, f"{SCALE}; all or {FEW} samples",
        "xhat of LDM's runs by PIC on POD modes, held at a wall; modes by singular values, dense "
        "weights, least squares"),
    "nonlinear_projection": (
        nonlinear_projection_agreement, LEAST_SQUARES, f"{SCALE}; {FEW} samples",
        "xhat of a run of LDM on a decoder with random weights; complex steps and "
        f"scipy.optimize.least_squares; {MINIMUM}"),
    "preimages": (
        preimages_agreement, 1e-11, "1000 places around a sample",
        "x, X, F, m, V0 of Eulerian points; scipy.optimize.root to 1e-13; exactly the same places "
        "are inside"),
    "inversion": (
        inversion_agreement, LEAST_SQUARES, f"{SCALE}; {FEW} samples",
        "xhat of a run of NSF on modes of a plastic bar; RBFInterpolator and "
        f"scipy.optimize.least_squares; {MINIMUM}, in velocities too, differences of positions"),
    "cubature_weights": (
        cubature_weights_agreement, 1e-12, f"{POINTS} points, 4 x 12 products, at most {2 * FEW}",
        "points of the greedy search, their weights and residual by scipy.optimize.nnls; residual "
        "of points without weights"),
    "evolved_gradient": (
        evolved_gradient_agreement, STEPS * ROUND_OFF, f"{SCALE}; 3 samples",
        "xhat and F of runs of LDM whose quadrature points evolve F, with points that enter"),
}


@experiment("independent.rom", title="Second implementations: reduced steps of LDM and NSF",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 20})
def reduced_steps(run):
    """Record the largest relative difference of each reduced part from its second version."""
    record_checks(run, "independent.rom", CHECKS)
