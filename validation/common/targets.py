"""The numbers the five papers print, and how each is judged, read from validation/targets/*.toml.

A file holds `paper = "nsf"`, `targets = [{id = "nsf.table1.bread.error", value = 1.2, ..}, ..]` and
the kinds of groups below. Unit "%" keeps the printed percentage, "1" is a pure number, "x" a
ratio, "nondim" a quantity of a scene without units.

comparator: what agreement with the number means (`judge` has the intervals).
    "="   the setting to use                "~"   the same size, neither smaller nor larger
    "<="  an error or a cost: smaller is better      ">="  a gain: larger is better
    "<"   a bound from above that must hold          ">"   a bound from below
    "none"  nothing to compare with: a time on another machine

confidence: how sure the number is.
    exact          as printed           derived        follows from other printed numbers
    ocr-uncertain  print or unit damaged or missing, our reading
    external       from the authors' public release, not in the text
    contradicted   another printed number disagrees; the ruling is an issue in docs/equations.toml

Groups name numbers by patterns of ids, `*` for any text:
    [[tolerance]]  how far a number may be off, and why; each "~" needs one
    [[chosen]]     records whose settings were picked on the runs that are judged: "chosen"
    [[smaller]]    results of scenes that are smaller than the printed ones at all profiles but
                   "paper": no credit
    [[cause]]      why numbers are missed, and the experiment that shows it
    [[headline]]   a claim of the paper, with the numbers that stand for it
"""

import math
import tomllib
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Literal

import msgspec

from .judge import Criterion, accepted

FOLDER = Path(__file__).parents[1] / "targets"
PRINTED_SIZE = "--profile paper"    # in the command of a record
ROUNDED = 0.1       # of a printed number: how far another print of it may be off


class Target(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One printed number: where it stands, what it measures, how it is to be compared."""

    id: str
    value: int | float
    unit: str
    what: str
    paper_ref: str
    kind: Literal["setting", "error", "time", "speedup", "iterations", "memory"]
    comparator: Literal["=", "<=", ">=", "<", ">", "~", "none"]
    confidence: Literal["exact", "derived", "ocr-uncertain", "external", "contradicted"]
    conditions: str = ""
    again: str = ""         # the id of the number that is recorded, where this one repeats it


class Tolerance(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Slack of numbers: a factor, a relative tolerance of "=", or digits of "~"; and its reason."""

    ids: list[str]
    why: str
    factor: float | None = None
    tolerance: float | None = None
    digits: int | None = None


class Choice(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Records of which something was picked on the very runs that would judge them."""

    ids: list[str]
    why: str


class Smaller(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Printed results of which all profiles but "paper" have smaller scenes."""

    ids: list[str]
    why: str


class Cause(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Why numbers are missed, with the experiment that shows it, if one does."""

    ids: list[str]
    text: str
    shown_by: str = ""
    certain: bool = True    # false: a part of the cause, or a guess, is all that is known

    @property
    def sentence(self):
        """Return the text, marked where the cause is not certain."""
        return self.text if self.certain else f"not certain: {self.text}"


class Headline(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A claim that a reader takes from the paper, and the ids of its numbers."""

    claim: str
    ids: list[str]


class TargetFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The content of one file."""

    paper: str
    targets: list[dict]
    tolerance: list[Tolerance] = []
    chosen: list[Choice] = []
    smaller: list[Smaller] = []
    cause: list[Cause] = []
    headline: list[Headline] = []


class Targets(dict):
    """{id: `Target`}, with the groups of all files."""

    def __init__(self, by_id, files=()):
        super().__init__(by_id)
        self.tolerances = [group for file in files for group in file.tolerance]
        self.choices = [group for file in files for group in file.chosen]
        self.smaller = [group for file in files for group in file.smaller]
        self.causes = [group for file in files for group in file.cause]
        self.headlines = {file.paper: file.headline for file in files}

    def criterion(self, target_id):
        """Return the `Criterion` of a printed number."""
        target, group = self[target_id], first_of(self.tolerances, target_id)
        own = {} if group is None else {
            name: getattr(group, name) for name in ("factor", "tolerance", "digits")}
        return Criterion(target.comparator, float(target.value), **own)

    def why(self, target_id):
        """Return the reason of a number's tolerance, empty where it has none."""
        group = first_of(self.tolerances, target_id)
        return group.why if group else ""

    def choice(self, record_id):
        """Return what was picked on the runs of a record, empty where nothing was."""
        group = first_of(self.choices, record_id)
        return group.why if group else ""

    def is_smaller(self, record):
        """Return whether a `Measurement` is of scenes that are smaller than the printed ones."""
        at_size = PRINTED_SIZE in record.command
        return not at_size and first_of(self.smaller, record.target) is not None

    def cause(self, record_id):
        """Return the `Cause` of a missed number, or None where it is not known."""
        return first_of(self.causes, record_id)


def first_of(groups, number):
    """Return the first group with a pattern that matches the id of a number, or None."""
    return next((group for group in groups
                 if any(fnmatchcase(number, pattern) for pattern in group.ids)), None)


def load(folder: Path = FOLDER) -> Targets:
    """All targets by id, file by file.

    Raises ValueError, naming file, id and key, for an unknown or missing key, a value of the
    wrong type, a number that is not finite, an id of another paper, an id given twice, a number
    that repeats none of its kind, a rule that is not complete, or a pattern that matches no number.
    """
    found, files = {}, []
    for path in sorted(folder.glob("*.toml")):
        content, targets = read(path)
        files.append(content)
        for target in targets:
            if target.id in found:
                raise ValueError(f"{path.name}: target {target.id!r} is given twice; drop one")
            found[target.id] = target
        require_used(content, targets, path.name)
    for target in found.values():
        if target.again:
            require_again(target, found.get(target.again))
    result = Targets(found, files)
    require_rules(result)
    return result


def require_used(content, targets, file):
    """Raise ValueError where a pattern of a tolerance, a headline or smaller scenes matches no
    target of its file.
    """
    for group in (*content.tolerance, *content.headline, *content.smaller):
        for pattern in group.ids:
            if not any(fnmatchcase(target.id, pattern) for target in targets):
                raise ValueError(f"{file}: no target matches ids = {pattern!r} of a "
                                 f"{type(group).__name__.lower()}; correct the pattern or drop it")


def require_rules(targets):
    """Raise ValueError, naming the id, where a target's rule is not complete."""
    for id in targets:
        try:
            accepted(targets.criterion(id))
        except ValueError as fault:
            raise ValueError(f"target {id!r}: {fault}; give a [[tolerance]]") from None


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


def read(path: Path) -> tuple[TargetFile, list[Target]]:
    """The content and the targets of one file; errors as in `load`."""
    content = convert(tomllib.loads(path.read_text(encoding="utf-8")), TargetFile, path.name)
    targets = [target_of(record, path.name) for record in content.targets]
    start = content.paper + "."
    for target in targets:
        if not target.id.startswith(start):
            raise ValueError(f"{path.name}: target {target.id!r} must begin with {start!r}")
    return content, targets


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
