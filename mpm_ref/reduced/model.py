"""From a study, a map and parameters to a reduced run that can be recorded."""

import msgspec

from ..scene import build
from ..store import Fields
from .case import case
from .field import field, resampled
from .march import drawing, precise
from .record import Recording
from .tables import CURVED
from .watch import watch


def with_kind(study, kind):
    """The study with a map of another kind; None: its own. Raises ValueError for an unknown one,
    and for one that needs other settings than the study has.
    """
    if kind is None:
        return study
    replace = msgspec.structs.replace
    try:
        map = replace(study.tables.map, kind=kind)
        return study._replace(tables=replace(study.tables, map=map))
    except ValueError as fault:
        raise ValueError(f"{fault}{needed(study, kind)}") from None


def needed(study, kind):
    """What a study lacks for a map of a kind, if that is known, in words."""
    if kind != CURVED:
        return ""
    return (f'; a curved map needs a study that says so, {study.path} or a copy: in [map] kind = '
            f'"{CURVED}" and `modes` larger than `r`, in [run] projection = "nonlinear" '
            "(docs/reduced.md)")


def kind_of(model):
    """What a map is, in a word."""
    return model.about["map"]["kind"]


def require_way(one, model, run):
    """Raise ValueError where the samples of a reduced run of a `Case` do not suffice, or its map
    has not that precision.
    """
    precise(model.decoder, run.way)
    drawing(one, model.decoder, run.way)


def to_write(study, mu, count=None):
    """Bytes that the points of a reduced run with parameters mu take in its file, so many of them;
    None: those of the study. Raises ValueError for a scene that reduced runs do not know.
    """
    one = case(study.scene(mu))
    point = sum(a[0].nbytes for a in Fields().of(one.problem.bodies[0]).values())
    return (one.problem.clock.steps + 1) * (count or len(one.X)) * point


def recording(study, model, mu, count=None):
    """`Recording` of a reduced run with parameters mu, shown at so many points of the body's shape;
    None: at those of the study. Raises ValueError for samples that do not suffice, a precision that
    the map has not, and a scene that reduced runs do not know.
    """
    scene, run = study.scene(mu), study.tables.run
    one = case(scene)
    require_way(one, model, run)
    shown = one.problem if count is None else build(resampled(scene, count))
    facts = {"study": study.digest, "name": study.path.stem, "map": model.about["map"],
             "points": len(one.X),
             "parameters": dict(zip(study.names, map(float, mu), strict=True)),
             "run": msgspec.to_builtins(run)}
    return Recording(one, model, run, watch(one, model.decoder, model.xhat),
                     field(model.decoder, shown.bodies[0]), shown, facts)
