"""Small trainings: the errors by particles, grid, epochs, horizon, width, and by the observation of
the run that is learned from. Each takes a few minutes at most.

They learn from an environment's body in fewer points on a coarser grid. Each is a file of weights,
remade by `python -m validation.training.nclaw NAME`.
"""

from functools import cache
from typing import NamedTuple

from mpm_ref.scene import Walls

from ..common.scenes import with_
from ..common.weights_needed import Untrained, load_weights
from .bundle import load
from .environments import ENVIRONMENTS, environment
from .observation import Observation
from .trained_laws import COMMAND, FOLDER, scene_digest

WALL = 0.1          # distance of the walls from the sides of the unit cube [m]
CHECKPOINTS = (10, 20, 30, 50, 75, 100, 150, 200, 300)     # epochs


class Small(NamedTuple):
    """A small training."""

    environment: str = "jelly"
    edge: int = 6               # points along each edge of the cube
    cells: int = 10             # of the grid, along each edge of the unit cube
    epochs: int = 100
    first: int = 25             # horizon of the teacher [steps]
    last: int = 200
    width: int = 64             # of the hidden layers
    seed: int = 0
    density: float = 1.0        # in the training, over the true one
    checkpoints: tuple = ()     # epochs whose laws are stored besides the last
    observation: Observation = Observation()    # of the run

    @property
    def scene(self):
        """The scene of the run that is learned from."""
        scene = environment(self.environment)
        body = scene.body[0]
        sampling = with_(body.sampling, counts=(self.edge,) * 3)
        wall = round(WALL * self.cells)
        walls = Walls(low=(wall + 1,) * 3, high=(self.cells - wall - 1,) * 3, kind="separate")
        return with_(scene, dx=1.0 / self.cells, walls=walls,
                     body=(with_(body, sampling=sampling),))

    @property
    def trained_scene(self):
        """The scene that a training steps, with its density."""
        scene = self.scene
        body = scene.body[0]
        return with_(scene, body=(with_(body, density=self.density * body.density),))


OF_EPOCHS = {f"small-{name}-epochs": Small(name, epochs=300, checkpoints=CHECKPOINTS[:-1])
             for name in ENVIRONMENTS}
OF_TRAINING = {
    "small": Small(),
    "small-seed-1": Small(seed=1), "small-seed-2": Small(seed=2),
    "small-epochs-30": Small(epochs=30),
    "small-horizon-25": Small(last=25), "small-horizon-100": Small(last=100),
    "small-horizon-400": Small(last=400),
    "small-edge-5": Small(edge=5), "small-edge-8": Small(edge=8),
    "small-edge-8-cells-20": Small(edge=8, cells=20),
    "small-full-30": Small(edge=10, cells=20, epochs=30),
    "small-full-60": Small(edge=10, cells=20, epochs=60)}
OF_WIDTH = {f"small-width-{width}": Small(width=width) for width in (4, 8, 16, 32, 128)}
OF_OBSERVATION = {f"small-{word}": Small(observation=observation) for word,
                  observation in {"every-5": Observation(every=5),
                                  "every-20": Observation(every=20),
                                  "every-100": Observation(every=100),
                                  "third": Observation(share=1.0 / 3.0),
                                  "tenth": Observation(share=0.1),
                                  "noise-4": Observation(noise=1e-4),
                                  "noise-3": Observation(noise=1e-3),
                                  "noise-2": Observation(noise=1e-2),
                                  "positions": Observation(positions=True),
                                  "positions-every-5": Observation(positions=True, every=5),
                                  "positions-third": Observation(positions=True, share=1.0 / 3.0),
                                  "positions-noise-4": Observation(positions=True, noise=1e-4),
                                  "positions-noise-3": Observation(positions=True,
                                                                   noise=1e-3)}.items()}
OF_FAULTS = {"small-gap-100": Small(observation=Observation(gap=100)),
             "small-gap-400": Small(observation=Observation(gap=400)),
             "small-outliers-3": Small(observation=Observation(outliers=1e-3)),
             "small-outliers-2": Small(observation=Observation(outliers=1e-2)),
             "small-density-0.5": Small(density=0.5), "small-density-2": Small(density=2.0)}
BASE = "small"
SEEDS = (BASE, "small-seed-1", "small-seed-2")      # that differ by nothing else


def small_nets():
    """Return {name: `Small`} of all experiments."""
    return {**OF_EPOCHS, **OF_TRAINING, **OF_WIDTH, **OF_OBSERVATION, **OF_FAULTS}


@cache
def bundled(name):
    """Return the `bundle.Bundle` of a name. Raises `Untrained` where it is missing, ValueError
    where it is damaged, or of another training or another scene than `small_nets` says now.
    """
    return load_weights(FOLDER / f"{name}.npz", identity(small_nets()[name]), load,
                        f"{COMMAND} {name}")


def last(name):
    """Return the `LearnedLaws` of the last epoch of a training. Raises as `bundled`, and
    `Untrained` for a training that stopped before.
    """
    bundle, epochs = bundled(name), small_nets()[name].epochs
    if epochs not in bundle.laws:
        raise Untrained(f"{name} stopped: {bundle.about['stopped']}")
    return bundle.laws[epochs]


def identity(net):
    """Return the plain values that identify a training, as its file has them."""
    settings = net._asdict()
    stored = {"kept": list(settings.pop("checkpoints")),
              "seen": settings.pop("observation")._asdict()}
    return {"scene": scene_digest(net.scene), **settings, **stored}
