"""The trained maps of LDM's experiments: which there are, and where they stand.

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

from .studies import GRAVITY, POKES, TORSION, TOWER
from .workshop_studies import PUSHES, SHEAR3, SHEAR17

FOLDER = Path(__file__).parent / "weights"
BOTH, NO_F, NO_V, NEITHER = "both", "no-F", "no-v", "neither"
TERMS = {BOTH: (1.0, 1.0), NO_F: (0.0, 1.0), NO_V: (1.0, 0.0), NEITHER: (0.0, 0.0)}
WORKSHOP = "workshop"       # both, lambda_1 = 1e4 instead of lambda_F = 100 (LDMW-X3)
SHARES = {**TERMS, WORKSHOP: (100.0, 1.0)}
SEEDS = 3                   # of trainings for torsion
REPEATED = (7,)             # latent dimensions at which the loss's terms are left out


class Net(NamedTuple):
    """What is trained: a study's runs, and how."""

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
    """{name: `Net`} of all experiments."""
    found = {f"gravity-r{r}": Net(GRAVITY, r) for r in range(1, 8)}
    for r in REPEATED:
        found |= {f"gravity-r{r}-{terms}": Net(GRAVITY, r, terms) for terms in TERMS
                  if terms != BOTH}
    found["gravity-r7-printed"] = Net(GRAVITY, 7, reading="printed")
    found |= {f"torsion-{seed}": Net(TORSION, 7, seed=seed, epochs=850) for seed in range(SEEDS)}
    found["poke"] = Net(POKES, 6, epochs=300, dense=40, thin=4)
    found["tower"] = Net(TOWER, 6, reading="tower", latent="modes", epochs=100)
    return found | workshop()


def workshop():
    """{name: `Net`} of the workshop paper, whose latent coordinates are free (LDMW-eq7)."""
    unit = Net(SHEAR3, 1, epochs=10000, latent="free")
    found = {f"shear3-{terms}": unit._replace(terms=terms) for terms in (NEITHER, NO_F, WORKSHOP)}
    found["shear3-printed"] = unit._replace(terms=WORKSHOP, reading="printed")
    found["shear17"] = unit._replace(study=SHEAR17, terms=WORKSHOP)
    found["push"] = Net(PUSHES, 5, WORKSHOP, epochs=700, latent="free")
    return found


@cache
def trained(name):
    """`Model` of a trained map. Raises ValueError where it is missing, damaged, or of another
    training or other scenes than `nets` says now.
    """
    path, again = FOLDER / f"{name}.npz", f"python -m validation.training.ldm {name}"
    if not path.exists():
        raise ValueError(f"no weights {path.name}: {again}")
    model, now = load(path), identity(nets()[name])
    was = {key: model.about.get(key, Net._field_defaults.get(key)) for key in now}
    if was != now:
        raise ValueError(f"weights {path.name} are of {was}, now it is {now}: {again}")
    return model


def identity(net):
    """What a training is of: the runs' scenes, and how it is made; plain values."""
    study, *how = net
    texts = "".join(canonical(study.scene(*study.mu[k])) for k in study.train)
    digest = hashlib.sha256(texts.encode()).hexdigest()[:16]
    return {"study": study.name, "scenes": digest, **dict(zip(Net._fields[1:], how, strict=True))}
