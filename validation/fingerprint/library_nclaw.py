"""All that the cases need of mpm_ref's learned laws; see `library`."""

from itertools import islice

import numpy as np

from mpm_ref.cases import in_order
from mpm_ref.laws.compare import positions
from mpm_ref.nclaw import apart, weights
from mpm_ref.nclaw.bodies import learned
from mpm_ref.nclaw.dissipation import balance, loops
from mpm_ref.nclaw.gnn import weights as gnn_weights
from mpm_ref.nclaw.gnn.history import box_of
from mpm_ref.nclaw.paths import course, cycles

from .library import ROOT, problem, state_of

WEIGHTS = ROOT / "validation" / "nclaw" / "weights"


def material(name):
    """Return what makes bodies of the stored laws of a name."""
    return learned(weights.load(WEIGHTS / f"{name}.npz"))


def of_law(name, scene_name, frames):
    """Return positions and the last state of a scene's run by a stored law."""
    of = problem(scene_name)
    bodies = tuple(map(material(name), of.bodies))
    x = np.array(list(islice(positions(of, bodies), frames + 1)))
    return {"x": x} | state_of(bodies)


def by_scene(name, scene_name):
    """Return the problem of a scene whose first body names stored weights as its material."""
    return problem(scene_name, {"body[0].material": {
        "law": "neural", "weights": str(WEIGHTS / f"{name}.npz")}})


def of_graph(name, scene_name, frames):
    """Return the positions that a stored graph network gives for a scene's start."""
    of, simulator = problem(scene_name), gnn_weights.load(WEIGHTS / f"{name}.npz")
    _, particles, _, _, number = of.bodies[0]
    x, v = (in_order(a, number) for a in particles[:2])
    run = simulator.run(x, v, box_of(of.conditions.walls, of.dx))
    return {"x": np.array(list(islice(run, frames + 1)))}


def of_paths(name, scene_name, steps):
    """Return stresses of a stored law along prescribed deformations, and the energy it takes."""
    _, _, law, flow, _ = material(name)(problem(scene_name).bodies[0])
    paths = [tuple(course(law, flow, path, 5e-4)) for path in cycles(3, 0.1, steps)]
    G = loops(20, 0.1, steps, np.random.default_rng(0))
    return {"paths": paths, "balance": tuple(balance(law, flow, G))}


def of_batches(scene_name, bodies, steps):
    """Return the states of bodies that are stepped side by side, and gradients of the last step."""
    of = problem(scene_name)
    world = apart.world(of)
    _, q, *_ = of.bodies[0]
    rng = np.random.default_rng(0)
    start = (q.x, q.v, q.C, np.tile(np.eye(3), (len(q.x), 1, 1)))
    x, v, C, F = (np.stack([a] * bodies) for a in start)
    v = v * np.linspace(0.8, 1.2, bodies)[:, None, None]
    storage = apart.nodes(world, bodies)
    after = apart.States(x, v, C, F)
    for _ in range(steps):
        tau = 1e3 * rng.normal(size=F.shape)
        before = after._replace(tau=tau + tau.swapaxes(-1, -2))
        after = apart.advance(world, before, storage)
    bars = apart.States(*after[:4])
    found = apart.pull_back(world, before, after, bars, storage)
    return {"states": tuple(after[:4]), "gradients": tuple(found)}
