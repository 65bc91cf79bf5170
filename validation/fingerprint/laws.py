"""Runs by learned laws of each kind, with stored weights."""

from functools import partial

from . import library_nclaw as nclaw
from .library import simulated
from .recording import RunCase

FRAMES = 3          # of 5 steps each
LAWS = {            # weights: environment
    "jelly": "jelly", "jelly-labeled": "jelly", "jelly-admissible": "jelly",
    "jelly-neural": "jelly", "jelly-spline": "jelly", "jelly-spline-released": "jelly",
    "sand-neural-released": "sand", "jelly-sys-id": "jelly", "plasticine": "plasticine",
    "plasticine-admissible": "plasticine", "plasticine-no-rotation": "plasticine",
    "plasticine-sys-id": "plasticine", "sand": "sand", "sand-admissible": "sand",
    "sand-sys-id": "sand", "water": "water", "water-admissible": "water", "water-sys-id": "water",
}
BY_SCENE = {"jelly": "jelly", "plasticine-admissible": "plasticine"}
GRAPHS = {"jelly-gnn": "jelly", "water-gnn-10": "water"}
PATHS = {"plasticine": "plasticine", "plasticine-admissible": "plasticine", "jelly-spline": "jelly"}
SCENE = "nclaw_{}".format


def cases():
    """Return a `RunCase` of each kind of learned law."""
    runs = [RunCase(f"law {name}", partial(nclaw.of_law, name, SCENE(environment), FRAMES))
             for name, environment in LAWS.items()]
    runs += [RunCase(f"law of a scene {name}", partial(by_scene, name, SCENE(environment)))
              for name, environment in BY_SCENE.items()]
    runs += [RunCase(f"law graph {name}", partial(nclaw.of_graph, name, SCENE(environment), 2))
              for name, environment in GRAPHS.items()]
    runs += [RunCase(f"law paths {name}", partial(nclaw.of_paths, name, SCENE(environment), 10))
              for name, environment in PATHS.items()]
    runs.append(RunCase("law batched steps", partial(nclaw.of_batches, SCENE("jelly"), 3, 10)))
    return runs


def by_scene(name, scene):
    """Return the state after a run of a scene whose material is a file of weights."""
    return simulated(nclaw.by_scene(name, scene), 10)
