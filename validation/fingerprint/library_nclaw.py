"""Calls of mpm_ref's learned laws, for `laws`; see `library`."""

from itertools import islice

import numpy as np

from mpm_ref.body import restore_order
from mpm_ref.materials.learned import weights
from mpm_ref.nclaw import batched_step
from mpm_ref.nclaw.bodies import body_maker
from mpm_ref.nclaw.dissipation import balance, loops
from mpm_ref.nclaw.gnn import weights as gnn_weights
from mpm_ref.nclaw.gnn.features import box_of
from mpm_ref.nclaw.paths import cycles, path_response
from mpm_ref.nclaw.study.compare import positions

from .library import ROOT, problem, state_of

WEIGHTS = ROOT / "validation" / "nclaw" / "weights"


def material(name):
    """Return the function that gives a body the stored laws of a name."""
    return body_maker(weights.load(WEIGHTS / f"{name}.npz"))


def of_law(name, scene_name, frames):
    """Return positions and the last state of a scene's run by a stored law."""
    world = problem(scene_name)
    bodies = tuple(map(material(name), world.bodies))
    x = np.array(list(islice(positions(world, bodies), frames + 1)))
    return {"x": x} | state_of(bodies)


def by_scene(name, scene_name):
    """Return the problem of a scene whose first body names stored weights as its material."""
    return problem(scene_name, {"body[0].material": {
        "law": "neural", "weights": str(WEIGHTS / f"{name}.npz")}})


def of_graph(name, scene_name, frames):
    """Return the positions that a stored graph network gives for a scene's start."""
    world, simulator = problem(scene_name), gnn_weights.load(WEIGHTS / f"{name}.npz")
    _, particles, _, _, number = world.bodies[0]
    x, v = (restore_order(a, number) for a in particles[:2])
    run = simulator.run(x, v, box_of(world.conditions.walls, world.dx))
    return {"x": np.array(list(islice(run, frames + 1)))}


def of_paths(name, scene_name, steps):
    """Return stresses of a stored law along prescribed deformations, and the energy it takes."""
    _, _, law, flow, _ = material(name)(problem(scene_name).bodies[0])
    paths = [tuple(path_response(law, flow, path, 5e-4)) for path in cycles(3, 0.1, steps)]
    G = loops(20, 0.1, steps, np.random.default_rng(0))
    return {"paths": paths, "balance": tuple(balance(law, flow, G))}


def of_batches(scene_name, bodies, steps):
    """Return the states of bodies of one batch, and gradients of the last step."""
    full = problem(scene_name)
    world = batched_step.make_world(full)
    _, q, *_ = full.bodies[0]
    rng = np.random.default_rng(0)
    start = (q.x, q.v, q.C, np.tile(np.eye(3), (len(q.x), 1, 1)))
    x, v, C, F = (np.stack([a] * bodies) for a in start)
    v = v * np.linspace(0.8, 1.2, bodies)[:, None, None]
    storage = batched_step.make_nodes(world, bodies)
    after = batched_step.States(x, v, C, F)
    for _ in range(steps):
        tau = 1e3 * rng.normal(size=F.shape)
        before = after._replace(tau=tau + tau.swapaxes(-1, -2))
        after = batched_step.advance(world, before, storage)
    bars = batched_step.States(*after[:4])
    gradients = batched_step.pull_back(world, before, after, bars, storage)
    return {"states": tuple(after[:4]), "gradients": tuple(gradients)}
