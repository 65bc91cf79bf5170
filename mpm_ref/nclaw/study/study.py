"""A law study: a scene, and the laws to be learned from its motion.

`load` reads it from a TOML file; docs/reference/studies.md explains the keys.
"""

from dataclasses import fields
from pathlib import Path
from typing import NamedTuple

import msgspec
from msgspec import Struct, field

from ...materials.learned.table import KINDS, is_identified
from ...materials.learned.weights import PARTS
from ...rom.study.study import base_scene
from ...rom.study.study_file import require_keys
from ...rom.study.tables import one_of
from ...scene import Scene, SceneError, build
from ...scene.messages import errors_at, errors_of, rephrase
from ...scene.toml import read_tables
from ...scene.validate import check_finite
from ..batched_step import make_world
from ..train.recipe import Recipe

SYS_ID = "sys-id"
CONTINUED = ("ours", "admissible")      # methods whose laws may go on from those of a file
RECOMMENDED = "admissible"      # of the methods, where a study names none
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


class LawStudyTable(Struct, frozen=True, kw_only=True):
    """A table of a study file."""


class AnswerTable(LawStudyTable):
    """The kinds of the laws, of `learned.table`; by default the usual ones of the method with their
    usual constants.
    """

    elastic: str | None = None
    plastic: str | None = None
    unit: float | None = None       # of what the elastic law's layers give [Pa]
    alpha: float | None = None      # of what a correction's give
    strain: float | None = None     # below which a contraction reads strains as they are


class LawStudyTables(LawStudyTable, rename={"overrides": "set"}):
    """The tables of a file of a law study."""

    scene: str                      # a file, from the folder of this one; or bundled
    title: str = ""
    method: str = RECOMMENDED       # of `nclaw.train.methods`
    overrides: dict = field(default_factory=dict)   # {path: value} of the scene
    laws: AnswerTable = AnswerTable()
    train: Recipe = field(default_factory=Recipe)
    start: str | None = None        # file of laws to go on from, from the folder of this one
    weights: str | None = None      # file, from there too
    checkpoint: str | None = None

    def __post_init__(self):
        one_of("method", self.method, METHOD_KINDS)
        if self.start is not None and (self.method not in CONTINUED
                                       or self.laws != AnswerTable()):
            raise ValueError(f'start = {self.start!r}: only laws of the methods '
                             f'{" and ".join(CONTINUED)} go on, with the kinds of their file; '
                             "write one of these and no `laws`")
        with errors_at("laws"):
            records_of(self.method, self.laws)

    @property
    def records(self):
        """Records of the kinds of the elastic and of the plastic law; none of sys-id."""
        return records_of(self.method, self.laws)


def records_of(method, answers):
    """Return the records of kinds of a method and an `AnswerTable`.

    Raises ValueError for kinds that the method does not have, and for constants that the kinds do
    not have.
    """
    given = answers.elastic, answers.plastic
    if method == SYS_ID and any(given):
        raise ValueError(f'elastic, plastic: method = "{SYS_ID}" learns the constants of the '
                         "scene's own laws; leave them out")
    names = [choose_kind(part, name, kinds) for part, name, kinds in
             zip(PARTS, given, METHOD_KINDS[method], strict=False)]
    return with_constants([KINDS[name]() for name in names], unit=answers.unit,
                          alpha=answers.alpha, strain=answers.strain)


def choose_kind(part, name, kinds):
    """Return the given name of a kind, or the usual one. Raises ValueError for an unknown one."""
    if name is None:
        return kinds[0]
    one_of(part, name, kinds)
    return name


def with_constants(records, **constants):
    """Return records with the constants that are given. Raises ValueError for one that none has."""
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


def parse_tables(data):
    """Return the `LawStudyTables` of plain tables. Raises SceneError, which names the key."""
    check_finite(data)
    require_keys(data, LawStudyTables.__struct_encode_fields__)
    require_keys(data.get("laws"), AnswerTable.__struct_encode_fields__, "laws")
    require_keys(data.get("train"), [one.name for one in fields(Recipe)], "train")
    given, method = data.get("train", {}), data.get("method", RECOMMENDED)
    if isinstance(given, dict) and isinstance(method, str):
        data = data | {"train": USUAL.get(method, {}) | given}
    try:
        return msgspec.convert(data, LawStudyTables)
    except msgspec.ValidationError as fault:
        raise SceneError(rephrase(str(fault), data)) from None


class LawStudy(NamedTuple):
    """A scene, and the settings of the laws that are learned from it."""

    path: Path
    scene: Scene            # with a frame for every step
    tables: LawStudyTables

    def file(self, name):
        """Return the path that a key of the study names, from its folder; or None."""
        given = getattr(self.tables, name)
        return None if given is None else self.path.parent / given

    def problem(self):
        """Return a new `Problem` of the scene."""
        return build(self.scene, str(self.path))

    @property
    def material(self):
        """The scene's record of its body's material."""
        return self.scene.body[0].material


def load(path, scenes=None):
    """Return the `LawStudy` of a TOML file; scenes {name: path} are those that it may name. Raises
    SceneError, which names the file and the key, also for a scene whose laws cannot be learned.
    """
    path = Path(path)
    data = read_tables(path)
    with errors_of(str(path)):
        tables = parse_tables(data)
        study = LawStudy(path, base_scene(tables, path.parent, scenes or {}), tables)
        require_learnable(study)
        start = study.file("start")
        if start is not None and not start.is_file():
            raise SceneError(f"start = {tables.start!r}: there is no such file of laws")
        return study


def require_learnable(study):
    """Raise SceneError for a scene whose steps training does not have (see
    `nclaw.batched_step`), and for one whose constants "sys-id" cannot learn.
    """
    problem = build(study.scene)
    try:
        make_world(problem)
    except ValueError as fault:
        raise SceneError(f"scene = {study.tables.scene!r}: {fault}") from None
    if study.tables.method == SYS_ID and not identifiable(study.material, problem.bodies[0]):
        raise SceneError(f'method = "{SYS_ID}": expected a material that is given by E and nu, '
                         'with the law "fixed_corotated", "hencky" or "fluid" and no flow, or '
                         '"drucker_prager" or "von_mises"')


def identifiable(material, body):
    """Return whether "sys-id" can learn the constants of a body's laws."""
    laws = zip(PARTS, (body.law, body.flow), strict=True)
    return all(is_identified(part, type(law)) for part, law in laws) and material.E is not None
