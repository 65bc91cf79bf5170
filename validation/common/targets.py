"""The numbers the five papers print, one record each, read from validation/targets/*.toml.

A file holds `paper = "nsf"` and `targets = [{id = "nsf.table1.bread.error", value = 1.2, ..}, ..]`.
Unit "%" keeps the printed percentage, "1" is a pure number, "x" a ratio, "nondim" a quantity of a
scene without units.

comparator: what agreement with the number means; the experiment states its factor.
    "="   the setting to use        "<="  must not be exceeded (errors: a factor of 2 is fair)
    ">="  must be reached           "~"   the same size (a factor of 3 is fair; times: ratios only)

confidence: how sure the number is.
    exact          as printed           derived        follows from other printed numbers
    ocr-uncertain  print or unit damaged or missing, our reading
    external       from the authors' public release, not in the text
    contradicted   another printed number disagrees; the ruling is an issue in docs/equations.toml
"""

import math
import tomllib
from pathlib import Path
from typing import Literal

import msgspec

FOLDER = Path(__file__).parents[1] / "targets"
ROUNDED = 0.1       # of a printed number: how far another print of it may be off


class Target(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One printed number: where it stands, what it measures, how it is to be compared."""

    id: str
    value: int | float
    unit: str
    what: str
    paper_ref: str
    kind: Literal["setting", "error", "time", "speedup", "iterations", "memory"]
    comparator: Literal["=", "<=", ">=", "~"]
    confidence: Literal["exact", "derived", "ocr-uncertain", "external", "contradicted"]
    conditions: str = ""
    again: str = ""         # the id of the number that is recorded, where this one repeats it


class TargetFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The content of one file."""

    paper: str
    targets: list[dict]


def load(folder: Path = FOLDER) -> dict[str, Target]:
    """All targets by id, file by file.

    Raises ValueError, naming file, id and key, for an unknown or missing key, a value of the
    wrong type, a number that is not finite, an id of another paper, an id given twice, or a number
    that repeats none of its kind.
    """
    found: dict[str, Target] = {}
    for path in sorted(folder.glob("*.toml")):
        for target in read(path):
            if target.id in found:
                raise ValueError(f"{path.name}: target {target.id!r} is given twice; drop one")
            found[target.id] = target
    for target in found.values():
        if target.again:
            require_again(target, found.get(target.again))
    return found


def require_again(target, original):
    """Raise ValueError unless a target agrees with the number that it repeats: the same kind and
    unit, nearly the same value, and the original repeats no other.
    """
    same = original is not None and (original.kind, original.unit) == (target.kind, target.unit)
    same = same and math.isclose(original.value, target.value, rel_tol=ROUNDED)
    if not same or original.again:
        raise ValueError(f"{target.id.split('.')[0]}, target {target.id!r}: again = "
                         f"{target.again!r}; expected the id of a number that repeats no other, of "
                         f"the same kind ({target.kind}), unit ({target.unit}) and, but for "
                         f"rounding, value ({target.value})")


def read(path: Path) -> list[Target]:
    """The targets of one file; errors as in `load`."""
    content = convert(tomllib.loads(path.read_text(encoding="utf-8")), TargetFile, path.name)
    targets = [target_of(record, path.name) for record in content.targets]
    start = content.paper + "."
    for target in targets:
        if not target.id.startswith(start):
            raise ValueError(f"{path.name}: target {target.id!r} must begin with {start!r}")
    return targets


def target_of(record: dict, file: str) -> Target:
    """The record as a Target; errors name `file` and the record's id."""
    where = f"{file}, target {record.get('id', '(no id)')!r}"
    target = convert(record, Target, where)
    if not math.isfinite(target.value):
        raise ValueError(f"{where}: value is {target.value}, expected a finite number")
    return target


def convert(data: dict, kind: type, where: str):
    """`data` as a strict `kind`; a mismatch is a ValueError that begins with `where`."""
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        raise ValueError(f"{where}: {error}") from None
