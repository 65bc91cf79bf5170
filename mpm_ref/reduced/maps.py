"""Maps of a study: made of its data, and read from their files."""

import hashlib
from importlib import import_module
from pathlib import Path

import msgspec
import numpy as np

from ..rom import modes_file, weights
from ..rom.latent import initial
from ..rom.modes import basis
from ..rom.weights import Model
from ..store.manifest import source_hash, versions
from .tables import MODES

KEPT = 50           # epochs of which the loss is kept in the file


def linear(study, snapshots, about):
    """`Model` of POD modes of `Snapshots`; about: what else is to be known of it, plain values.
    Raises ValueError for more latent coordinates than the data have modes.
    """
    map, xhat = basis(snapshots.X, *snapshots.flat(), study.tables.map.r)
    return Model(map, xhat.reshape(*snapshots.x.shape[:2], map.r), np.zeros(map.r),
                 about | identity(study))


def learned(study, snapshots, about, checkpoint, on_epoch, threads):
    """`Model` of a network trained on `Snapshots`; checkpoint and on_epoch as for
    `rom.learn.fit.train`. Raises ValueError without PyTorch, and for a checkpoint of another
    training.
    """
    settings = msgspec.structs.asdict(study.tables.map)
    del settings["kind"]
    drive = training()
    done = drive.fitted(settings, snapshots, checkpoint, on_epoch, threads)
    rest = initial(done.decoder, snapshots.X, xhat=done.xhat[:, 0].mean(axis=0)).xhat
    loss = done.history[::max(1, len(done.history) // KEPT)].tolist()
    return Model(done.decoder, done.xhat, rest, about | identity(study) | {
        "threads": threads, "torch": drive.version(), "loss": loss})


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
    return {"study": study.digest, "title": study.tables.title,
            "map": {"kind": MODES, "r": map.r} if map.kind == MODES else msgspec.to_builtins(map),
            "parameters": list(study.names),
            "mu": study.mu[list(study.train)].tolist(), "source_sha256": source_hash(),
            "versions": versions()}


def save(path, model):
    """Write a `Model`, whole or not at all. Raises OSError where the system refuses."""
    kind = modes_file if hasattr(model.decoder, "slope") else weights
    kind.save(path, model)


def load(path, study):
    """The `Model` of a file, of either kind. Raises ValueError for a file that is damaged or no
    map, and for one of another study.
    """
    arrays = weights.opened(Path(path))
    model = (modes_file if modes_file.is_one(arrays) else weights).load(path)
    if model.about.get("study") != study.digest:
        raise ValueError(f"{path} is a map of another study, or of {study.path} before its scenes "
                         "or held-out runs changed; train again, or name the study it is of")
    return model


def sha256(path):
    """Of a file's bytes."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
