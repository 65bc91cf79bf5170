"""The trained networks of NSF's experiments: their settings, and their stored weights.

Latent coordinates are those of POD modes, in one unit of length: an encoder has to be learned, and
no snapshot tells the map near it, where a reduced run soon is. Here the position is also trained on
snapshots that are displaced along the modes. Each is a file of weights, remade by
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

from ..common.weights_needed import load_weights
from .studies import NsfStudy, ball, bread, cake, jelly, metal, sand, toothpaste

FOLDER = Path(__file__).parent / "weights"
WIDTH = 64                          # of hidden layers
OCTAVES = 3                         # of features
SEEDS = 1, 2                        # other than 0, of the first scene
NARROW = 16, 32                     # of the first scene with features, beside WIDTH
DISPLACED, BLURRED = 0.03, 0.01     # `NetworkPlan.jitter` of the position, and of the other fields


class NetworkPlan(NamedTuple):
    """Settings of one of the three networks."""

    width: int              # of its hidden layers, of which there are DEPTH (NSF-arch)
    epochs: int             # of its training
    jitter: float           # of the latent coordinates at which it is shown snapshots

    @property
    def hidden(self):
        """Widths of the hidden layers."""
        return (self.width,) * DEPTH


class FieldsNet(NamedTuple):
    """Settings of the training of three networks on a study's runs."""

    study: NsfStudy
    g: NetworkPlan                  # position
    h: NetworkPlan                  # stress
    l: NetworkPlan                  # affine field
    batch: int = 16                 # snapshots
    points: int = 32                # shown of each snapshot
    latent: str = "directions"      # of `learn.fit.LATENTS`
    schedule: str = "warm"          # of `learn.schedule`
    seed: int = 0
    octaves: int = 0                # of the Fourier features that h and l read


def nets():
    """Return {name: `FieldsNet`} of all scenes, whose names begin with the scene's; "-waves" with
    features in h and l.
    """
    plain = {"jelly": wide(jelly(), 3500, 3000, 1500), "metal": wide(metal(2), 1500, 1200, 500)}
    others = {"ball": wide(ball(2), 5000, 4500, 2000), "bread": wide(bread(2), 3300, 3300, 1200),
              "cake": wide(cake(2), 5500, 5000, 2000), "sand": wide(sand(2), 1100, 1000, 400),
              "toothpaste": wide(toothpaste(2), 1800, 1800, 700)}
    return (plain
            | {f"{name}-waves": net._replace(octaves=OCTAVES)
               for name, net in (plain | others).items()}
            | {f"jelly-seed-{seed}": plain["jelly"]._replace(seed=seed) for seed in SEEDS})


def wide(study, g, h, l):
    """Return the `FieldsNet` of a study, given the epochs of each network."""
    return FieldsNet(study, NetworkPlan(WIDTH, g, DISPLACED), NetworkPlan(WIDTH, h, BLURRED),
                     NetworkPlan(WIDTH, l, BLURRED))


def narrow():
    """Return {name: `FieldsNet`} of the jelly cube with features and NARROW widths, trained for as
    long.
    """
    waves = nets()["jelly-waves"]
    return {f"jelly-waves-{width}": waves._replace(**{
        name: getattr(waves, name)._replace(width=width) for name in "ghl"}) for width in NARROW}


def net_of(name):
    """Return the `FieldsNet` of a name, of `nets` or `narrow`. Raises KeyError for another."""
    return nets().get(name) or narrow()[name]


@cache
def trained(name):
    """Return the `Model` of a scene. Raises `Untrained` where it is missing, ValueError where it
    is damaged, or of another training or other scenes than `net_of` says now.
    """
    return load_weights(FOLDER / f"{name}.npz", identity(net_of(name)), load,
                        f"python -m validation.training.nsf {name}")


def identity(net):
    """Return the plain values that identify a training: its scenes and its settings."""
    texts = "".join(canonical(net.study.run(value)) for value in net.study.train)
    parts = {name: dict(getattr(net, name)._asdict()) for name in "ghl"}
    return {"scenes": hashlib.sha256(texts.encode()).hexdigest()[:16], "r": net.study.sizes.r,
            "follows": net.study.follows, "spacing": net.study.spacing, **parts,
            **{name: getattr(net, name) for name in FieldsNet._fields
               if name not in ("study", "octaves", *"ghl")},
            **({"octaves": net.octaves} if net.octaves else {})}


def fields_of(model, study):
    """Return the `LearnedFields` of a `Model` in the first run of a study."""
    one = nsf_full_model(study.run(study.train[0]))
    mu = [study.train[0]] if study.follows else []
    return learned_fields(one.X, model.field, mu, BLOCK * one.problem.dx)
