"""`mpm-ref info` of a law study."""

from dataclasses import asdict

from ..materials.learned.weights import PARTS
from ..nclaw.study.study import load
from ..nclaw.study.tables import SYS_ID
from ..reduced.study_file import plain
from ..scene import SceneError
from ..store.words import counted
from .law_options import OF_ERRORS
from .shipped import shipped_scenes

OWN = {"scene", "method", "laws", "train"}      # keys that no scene has


def is_one(path):
    """Whether a path is that of a law study, whatever is wrong with its tables, of all files but
    studies of reduced runs.
    """
    try:
        return bool(OWN & set(plain(path)))
    except SceneError:
        return False


def of_study(path):
    """Scene, method, laws and recipe of a study. Raises SceneError."""
    study = load(path, shipped_scenes())
    tables, scene, problem = study.tables, study.scene, study.problem()
    records = tables.records or (problem.bodies[0].law, problem.bodies[0].flow)
    return {
        "law_study": str(study.path), "title": tables.title, "scene": tables.scene,
        "dim": problem.dim, "points": len(problem.bodies[0].id), "dx": scene.dx, "dt": scene.dt,
        "steps": scene.steps, "method": tables.method,
        "laws": {part: {"kind": type(record).__name__, "constants": record._asdict()}
                 for part, record in zip(PARTS, records, strict=True)},
        "recipe": asdict(tables.train),
        "files": {name: str(study.file(name)) for name in ("weights", "checkpoint")
                  if study.file(name)},
    }


def lines(facts):
    """Facts of a law study in words."""
    recipe, method = facts["recipe"], facts["method"]
    yield (f"{facts['law_study']}: a law study, {facts['title'] or 'untitled'}: laws of the scene "
           f'{facts["scene"]}, method "{method}"')
    yield (f"{facts['dim']}D, {counted(facts['points'], 'point')}, dx = {facts['dx']:g} m, "
           f"{counted(facts['steps'], 'step')} of {facts['dt']:g} s")
    laws = "; ".join(f"{part} {law_line(law)}" for part, law in facts["laws"].items())
    yield f"{'constants of' if method == SYS_ID else 'laws'}: {laws}"
    horizon = "" if method in OF_ERRORS else (
        f", horizon {recipe['first']} .. {recipe['last']} steps")
    yield (f"training: {counted(recipe['epochs'], 'epoch')}{horizon}, rates "
           f"{recipe['elastic_rate']:g} (elastic) and {recipe['plastic_rate']:g} (plastic), seed "
           f"{recipe['seed']}")


def law_line(law):
    """A law in words."""
    return ", ".join([law["kind"], *(f"{name} = {value:g}" for name, value in
                                     law["constants"].items())])
