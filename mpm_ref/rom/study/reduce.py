"""Reduced models of a study: computed from its data, trained on them, and read from their files."""

import hashlib
from contextlib import suppress
from functools import partial
from math import isfinite
from pathlib import Path

import numpy as np

from ...shapes.inside import solid
from ...store.manifest import source_hash, versions
from ...training import import_with_torch
from .. import model_file
from ..fields.network import Networks, learned_fields
from ..fields.numbered import numbered
from ..fields.pod import PodModes, basis
from ..fields.pod_fields import fit_pod_fields
from ..fields.polynomial_manifold import Curved, curved
from ..latent import initial
from ..model_file import Model
from .errors import misfit
from .tables import CURVED, KEYS, LDM, MODES, NETWORK, require_nonlinear, require_precision

STORED_LOSSES = 50      # epochs of which the loss is stored in the file
SIDE, STEP = 0.4, 1.0 / 144.0       # largest side [m] and time step [s] of the body that the loss's
                                    # weights "code" were made for
BLOCK = 3.0             # size of blocks of points [dx]
STAGES = "ghl"          # of the training of NSF's networks


def compute_model(study, data, about):
    """Return the `Model` of modes of a study's `Snapshots` or `Histories`; about: plain values that
    describe it. Raises ValueError for more modes, or more monomials, than the data hold.
    """
    field, xhat, rest = study.method.compute(study, data)
    return with_misfit(study, Model(field, xhat, rest, about | identity(study)), data)


def train_model(study, data, about, checkpoint, on_epoch, machine):
    """Return the `Model` of networks trained on a study's `Snapshots` or `Histories`, on a
    `training.Machine`; checkpoint (a file, or a folder for NSF) and on_epoch as for
    `train_epochs`. Raises ValueError without PyTorch, and for a checkpoint of another training.
    """
    about = about | identity(study) | machine._asdict() | {"torch": trainer().torch_version()}
    return with_misfit(study, study.method.train(study, data, about, checkpoint, on_epoch, machine),
                       data)


def with_misfit(study, model, data):
    """Return a `Model` whose `about` has its misfit: the number of points of the data, and the
    errors at its own latent coordinates.
    """
    errors = study.method.misfit(model.field, data, model.xhat)._asdict()
    finite = {name: share for name, share in errors.items() if isfinite(share)}
    return model._replace(about=model.about | {
        "fit": {"points": len(data.X), "errors": finite}})


def trainer():
    """Return `rom.train.settings`, which trains networks. Raises ValueError without PyTorch."""
    return import_with_torch("rom.train.settings", "a network is trained",
                f"or make modes, which need none: --kind {MODES}")


# LDM's map.

def compute_map(study, snapshots):
    """Return POD modes of `Snapshots`, or a manifold over them, their latent coordinates (s, k + 1,
    r), and those at rest (r,).
    """
    settings = study.tables.reduced_model
    is_curved = settings.kind == CURVED
    modes = basis(snapshots.X, *snapshots.flat(), settings.modes if is_curved else settings.r)
    g = curved(modes, settings.r, settings.degree) if is_curved else modes.modes
    xhat = modes.xhat[:, :settings.r].reshape(*snapshots.x.shape[:2], settings.r)
    return g, xhat, np.zeros(settings.r)


def require_one_body(study):
    """Raise ValueError for a map of several bodies that is a network."""
    bodies = len(study.base.body)
    if bodies > 1 and study.tables.reduced_model.kind == NETWORK:
        raise ValueError(f"map.kind = {NETWORK!r} with {bodies} bodies: expected {MODES!r} or "
                         f"{CURVED!r}, since a network is one continuous map of the body at rest")


def train_map(study, snapshots, about, checkpoint, on_epoch, machine):
    """Return the `Model` of a decoder trained on `Snapshots`. Raises ValueError as
    `require_one_body` does.
    """
    require_one_body(study)
    settings = {name: getattr(study.tables.reduced_model, name) for name in ("r", *KEYS[NETWORK])}
    settings["weights"] = trainer().loss_weights(settings["weights"], *size_ratios(study.base))
    trained = trainer().fit_decoder(settings, snapshots, checkpoint, on_epoch, machine)
    return decoder_model(trained, snapshots.X, about)


def decoder_model(trained, X, about):
    """Return the `Model` of a `train.decoder.TrainedDecoder` for points X (n, d) at rest [m]; time
    and the loss of some epochs are added to its `about`.
    """
    rest = initial(trained.decoder, X, xhat=trained.xhat[:, 0].mean(axis=0)).xhat
    loss = trained.history[::max(1, len(trained.history) // STORED_LOSSES)].tolist()
    time = {f"{clock}_seconds": round(s, 1) for clock, s in trained.cost._asdict().items()}
    return Model(trained.decoder, trained.xhat, rest, about | time | {"loss": loss})


def size_ratios(scene):
    """Return the ratios of a scene's body and time step to those that the loss's weights "code"
    were made for.
    """
    body = solid(scene.body[0].shape)
    return float((body.high - body.low).max()) / SIDE, scene.dt / STEP


def map_misfit(g, snapshots, xhat):
    """Return the `PositionErrors` of a map's positions in its `Snapshots`; of modes by the numbers
    of points, as two bodies may have points in one place.
    """
    if isinstance(g, PodModes | Curved):
        return misfit(numbered(g), np.arange(len(snapshots.X)), snapshots, xhat)
    return misfit(g, snapshots.X, snapshots, xhat)


# NSF's fields.

def compute_fields(study, histories):
    """Return the `PodFields` of `Histories`, their latent coordinates (s, k + 1, r), and those
    near the start (r,).
    """
    settings = study.tables.reduced_model
    fields, xhat = fit_pod_fields(histories, settings.sizes, BLOCK * study.base.dx,
                           settings.stress_sees_parameters)
    return fields, xhat, xhat[:, 0].mean(axis=0)


def train_fields(study, histories, about, folder, on_epoch, machine):
    """Return the `Model` of three networks trained on `Histories`; folder: for the checkpoints of
    the stages, created if need be; on_epoch(history) is called after each epoch of any stage, with
    as many entries as epochs so far.
    """
    settings = study.tables.reduced_model
    before = {"g": 0, "h": settings.epochs, "l": settings.epochs + settings.field_epochs}

    def show(stage, history):
        on_epoch([None] * before[stage] + history)

    Path(folder).mkdir(exist_ok=True)
    trained = partial(trainer().fit_stages, machine=machine)(
        settings.settings, histories, folder, show)
    time = {f"{clock}_seconds": round(sum(getattr(part.cost, clock) for part in trained), 1)
            for clock in trained.g.cost._fields}
    losses = {"g": trained.g.history[-1, 0], "h": trained.h.history[-1],
              "l": trained.l.history[-1]}
    return trained.model(about | time | {"losses": {name: float(loss)
                                                    for name, loss in losses.items()}})


def fields_of_run(fields, full, mu):
    """Return the fields, `PodFields` or `Networks`, in the run of a `FullModel` with parameters mu,
    where the stress is a function of them.
    """
    if isinstance(fields, Networks):
        return learned_fields(full.X, fields, mu, BLOCK * full.problem.dx)
    return fields.with_parameters(mu) if len(fields.mu) else fields


def fields_misfit(fields, histories, xhat):
    """Return the `PositionErrors` of the fields' positions in their `Histories`."""
    if isinstance(fields, Networks):
        return misfit(fields.g, histories.X, histories, xhat)
    return misfit(fields, np.arange(len(histories.X)), histories, xhat)


# Files.

def forget_checkpoint(checkpoint):
    """Remove the checkpoint of a training that has ended: a file, or those of the stages in a
    folder, and the folder if nothing else is in it.
    """
    if not checkpoint.is_dir():
        checkpoint.unlink(missing_ok=True)
        return
    for stage in STAGES:
        (checkpoint / f"{stage}.pt").unlink(missing_ok=True)
    with suppress(OSError):
        checkpoint.rmdir()


def identity(study):
    """Return the plain values that say of what a model is, and how it was made."""
    return {"study": study.digest, "name": study.path.stem, "title": study.tables.title,
            "scene": study.tables.scene, "map": study.tables.reduced_model.settings,
            "parameters": list(study.names),
            "mu": study.mu[list(study.train)].tolist(), "source_sha256": source_hash(),
            "versions": versions(), **study.model_entry}


def load(path, study):
    """Return the `Model` of a file, of any kind; NSF's modes in the precision of the study's runs.
    Raises ValueError for a file that is damaged or no model, for one of another study, and for one
    that the study's projection or precision does not suit.
    """
    model = model_file.load(path)
    if model.about.get("study") != study.digest:
        raise ValueError(f"{path} is a map of another study, or of {study.path} before its scenes "
                         "or held-out runs changed; train again, or name the study it is of")
    run = study.tables.run
    if study.tables.model == LDM:
        require_nonlinear(kind_of(model), run.projection)
        return model
    require_precision(kind_of(model), run.precision)
    return model._replace(field=model.field.single()) if run.precision == "single" else model


def kind_of(model):
    """Return the kind of a model, as its study names it."""
    return model.about["map"]["kind"]


def sha256(path):
    """Return the sha256 of a file's bytes."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()
