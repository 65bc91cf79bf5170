"""From a study, a map and parameters to a reduced run that can be recorded."""

import msgspec

from ..scene import build
from .case import case
from .field import field, resampled
from .march import drawing, precise
from .record import Recording
from .watch import watch


def with_kind(study, kind):
    """The study with a map of another kind; None: its own. Raises ValueError for an unknown one,
    and for one that needs other settings than the study has.
    """
    if kind is None:
        return study
    map = msgspec.structs.replace(study.tables.map, kind=kind)
    return study._replace(tables=msgspec.structs.replace(study.tables, map=map))


def kind_of(model):
    """What a map is, in a word."""
    return model.about["map"]["kind"]


def require_way(one, model, run):
    """Raise ValueError where the samples of a reduced run of a `Case` do not suffice, or its map
    has not that precision.
    """
    precise(model.decoder, run.way)
    drawing(one, model.decoder, run.way)


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
