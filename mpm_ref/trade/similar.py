"""Advice for a scene from the answer on a similar one, without a run.

What carries over is the number of cells over the largest body, and all other knobs. Whether the
error carries over is not known. A stored answer may come from a stranger: only values of known
knobs are taken from it.
"""

from math import inf
from typing import Annotated

import msgspec
from msgspec import UNSET, Meta, UnsetType

from ..scene import SceneError
from ..sweep.observation import FINISHED
from ..sweep.setting import setting

LARGEST = 64 << 20      # bytes of a stored answer
Factor = Annotated[float, Meta(ge=1e-6, le=1e6)]
NotNegative = Annotated[float, Meta(ge=0.0)]
Word = Annotated[str, Meta(pattern=r"^[a-z0-9_. -]+$", max_length=40)]


class StoredSetting(msgspec.Struct, forbid_unknown_fields=True):
    """The knobs of a row; see `sweep.setting`."""

    scene: Word | UnsetType = UNSET
    dx: Factor | UnsetType = UNSET
    particles: Factor | UnsetType = UNSET
    sampling: Word | UnsetType = UNSET
    integrator: Word | UnsetType = UNSET
    cfl: Factor | UnsetType = UNSET
    degree: int | UnsetType = UNSET
    transfer: Word | UnsetType = UNSET
    gimp: NotNegative | UnsetType = UNSET
    f_bar: bool | UnsetType = UNSET
    precision: Word | UnsetType = UNSET
    eps: Factor | UnsetType = UNSET
    boundary: Word | UnsetType = UNSET

    def knobs(self):
        """Return {knob: value} of those that are set."""
        return {name: value for name, value in msgspec.structs.asdict(self).items()
                if value is not UNSET}


class StoredRow(msgspec.Struct):
    """The entries of a row that are read; None for a number that is not known."""

    setting: StoredSetting
    outcome: str
    error: NotNegative | None
    cpu: NotNegative | None


class StoredReference(msgspec.Struct):
    """The entry of a reference that is read; None if it is not known."""

    error: NotNegative | None


class StoredAnswer(msgspec.Struct):
    """The entries of a file SCENE.trade.json that are read."""

    cells: Factor
    until: NotNegative
    end: NotNegative
    quantities: Annotated[list[str], Meta(min_length=1)]
    references: dict[str, StoredReference]
    rows: list[StoredRow]

    def margin(self):
        """Return the largest error of the references of the quantities asked for."""
        errors = [self.references[text].error for text in self.quantities
                  if text in self.references]
        known = len(errors) == len(self.quantities) and None not in errors
        return max(errors) if known else inf


def read_answer(path):
    """Return the `StoredAnswer` in a file SCENE.trade.json. Raises SceneError for another file."""
    try:
        with open(path, "rb") as file:
            text = file.read(LARGEST + 1)
        if len(text) > LARGEST:
            raise SceneError(f"{path}: over {LARGEST >> 20} MB; expected the answer that `mpm-ref "
                             "trade` writes")
        return msgspec.json.decode(text, type=StoredAnswer)
    except OSError as fault:
        raise SceneError(f"{path}: {fault.strerror}; expected the answer that `mpm-ref trade` "
                         "writes for the similar scene") from None
    except (msgspec.DecodeError, UnicodeDecodeError) as fault:
        raise SceneError(f"{path}: not an answer of `mpm-ref trade` ({fault}); run it on the "
                         "similar scene") from None


def require_same_quantities(answer, quantities, name):
    """Raise SceneError unless a stored answer is about the quantities asked for."""
    if sorted(answer.quantities) != sorted(quantities):
        raise SceneError(f"{name}: its answer is about {', '.join(answer.quantities)}; asked is "
                         f"{', '.join(quantities)}: name the same by --quantity")


def cheapest_row(answer, error):
    """Return the `StoredRow` of the cheapest setting of the scene itself that keeps an error, the
    reference's included, or None.
    """
    good = [row for row in answer.rows if row.outcome == FINISHED and row.setting.scene is UNSET
            and row.error is not None and row.cpu is not None
            and row.error + answer.margin() <= error]
    return min(good, key=lambda row: row.cpu, default=None)


def carried_over(row, cells, own_cells):
    """Return the setting of a row for a scene with so many cells over its largest body, where the
    row's scene had `cells`.
    """
    knobs = row.setting.knobs()
    return setting(**knobs | {"dx": knobs.get("dx", 1.0) * own_cells / cells})
