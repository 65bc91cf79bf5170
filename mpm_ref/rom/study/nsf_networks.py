"""NSF's three networks as what a study's reduced model is made of: trained, and as files."""

from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from .. import fields_file
from ..fields.network import Decoder, Field
from ..weights import Model

STAGES = "ghl"


class Networks(NamedTuple):
    """The three fields; they know no points (see `rom.fields.network`)."""

    g: Decoder      # position
    h: Field        # stress
    l: Field        # affine field

    @property
    def dim(self):
        """Number of axes d."""
        return self.g.dim

    @property
    def r(self):
        """Number of latent coordinates."""
        return self.g.r


def trained(fitted, map, histories, folder, on_epoch):
    """`Model` of networks trained by `fitted`, a function as `rom.train.settings.fit_stages`
    without machine, with the settings of a `tables.Fields` on `Histories`.

    folder: for checkpoints of the stages, made where it is not; on_epoch(history) is called after
    each epoch of any, with as many entries as epochs so far.
    """
    before = {"g": 0, "h": map.epochs, "l": map.epochs + map.field_epochs}

    def show(stage, history):
        on_epoch([None] * before[stage] + history)

    Path(folder).mkdir(exist_ok=True)
    done = fitted(map.settings, histories, folder, show)
    about = {f"{clock}_seconds": round(sum(getattr(part.cost, clock) for part in done), 1)
             for clock in done.g.cost._fields}
    losses = {"g": done.g.history[-1, 0], "h": done.h.history[-1], "l": done.l.history[-1]}
    own = done.model(about | {"losses": {name: float(loss) for name, loss in losses.items()}})
    return Model(Networks(own.g, own.h, own.l), own.xhat, own.rest, own.about)


def forget(folder):
    """Remove the checkpoints of stages, and their folder if nothing else is in it."""
    for stage in STAGES:
        (folder / f"{stage}.pt").unlink(missing_ok=True)
    with suppress(OSError):
        folder.rmdir()


def is_one(arrays):
    """Whether the arrays of a file are those of three networks."""
    return "g.W" in arrays


def save(path, model):
    """Write a `Model` of networks; raises as `fields_file.save` does."""
    fields_file.save(path, fields_file.Model(*model.decoder, model.xhat, model.rest, model.about))


def load(path):
    """Read what `save` wrote. Raises ValueError saying what is wrong with the file."""
    own = fields_file.load(path)
    return Model(Networks(own.g, own.h, own.l), own.xhat, own.rest, own.about)
