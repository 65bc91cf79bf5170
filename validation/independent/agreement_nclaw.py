"""The package's learned laws against second implementations from the paper's equations alone.

Each function asks the package and one of the plain files beside this one about the same data, and
returns the largest difference over the largest number of the package's result.
"""

from importlib import import_module
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mpm_ref.constitutive import response, return_map
from mpm_ref.materials.learned.table import learned_flow, learned_law
from mpm_ref.materials.learned.weights import load
from mpm_ref.nclaw.batched_step import make_world
from mpm_ref.nclaw.gnn import weights as graph_weights
from mpm_ref.nclaw.gnn.features import WallBox
from mpm_ref.scene import build, loads
from mpm_ref.tape import Seed, Tape
from mpm_ref.trajectories import observed

from ..common.registry import experiment
from . import graph_step, learned_run, loss_gradient
from . import learned_law as plain_law
from .agreement import difference, record_checks

if TYPE_CHECKING:       # loaded where PyTorch is needed; its source counts as that of the records
    from mpm_ref.nclaw.train import rollout  # noqa: F401

WEIGHTS = Path(__file__).parents[1] / "nclaw" / "weights"
LAWS = "jelly", "sand"
STEPS, GRADIENT_STEPS, FRAMES = 20, 10, 3
GRADIENTS, PER_FIELD = 300, 2       # F of a law; entries of each array whose gradient is compared
DX, DT, GRAVITY, EPS = 0.05, 5e-4, np.array([0.0, -9.8, 0.0]), 1e-7
WALLS, CLIP = (3, 17), (0.118, 0.975)       # nodes; [m], whose lower side the cube reaches
WEIGHTS_BOUND = 1e-5                # of gradients by weights: networks train in single precision
MISSING = "gradients by weights were not compared: PyTorch is not installed"


def stored(name):
    """Return the elastic and the plastic `plain_law.StoredLaw` of a file of weights."""
    return tuple(plain_law.load(WEIGHTS / f"{name}.npz", part) for part in ("elastic", "plastic"))


def functions(elastic, plastic):
    """Return F -> tau and F_trial -> F of two `plain_law.StoredLaw`."""
    return lambda F: plain_law.stress(elastic, F), lambda F: plain_law.returned(plastic, F)


def learned_law_agreement():
    """Return the largest difference in stresses and in what the return maps change, at random F of
    which some are inverted.
    """
    F = np.eye(3) + 0.4 * np.random.default_rng(0).normal(size=(GRADIENTS, 3, 3))
    worst = 0.0
    for name in LAWS:
        laws = load(WEIGHTS / f"{name}.npz")
        law, flow = learned_law(laws.elastic), learned_flow(laws.plastic)
        stress, returned = functions(*stored(name))
        worst = max(worst, difference(stress(F), response(F, law).tau),
                    difference(returned(F) - F, return_map(F, law, flow).F - F))
    return worst


def cube(name, steps):
    """Return the `Problem` of a strained cube of learned material that flies into an edge of the
    box of walls.
    """
    problem = build(loads(f"""
dim = 3
dx = {DX}
dt = {DT}
steps = {steps}
every = 1
gravity = {GRAVITY.tolist()}
scheme = {{ transfer = "mls", mass_eps = {EPS}, gravity_on_empty = true }}
walls = {{ low = {[WALLS[0]] * 3}, high = {[WALLS[1]] * 3}, kind = "separate" }}
clip = {{ lower = {[CLIP[0]] * 3}, upper = {[CLIP[1]] * 3} }}

[[body]]
name = "cube"
density = 1000.0
shape = {{ type = "box", lower = [0.12, 0.12, 0.30], upper = [0.28, 0.28, 0.46] }}
sampling = {{ type = "lattice", counts = [3, 3, 3], faces = true, volume = "shape" }}
velocity = {{ linear = [-3.0, -4.0, 1.0], angular = [4.0, 4.0, 4.0] }}
material = {{ law = "neural", weights = "{WEIGHTS}/{name}.npz", guard = false }}
"""))
    q = problem.bodies[0].particles
    q.F[:] += 0.1 * np.random.default_rng(0).normal(size=q.F.shape)
    return problem


def start_of(problem):
    """Return copies of x, v, C and F at the start, and of m and V0."""
    q = problem.bodies[0].particles
    return tuple(a.copy() for a in (q.x, q.v, q.C, q.F)), (q.m.copy(), q.V0.copy())


def positions(laws, state, sizes, steps):
    """Return the positions (steps, n, 3) [m] after each step of a plain run."""
    grid = learned_run.WalledGrid(DX, DT, GRAVITY, EPS, WALLS, CLIP)
    return np.array([after[0] for after in learned_run.run(laws, state, sizes, grid, steps)[1:]])


def learned_run_agreement():
    """Return the largest difference in displacements over runs of both materials."""
    worst = 0.0
    for name in LAWS:
        problem = cube(name, STEPS)
        state, sizes = start_of(problem)
        x = positions(functions(*stored(name)), state, sizes, STEPS)
        worst = max(worst, difference(x - state[0], observed(problem).x[1:] - state[0]))
    return worst


def target_of(x):
    """Return positions (steps, n, 3) [m] to compare with: a random walk away from x (n, 3)."""
    rng = np.random.default_rng(1)
    return x + 1e-3 * np.cumsum(rng.normal(size=(GRADIENT_STEPS, *x.shape)), axis=0)


def compared(positions_of, arrays, slopes, target):
    """Return the largest difference in the gradients of the loss by some entries of each array.

    positions_of: function of arrays like these -> x (steps, n, 3); slopes: the package's gradients
    by the arrays. Entries are the one of the largest gradient, and others drawn from a seed.
    """
    rng, ends = np.random.default_rng(2), np.cumsum([a.size for a in arrays])

    def run(w):
        parts = np.split(w, ends[:-1])
        return positions_of([p.reshape(a.shape) for p, a in zip(parts, arrays, strict=True)])

    w, worst = np.concatenate([a.ravel() for a in arrays]), 0.0
    for slope, end in zip(slopes, ends, strict=True):
        chosen = np.append(rng.integers(slope.size, size=PER_FIELD - 1), np.abs(slope).argmax())
        ours = loss_gradient.gradient(run, w, target, chosen + end - slope.size)
        worst = max(worst, difference(ours, slope.ravel()[chosen]))
    return worst


def state_gradient_agreement():
    """Return the largest difference in gradients of the position loss by the state at the start,
    from the package's tape, for sand.
    """
    problem = cube("sand", GRADIENT_STEPS)
    state, sizes = start_of(problem)
    target = target_of(state[0])
    stepper, body = problem.stepper(), problem.bodies[0]
    stepper.start(problem.bodies)
    tape, seeds = Tape(stepper, problem.bodies, clip=problem.clip), {}
    for n in range(GRADIENT_STEPS):
        tape.step(n * DT, DT)
        seeds[n + 1] = [Seed(x=2.0 * (body.particles.x - target[n]) / target[n].size)]
    gradient = tape.gradient(seeds).bodies[0]
    laws = functions(*stored("sand"))
    return compared(lambda parts: positions(laws, tuple(parts), sizes, GRADIENT_STEPS),
                    state, [gradient.x, gradient.v, gradient.C, gradient.F], target)


def weight_gradients(name, state, target):
    """Return the package's gradients of the position loss by all layers of both laws."""
    import torch

    neural_laws, observations, rollout = (
        import_module(f"mpm_ref.nclaw.train.{module}")
        for module in ("neural_laws", "observations", "rollout"))
    modules = []
    for law in load(WEIGHTS / f"{name}.npz")[:2]:
        modules.append(neural_laws.NeuralLawModule(law.kind))
        modules[-1].resume(law)
    levels = (np.concatenate([state[0][None], target]),
              *(np.repeat(a[None], len(target) + 1, axis=0) for a in state[1:]))
    rollout.segment_errors(
        rollout.LawPair(*modules), make_world(cube(name, GRADIENT_STEPS)),
        observations.Trajectory(*map(torch.from_numpy, levels)), np.array([0]),
        np.array([GRADIENT_STEPS])).loss.backward()
    return [layer.weight.grad.numpy().T.astype(float) for module in modules
            for layer in module.net.layers]


def loss_gradient_agreement():
    """Return the largest difference in gradients of the position loss by weights of each layer,
    from the package's training, for sand. Needs PyTorch.
    """
    state, sizes = start_of(cube("sand", GRADIENT_STEPS))
    target, laws = target_of(state[0]), stored("sand")

    def positions_of(W):
        layers = [[(a, b) for a, (_, b) in zip(W[k:k + 3], law.layers, strict=True)]
                  for k, law in zip((0, 3), laws, strict=True)]
        pair = (law._replace(layers=own) for law, own in zip(laws, layers, strict=True))
        return positions(functions(*pair), state, sizes, GRADIENT_STEPS)

    return compared(positions_of, [W for law in laws for W, _ in law.layers],
                    weight_gradients("sand", state, target), target)


def two_clouds():
    """Return positions [m] and velocities [m/s] (n, 3) of points in two opposite corners of the
    box, and the places (2, 3) of its walls [m].
    """
    rng, walls = np.random.default_rng(0), np.array([[0.1] * 3, [0.9] * 3])
    corner = rng.uniform(0.02, 0.26, (50, 3))
    return np.concatenate([walls[0] + corner, walls[1] - corner]), rng.normal(size=(100, 3)), walls


def graph_step_agreement():
    """Return the largest difference in accelerations over frames of the graph network of water."""
    path = WEIGHTS / "water-gnn.npz"
    simulator = graph_weights.load(path)
    with np.load(path) as arrays:
        arrays = dict(arrays)
    x, v, walls = two_clouds()
    theirs = np.array([*islice(simulator.run(x, v, WallBox(*walls)), FRAMES + 1)])
    frames = graph_step.straight_flight(x, v, float(arrays["dt"]))
    for _ in range(FRAMES):
        frames = np.concatenate([frames, graph_step.advance(arrays, frames[-6:], walls)[None]])
    return difference(np.diff(frames[-FRAMES - 1:], n=2, axis=0), np.diff(theirs, n=2, axis=0))


CHECKS = {      # name: (agreement, bound, scale, what is compared and how)
    "learned_law": (
        learned_law_agreement, 1e-11, f"{GRADIENTS} F, jelly and sand",
        "stress and change by the return map at F = I + 0.4 normal numbers, some inverted; "
        "eigenvalues of F^T F, which square its condition number"),
    "learned_run": (
        learned_run_agreement, 2e-12, f"27 particles, {STEPS} steps, jelly and sand",
        "displacements of a strained cube that flies into walls and the clip; dense weights; 1e-13 "
        "a step for sums in another order"),
    "loss_gradient.state": (
        state_gradient_agreement, 1e-10, f"27 particles, {GRADIENT_STEPS} steps, sand",
        f"gradients by {PER_FIELD} entries each of x, v, C, F at the start; complex steps against "
        "the tape; 1e-11 a step, since products of slopes of layers add round-off"),
    "graph_step": (
        graph_step_agreement, 1e-11, f"100 points, {FRAMES} frames",
        "accelerations of the graph network; k-d tree, sparse sums of messages; differences of "
        "positions lose four digits"),
}


@experiment("independent.nclaw", title="Second implementations: learned laws of NCLaw",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 20})
def learned_laws(run):
    """Record the largest relative difference of each part of NCLaw from its second version."""
    record_checks(run, "independent.nclaw", CHECKS)
    if find_spec("torch") is None:
        run.note(MISSING)
        return
    run.record("independent.nclaw.loss_gradient", loss_gradient_agreement(), comparator="<=",
               bound=WEIGHTS_BOUND, unit="1", scatter=1.0,
               scale=f"27 particles, {GRADIENT_STEPS} steps, sand",
               note=f"gradients by {PER_FIELD} weights of each layer of both laws; complex steps "
                    "against the training's, whose networks compute in single precision (6e-8)")
