"""Maps of a study: made of its data, and read from their files."""

import hashlib
from functools import partial
from math import isfinite
from pathlib import Path

import numpy as np

from ...shapes.inside import solid
from ...store.manifest import source_hash, versions
from ...training import part
from .. import model_file
from ..fields.pod import basis
from ..fields.polynomial_manifold import curved
from ..latent import initial
from ..model_file import Model
from . import nsf_fields as nsf
from . import nsf_networks
from .errors import misfit
from .tables import CURVED, KEYS, LDM, MODES, NETWORK, NSF, require_nonlinear

KEPT = 50           # epochs of which the loss is kept in the file
SIDE, STEP = 0.4, 1.0 / 144.0       # the loss's weights "code" were made for a body whose largest
                                    # side is so long [m], and for such steps [s]


def computed(study, snapshots, about):
    """`Model` of POD modes of `Snapshots`, straight or bent, or of NSF's fields of `Histories`;
    about: what else is to be known of it, plain values. Raises ValueError for more modes, or more
    monomials, than the data tell.
    """
    how = study.tables.map
    if study.tables.model == NSF:
        fields, xhat = nsf.made(study, snapshots)
        model = Model(fields, xhat, xhat[:, 0].mean(axis=0), about | identity(study))
        return measured(model, snapshots, nsf.misfit)
    bent = how.kind == CURVED
    known = basis(snapshots.X, *snapshots.flat(), how.modes if bent else how.r)
    map = curved(known, how.r, how.degree) if bent else known.modes
    xhat = known.xhat[:, :how.r].reshape(*snapshots.x.shape[:2], how.r)
    return measured(Model(map, xhat, np.zeros(how.r), about | identity(study)), snapshots)


def learned(study, snapshots, about, checkpoint, on_epoch, machine):
    """`Model` of a network trained on `Snapshots`, or of NSF's on `Histories`, on a
    `learning.Machine`; checkpoint and on_epoch as for `train.decoder.train_decoder`, the one a
    folder for NSF. Raises ValueError without PyTorch, and for a checkpoint of another training.
    """
    if study.tables.model == NSF:
        return inferred(study, snapshots, about, checkpoint, on_epoch, machine)
    settings = {name: getattr(study.tables.map, name) for name in ("r", *KEYS[NETWORK])}
    train = training()
    settings["weights"] = train.loss_weights(settings["weights"], *larger(study.base))
    done = train.fit_decoder(settings, snapshots, checkpoint, on_epoch, machine)
    return measured(of_trained(done, snapshots.X, about | identity(study) | machine._asdict() | {
        "torch": train.torch_version()}), snapshots)


def inferred(study, histories, about, folder, on_epoch, machine):
    """`Model` of NSF's three networks trained on `Histories`, as `learned` has it."""
    how = about | identity(study) | machine._asdict() | {"torch": training().torch_version()}
    fitted = partial(training().fit_stages, machine=machine)
    model = nsf_networks.trained(fitted, study.tables.map, histories, folder, on_epoch)
    return measured(model._replace(about=how | model.about), histories, nsf.misfit)


def forget(checkpoint):
    """Remove the checkpoint of a training that is done: a file, or the folder of NSF's."""
    if checkpoint.is_dir():
        nsf_networks.forget(checkpoint)
    else:
        checkpoint.unlink(missing_ok=True)


def measured(model, snapshots, misfit=misfit):
    """A `Model` that also says of its fit how many points the `Snapshots` have, and how far it is
    off them at its own latent coordinates.
    """
    off = misfit(model.field, snapshots, model.xhat)._asdict()
    known = {name: share for name, share in off.items() if isfinite(share)}
    return model._replace(about=model.about | {
        "fit": {"points": len(snapshots.X), "errors": known}})


def of_trained(done, X, about):
    """`Model` of a `train.decoder.TrainedDecoder` for points X (n, d) at rest [m]; what the
    training took and the loss of some epochs are added to what is to be known of it.
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
    """Return `rom.train.settings`, which trains networks. Raises ValueError without PyTorch."""
    return part("rom.train.settings", "a network is trained",
                f"or make modes, which need none: --kind {MODES}")


def identity(study):
    """What a map is of and how it was made: plain values."""
    return {"study": study.digest, "name": study.path.stem, "title": study.tables.title,
            "scene": study.tables.scene, "map": study.tables.map.settings,
            "parameters": list(study.names),
            "mu": study.mu[list(study.train)].tolist(), "source_sha256": source_hash(),
            "versions": versions(), **model_of(study)}


def model_of(study):
    """{"model": name} of a study of another model than LDM's, whose files do not say."""
    model = study.tables.model
    return {} if model == LDM else {"model": model}


def load(path, study):
    """The `Model` of a file, of any kind. Raises ValueError for a file that is damaged or no map,
    for one of another study, and for one that the study's projection does not suit.
    """
    model = model_file.load(path)
    if model.about.get("study") != study.digest:
        raise ValueError(f"{path} is a map of another study, or of {study.path} before its scenes "
                         "or held-out runs changed; train again, or name the study it is of")
    if study.tables.model == LDM:
        require_nonlinear(model.about["map"]["kind"], study.tables.run.projection)
    return model


def sha256(path):
    """Of a file's bytes."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
