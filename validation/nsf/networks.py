"""The trained networks of NSF's experiments: which there are, how they are made, and where they
stand.

Latent coordinates are those of POD modes, in one unit of length: an encoder has to be learned, and
nothing says what a map is like beside its snapshots, where a reduced run soon is. Here the position
is also trained on snapshots that are moved along the modes. Each is a file of weights, remade by
`python -m validation.training.nsf NAME`.
"""

import hashlib
from functools import cache
from pathlib import Path
from typing import NamedTuple

from mpm_ref.rom.fields.architecture import DEPTH
from mpm_ref.rom.fields.network import learned_fields
from mpm_ref.rom.model_file import load
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.reduce import BLOCK
from mpm_ref.scene.toml import canonical

from ..common.weights_needed import Untrained
from .studies import Study, ball, bread, cake, jelly, metal, sand, toothpaste

FOLDER = Path(__file__).parent / "weights"
WIDTH = 64                          # of hidden layers
OCTAVES = 3                         # of features
SEEDS = 1, 2                        # other than 0, of the first scene
NARROW = 16, 32                     # of the first scene with features, beside WIDTH
DISPLACED, BLURRED = 0.03, 0.01     # `Part.beside` of the position, and of what is not known there


class Part(NamedTuple):
    """One of the three networks."""

    width: int              # of its hidden layers, of which there are DEPTH (NSF-arch)
    epochs: int             # of its training
    beside: float           # how far from the snapshots, in latent coordinates, it is shown them

    @property
    def hidden(self):
        """Widths of the hidden layers."""
        return (self.width,) * DEPTH


class Net(NamedTuple):
    """What is trained: a study's runs, and how."""

    study: Study
    g: Part                         # position
    h: Part                         # stress
    l: Part                         # affine field
    batch: int = 16                 # snapshots
    points: int = 32                # shown of each snapshot
    latent: str = "directions"      # of `learn.fit.LATENTS`
    schedule: str = "warm"          # of `learn.schedule`
    seed: int = 0
    octaves: int = 0                # of the Fourier features that h and l read


def nets():
    """{name: `Net`} of all scenes, whose names begin with the scene's; "-waves" with features in h
    and l.
    """
    plain = {"jelly": wide(jelly(), 3500, 3000, 1500), "metal": wide(metal(2), 1500, 1200, 500)}
    others = {"ball": wide(ball(2), 5000, 4500, 2000), "bread": wide(bread(2), 3300, 3300, 1200),
              "cake": wide(cake(2), 5500, 5000, 2000), "sand": wide(sand(2), 1100, 1000, 400),
              "toothpaste": wide(toothpaste(2), 1800, 1800, 700)}
    return (plain
            | {f"{name}-waves": own._replace(octaves=OCTAVES)
               for name, own in (plain | others).items()}
            | {f"jelly-seed-{seed}": plain["jelly"]._replace(seed=seed) for seed in SEEDS})


def wide(study, g, h, l):
    """`Net` of a study, with so many epochs of each network."""
    return Net(study, Part(WIDTH, g, DISPLACED), Part(WIDTH, h, BLURRED), Part(WIDTH, l, BLURRED))


def narrow():
    """{name: `Net`} of the jelly cube with features and NARROW widths, trained for as long."""
    own = nets()["jelly-waves"]
    return {f"jelly-waves-{width}": own._replace(**{
        name: getattr(own, name)._replace(width=width) for name in "ghl"}) for width in NARROW}


def net_of(name):
    """`Net` of a name, of `nets` or `narrow`. Raises KeyError for another."""
    return nets().get(name) or narrow()[name]


@cache
def trained(name):
    """`Model` of a scene. Raises `Untrained` where it is missing, ValueError where it
    is damaged, or of another training or other scenes than `net_of` says now.
    """
    path, again = FOLDER / f"{name}.npz", f"python -m validation.training.nsf {name}"
    if not path.exists():
        raise Untrained(f"no weights {path.name}: {again}")
    model, now = load(path), identity(net_of(name))
    was = {key: model.about.get(key) for key in now}
    if was != now:
        raise ValueError(f"weights {path.name} are of {was}, now it is {now}: {again}")
    return model


def identity(net):
    """What a training is of: the runs' scenes, and how it is made; plain values."""
    texts = "".join(canonical(net.study.run(value)) for value in net.study.train)
    parts = {name: dict(getattr(net, name)._asdict()) for name in "ghl"}
    return {"scenes": hashlib.sha256(texts.encode()).hexdigest()[:16], "r": net.study.sizes.r,
            "follows": net.study.follows, "spacing": net.study.spacing, **parts,
            **{name: getattr(net, name) for name in Net._fields
               if name not in ("study", "octaves", *"ghl")},
            **({"octaves": net.octaves} if net.octaves else {})}


def fields_of(model, study):
    """`LearnedFields` of a `Model` in the first run of a study."""
    one = nsf_full_model(study.run(study.train[0]))
    mu = [study.train[0]] if study.follows else []
    return learned_fields(one.X, model.field, mu, BLOCK * one.problem.dx)
