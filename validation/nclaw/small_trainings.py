"""Small trainings: what errors cost in particles, grid, epochs, horizon, width, and in what is seen
of the run that is learned from. Each is a few minutes at most.

They learn from an environment's body in fewer points on a coarser grid. Each is a file of weights,
remade by `python -m validation.training.nclaw NAME`.
"""

import hashlib
from functools import cache
from typing import NamedTuple

from mpm_ref.scene import Walls
from mpm_ref.scene.toml import canonical

from ..common.scenes import with_
from ..common.weights_needed import Untrained
from .bundle import load
from .environments import ENVIRONMENTS, environment
from .observation import Seen
from .trained_laws import FOLDER

WALL = 0.1          # distance of the walls from the sides of the unit cube [m]
KEPT = (10, 20, 30, 50, 75, 100, 150, 200, 300)     # epochs


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
    density: float = 1.0        # that the training takes, over the true one
    kept: tuple = ()            # epochs whose laws are kept besides the last
    seen: Seen = Seen()         # what of the run is seen

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
    def taken(self):
        """The scene that a training steps, of the density that it takes."""
        scene = self.scene
        body = scene.body[0]
        return with_(scene, body=(with_(body, density=self.density * body.density),))


OF_EPOCHS = {f"small-{name}-epochs": Small(name, epochs=300, kept=KEPT[:-1])
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
OF_SIGHT = {f"small-{words}": Small(seen=seen) for words, seen in {
    "every-5": Seen(every=5), "every-20": Seen(every=20), "every-100": Seen(every=100),
    "third": Seen(share=1.0 / 3.0), "tenth": Seen(share=0.1),
    "noise-4": Seen(noise=1e-4), "noise-3": Seen(noise=1e-3), "noise-2": Seen(noise=1e-2),
    "positions": Seen(positions=True), "positions-every-5": Seen(positions=True, every=5),
    "positions-third": Seen(positions=True, share=1.0 / 3.0),
    "positions-noise-4": Seen(positions=True, noise=1e-4),
    "positions-noise-3": Seen(positions=True, noise=1e-3)}.items()}
OF_FAULTS = {
    "small-gap-100": Small(seen=Seen(gap=100)), "small-gap-400": Small(seen=Seen(gap=400)),
    "small-outliers-3": Small(seen=Seen(outliers=1e-3)),
    "small-outliers-2": Small(seen=Seen(outliers=1e-2)),
    "small-density-0.5": Small(density=0.5), "small-density-2": Small(density=2.0)}
BASE = "small"
SEEDS = (BASE, "small-seed-1", "small-seed-2")      # that differ by nothing else


def small_nets():
    """{name: `Small`} of all experiments."""
    return {**OF_EPOCHS, **OF_TRAINING, **OF_WIDTH, **OF_SIGHT, **OF_FAULTS}


@cache
def bundled(name):
    """`bundle.Bundle` by name. Raises `Untrained` where it is missing, ValueError where it is
    damaged, or of another training or another scene than `small_nets` says now.
    """
    path, again = FOLDER / f"{name}.npz", f"python -m validation.training.nclaw {name}"
    if not path.exists():
        raise Untrained(f"no weights {path.name}: {again}")
    found, now = load(path), identity(small_nets()[name])
    was = {key: found.about.get(key) for key in now}
    if was != now:
        raise ValueError(f"weights {path.name} are of {was}, now it is {now}: {again}")
    return found


def last(name):
    """`Laws` of the last epoch of a training; errors as of `bundled`, and `Untrained` for one that
    stopped before.
    """
    found, epochs = bundled(name), small_nets()[name].epochs
    if epochs not in found.laws:
        raise Untrained(f"{name} stopped: {found.about['stopped']}")
    return found.laws[epochs]


def identity(net):
    """What a training is of, plain values."""
    text = canonical(net.scene)
    told = {**net._asdict(), "kept": list(net.kept), "seen": net.seen._asdict()}
    return {"scene": hashlib.sha256(text.encode()).hexdigest()[:16], **told}
