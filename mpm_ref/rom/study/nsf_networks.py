"""NSF's three networks as what a study's reduced model is made of: trained, and as files."""

from contextlib import suppress
from pathlib import Path

STAGES = "ghl"


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
    return done.model(about | {"losses": {name: float(loss) for name, loss in losses.items()}})


def forget(folder):
    """Remove the checkpoints of stages, and their folder if nothing else is in it."""
    for stage in STAGES:
        (folder / f"{stage}.pt").unlink(missing_ok=True)
    with suppress(OSError):
        folder.rmdir()
