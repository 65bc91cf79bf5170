"""The tables of a law study: which laws are learned, how, and where they go.

docs/reference/studies.md explains their keys.
"""

from dataclasses import fields

import msgspec
from msgspec import Struct, field

from ...materials.learned.table import KINDS
from ...materials.learned.weights import PARTS
from ...rom.study.study_file import require_keys
from ...rom.study.tables import one_of
from ...scene import SceneError
from ...scene.messages import at, rephrase
from ...scene.validate import check_finite
from ..train.recipe import Recipe

SYS_ID = "sys-id"
METHOD_KINDS = {        # method -> kinds of its elastic law and of its flow, the usual one first
    "ours": (("Stress", "SymmetricStress"), ("Correction",)),
    "labeled": (("Stress", "SymmetricStress"), ("Correction",)),
    "spline": (("SplineStress", "ReleasedSplineStress"), ("NoFlow",)),
    "neural": (("StretchStress", "ReleasedStretchStress"), ("NoFlow",)),
    "no rotation": (("PlainStress",), ("PlainCorrection",)),
    "no undeformed": (("Stress", "SymmetricStress"), ("Correction",)),
    "admissible": (("Energetic",), ("Contraction",)),
    SYS_ID: (),             # those of the scene
}
USUAL = {       # method -> where its recipe differs from that of "ours"
    "labeled": {"epochs": 30, "elastic_rate": 0.1, "plastic_rate": 0.1},
    "admissible": {"elastic_rate": 0.1, "plastic_rate": 0.01},
    SYS_ID: {"elastic_rate": 0.1},
}


class Table(Struct, frozen=True, kw_only=True):
    """A table of a study file."""


class Answers(Table):
    """What the laws answer, by kinds of `learned.weights`; by default the usual ones of the method
    with their usual constants.
    """

    elastic: str | None = None
    plastic: str | None = None
    unit: float | None = None       # of what the elastic law's layers give [Pa]
    alpha: float | None = None      # of what a correction's give
    strain: float | None = None     # below which a contraction reads strains as they are


class Tables(Table):
    """A law study."""

    scene: str                      # a file, from the folder of this one; or shipped
    title: str = ""
    method: str = "ours"            # of `nclaw.train.methods`
    set: dict = field(default_factory=dict)     # {path: value} of the scene
    laws: Answers = Answers()
    train: Recipe = field(default_factory=Recipe)
    weights: str | None = None      # file, from the folder of this one
    checkpoint: str | None = None   # likewise

    def __post_init__(self):
        one_of("method", self.method, METHOD_KINDS)
        with at("laws"):
            records_of(self.method, self.laws)

    @property
    def records(self):
        """Records of the kinds of answers of the elastic and of the plastic law; none of sys-id."""
        return records_of(self.method, self.laws)


def records_of(method, answers):
    """The same of a method and `Answers`. Raises ValueError for kinds that the method does not
    know, and for constants that they do not have.
    """
    given = answers.elastic, answers.plastic
    if method == SYS_ID and any(given):
        raise ValueError(f'elastic, plastic: method = "{SYS_ID}" learns the constants of the '
                         "scene's own laws; leave them out")
    names = [picked(part, name, known) for part, name, known in
             zip(PARTS, given, METHOD_KINDS[method], strict=False)]
    return with_constants([KINDS[name]() for name in names], unit=answers.unit,
                          alpha=answers.alpha, strain=answers.strain)


def picked(part, name, known):
    """The name of a kind: the given one, else the usual. Raises ValueError for an unknown one."""
    if name is None:
        return known[0]
    one_of(part, name, known)
    return name


def with_constants(records, **constants):
    """Records with those constants that are given. Raises ValueError for one that none has."""
    for name, value in constants.items():
        if value is None:
            continue
        if not any(name in record._fields for record in records):
            raise ValueError(f"{name} = {value}: none of these laws has it; leave it out")
        if not value > 0.0:
            raise ValueError(f"{name} = {value}: expected a positive number")
        records = [record._replace(**{name: value}) if name in record._fields else record
                   for record in records]
    return tuple(records)


def checked(data):
    """`Tables` of plain tables. Raises SceneError, which names the key."""
    check_finite(data)
    require_keys(data, Tables.__struct_encode_fields__)
    require_keys(data.get("laws"), Answers.__struct_encode_fields__, "laws")
    require_keys(data.get("train"), [one.name for one in fields(Recipe)], "train")
    given, method = data.get("train", {}), data.get("method")
    if isinstance(given, dict) and isinstance(method, str):
        data = data | {"train": USUAL.get(method, {}) | given}
    try:
        tables = msgspec.convert(data, Tables)
    except msgspec.ValidationError as fault:
        raise SceneError(rephrase(str(fault), data)) from None
    return tables
