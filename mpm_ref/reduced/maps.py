"""Maps of a study: made of its data, and read from their files."""

import hashlib
from importlib import import_module
from math import isfinite
from pathlib import Path

import msgspec
import numpy as np

from ..rom import modes_file, weights
from ..rom.curved import curved
from ..rom.decoder import Decoder
from ..rom.latent import initial
from ..rom.modes import basis
from ..rom.weights import Model
from ..sealed import opened
from ..shapes.inside import solid
from ..store.manifest import source_hash, versions
from .errors import misfit
from .tables import CURVED, KEYS, MODES, NETWORK, require_nonlinear

KEPT = 50           # epochs of which the loss is kept in the file
SIDE, STEP = 0.4, 1.0 / 144.0       # the loss's weights "code" were made for a body whose largest
                                    # side is so long [m], and for such steps [s]


def computed(study, snapshots, about):
    """`Model` of POD modes of `Snapshots`, straight or bent; about: what else is to be known of it,
    plain values. Raises ValueError for more modes, or more monomials, than the data tell.
    """
    how = study.tables.map
    bent = how.kind == CURVED
    known = basis(snapshots.X, *snapshots.flat(), how.modes if bent else how.r)
    map = curved(known, how.r, how.degree) if bent else known.modes
    xhat = known.xhat[:, :how.r].reshape(*snapshots.x.shape[:2], how.r)
    return measured(Model(map, xhat, np.zeros(how.r), about | identity(study)), snapshots)


def learned(study, snapshots, about, checkpoint, on_epoch, threads):
    """`Model` of a network trained on `Snapshots`; checkpoint and on_epoch as for
    `rom.learn.fit.train`. Raises ValueError without PyTorch, and for a checkpoint of another
    training.
    """
    settings = {name: getattr(study.tables.map, name) for name in ("r", *KEYS[NETWORK])}
    drive = training()
    settings["weights"] = drive.weights(settings["weights"], *larger(study.base))
    done = drive.fitted(settings, snapshots, checkpoint, on_epoch, threads)
    return measured(of_trained(done, snapshots.X, about | identity(study) | {
        "threads": threads, "torch": drive.version()}), snapshots)


def measured(model, snapshots):
    """A `Model` that also says of its fit how many points the `Snapshots` have, and how far it is
    off them at its own latent coordinates.
    """
    off = misfit(model.decoder, snapshots, model.xhat)._asdict()
    known = {name: share for name, share in off.items() if isfinite(share)}
    return model._replace(about=model.about | {
        "fit": {"points": len(snapshots.X), "errors": known}})


def of_trained(done, X, about):
    """`Model` of a `rom.learn.fit.Trained` for points X (n, d) at rest [m]; what the training took
    and the loss of some epochs are added to what is to be known of it.
    """
    rest = initial(done.decoder, X, xhat=done.xhat[:, 0].mean(axis=0)).xhat
    loss = done.history[::max(1, len(done.history) // KEPT)].tolist()
    took = {f"{clock}_seconds": round(s, 1) for clock, s in done.cost._asdict().items()}
    return Model(done.decoder, done.xhat, rest, about | took | {"loss": loss})


def larger(scene):
    """How many times larger a scene's body and steps are than those that the loss's weights "code"
    were made for.
    """
    body = solid(scene.body[0].shape)
    return float((body.high - body.low).max()) / SIDE, scene.dt / STEP


def training():
    """The part of the package that trains networks. Raises ValueError without PyTorch."""
    try:
        return import_module("mpm_ref.rom.learn.drive")
    except ModuleNotFoundError as fault:
        if fault.name != "torch":
            raise
        raise ValueError('a network is trained with PyTorch, which is not installed: pip install '
                         '"mpm_ref[learn]", or `make learn` in the repository; or make modes, '
                         f'which need none: --kind {MODES}') from None


def identity(study):
    """What a map is of and how it was made: plain values."""
    map = study.tables.map
    return {"study": study.digest, "name": study.path.stem, "title": study.tables.title,
            "scene": study.tables.scene,
            "map": {name: value for name, value in msgspec.to_builtins(map).items()
                    if name in ("kind", "r", *KEYS[map.kind])},
            "parameters": list(study.names),
            "mu": study.mu[list(study.train)].tolist(), "source_sha256": source_hash(),
            "versions": versions()}


def save(path, model):
    """Write a `Model`, whole or not at all. Raises OSError where the system refuses."""
    file = weights if isinstance(model.decoder, Decoder) else modes_file
    file.save(path, model)


def read(path):
    """The `Model` of a file, of any kind and study. Raises ValueError for a file that is damaged or
    no map.
    """
    arrays = opened(Path(path))
    return (modes_file if modes_file.is_one(arrays) else weights).load(path)


def load(path, study):
    """The `Model` of a file, of any kind. Raises ValueError for a file that is damaged or no map,
    for one of another study, and for one that the study's projection does not suit.
    """
    model = read(path)
    if model.about.get("study") != study.digest:
        raise ValueError(f"{path} is a map of another study, or of {study.path} before its scenes "
                         "or held-out runs changed; train again, or name the study it is of")
    require_nonlinear(model.about["map"]["kind"], study.tables.run.projection)
    return model


def sha256(path):
    """Of a file's bytes."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
