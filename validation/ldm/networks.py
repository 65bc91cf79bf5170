"""The trained maps of LDM's experiments: their settings, and their stored weights.

Where the paper says nothing, what worked in a study of this kind is taken (LDM-X7, LDM-appB): the
loss's weights in the units of the public training code, half a cosine for the learning rate, some
of the points at a time, so many epochs. Each is a file of
weights, remade by `python -m validation.training.ldm NAME`.
"""

import hashlib
from functools import cache
from pathlib import Path
from typing import NamedTuple

from mpm_ref.rom.model_file import load
from mpm_ref.scene.toml import canonical

from ..common.weights_needed import load_weights
from .studies import GRAVITY, POKES, TORSION, TOWER
from .workshop_studies import PUSHES, SHEAR3, SHEAR17

FOLDER = Path(__file__).parent / "weights"
BOTH, NO_F, NO_V, NEITHER = "both", "no-F", "no-v", "neither"
TERMS = {BOTH: (1.0, 1.0), NO_F: (0.0, 1.0), NO_V: (1.0, 0.0), NEITHER: (0.0, 0.0)}
WORKSHOP = "workshop"       # both, lambda_1 = 1e4 instead of lambda_F = 100 (LDMW-X3)
SHARES = {**TERMS, WORKSHOP: (100.0, 1.0)}
SEEDS = 3                   # of trainings for torsion
POKE_NETS = ("poke", "poke-1", "poke-2")
REPEATED = (7,)             # latent dimensions at which the loss's terms are left out


class MapNet(NamedTuple):
    """Settings of the training of a deformation map on a study's runs."""

    study: object
    r: int
    terms: str = BOTH       # of `SHARES`: shares of lambda_F and lambda_v
    reading: str = "code"   # of `learn.loss.READINGS`
    seed: int = 0
    epochs: int = 400
    points: int = 128       # shown of each snapshot
    batch: int = 8          # snapshots
    dense: int = 0          # time levels that every epoch shows; of later ones, ...
    thin: int = 1           # ... one in so many
    latent: str = "encoder"     # of `learn.fit.LATENTS`


def nets():
    """{name: `MapNet`} of all experiments."""
    trainings = {f"gravity-r{r}": MapNet(GRAVITY, r) for r in range(1, 8)}
    for r in REPEATED:
        trainings |= {f"gravity-r{r}-{terms}": MapNet(GRAVITY, r, terms) for terms in TERMS if terms
                      != BOTH}
    trainings["gravity-r7-printed"] = MapNet(GRAVITY, 7, reading="printed")
    trainings |= {f"torsion-{seed}": MapNet(TORSION, 7, seed=seed, epochs=850)
                  for seed in range(SEEDS)}
    trainings |= {name: MapNet(POKES, 6, seed=seed, epochs=300, dense=40, thin=4)
                  for seed, name in enumerate(POKE_NETS)}
    trainings["tower"] = MapNet(TOWER, 6, reading="tower", latent="modes", epochs=100)
    return trainings | workshop()


def workshop():
    """{name: `MapNet`} of the workshop paper, whose latent coordinates are free (LDMW-eq7)."""
    unit = MapNet(SHEAR3, 1, epochs=10000, latent="free")
    trainings = {f"shear3-{terms}": unit._replace(terms=terms) for terms in (NEITHER, NO_F,
                                                                             WORKSHOP)}
    trainings["shear3-printed"] = unit._replace(terms=WORKSHOP, reading="printed")
    trainings["shear17"] = unit._replace(study=SHEAR17, terms=WORKSHOP)
    trainings["push"] = MapNet(PUSHES, 5, WORKSHOP, epochs=700, latent="free")
    return trainings


@cache
def trained(name):
    """Return the `Model` of a trained map. Raises ValueError where it is missing, damaged, or of
    another training or other scenes than `nets` says now.
    """
    return load_weights(FOLDER / f"{name}.npz", identity(nets()[name]), load,
                        f"python -m validation.training.ldm {name}",
                        defaults=MapNet._field_defaults)


def identity(net):
    """Return the plain values that identify a training: its scenes and its settings."""
    study, *settings = net
    texts = "".join(canonical(study.scene(*study.mu[k])) for k in study.train)
    digest = hashlib.sha256(texts.encode()).hexdigest()[:16]
    return {"study": study.name, "scenes": digest, **dict(zip(MapNet._fields[1:], settings,
                                                              strict=True))}
