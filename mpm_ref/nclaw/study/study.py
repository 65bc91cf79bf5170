"""A law study: a scene, and the laws to be learned from its motion.

`load` reads it from a TOML file; docs/reference/studies.md explains the keys.
"""

from pathlib import Path
from typing import NamedTuple

from ...materials.learned.table import is_identified
from ...materials.learned.weights import PARTS
from ...rom.study.study import base_of
from ...rom.study.study_file import plain
from ...scene import Scene, SceneError, build
from ...scene.messages import opened_by
from ..batched_step import world
from .tables import SYS_ID, Tables, checked


class Study(NamedTuple):
    """What is learned from a scene."""

    path: Path
    scene: Scene            # every step of which is shown
    tables: Tables

    def file(self, name):
        """The path that a key of the study names, from its folder; or None."""
        given = getattr(self.tables, name)
        return None if given is None else self.path.parent / given

    def problem(self):
        """A new `Problem` of the scene."""
        return build(self.scene, str(self.path))

    @property
    def material(self):
        """The scene's record of what its body is made of."""
        return self.scene.body[0].material


def load(path, shipped=None):
    """The `Study` of a TOML file; shipped {name: path} are scenes that it may name. Raises
    SceneError, which names the file and the key, also for a scene whose laws cannot be learned.
    """
    path = Path(path)
    data = plain(path)
    with opened_by(str(path)):
        tables = checked(data)
        study = Study(path, base_of(tables, path.parent, shipped or {}), tables)
        require_learnable(study)
        return study


def require_learnable(study):
    """Raise SceneError for a scene whose steps are not those that training knows (see
    `nclaw.batched_step`), and for one whose constants "sys-id" cannot learn.
    """
    problem = build(study.scene)
    try:
        world(problem)
    except ValueError as fault:
        raise SceneError(f"scene = {study.tables.scene!r}: {fault}") from None
    if study.tables.method == SYS_ID and not identifiable(study.material, problem.bodies[0]):
        raise SceneError(f'method = "{SYS_ID}": expected a material that is given by E and nu, '
                         'with the law "fixed_corotated", "hencky" or "fluid" and no flow, or '
                         '"drucker_prager" or "von_mises"')


def identifiable(material, body):
    """Whether "sys-id" knows which constants of a body's laws to learn."""
    laws = zip(PARTS, (body.law, body.flow), strict=True)
    return all(is_identified(part, type(law)) for part, law in laws) and material.E is not None
