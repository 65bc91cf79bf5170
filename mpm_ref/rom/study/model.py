"""From a study, a map and parameters to a reduced run that can be recorded."""

import msgspec

from ...scene import build
from . import nsf_record as nsf
from .case import case
from .field import field, resampled
from .nsf_case import whole
from .record import Recording
from .reduce import model_of
from .run import drawing, precise
from .tables import CURVED, NSF
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
    if kind != CURVED or study.tables.model == NSF:
        return ""
    return (f'; a curved map needs a study that says so, {study.path} or a copy: in [map] kind = '
            f'"{CURVED}" and `modes` larger than `r`, in [run] projection = "nonlinear" '
            "(docs/reference/studies.md)")


def kind_of(model):
    """What a map is, in a word."""
    return model.about["map"]["kind"]


def require_way(one, model, run):
    """Raise ValueError where the samples of a reduced run of a `Case` do not suffice, or its map
    has not that precision.
    """
    precise(model.field, run.way)
    drawing(one, model.field, run.way)


def known_of(study, mu):
    """What the study's reduced model knows of the run with parameters mu: a `Case`, or a `Whole`.
    Raises ValueError for a scene that reduced runs do not know, and with `Whole` for samples that
    do not suffice.
    """
    if study.tables.model != NSF:
        return case(study.scene(mu))
    one = whole(study.scene(mu))
    nsf.require_samples(study.tables.run, one.X, study.tables.map.r)
    return one


def to_write(study, mu, count=None):
    """Bytes that the points of a reduced run with parameters mu take in its file, so many of them;
    None: those of the study. Raises ValueError for a scene that reduced runs do not know.
    """
    one, stored = known_of(study, mu), Recording.stored
    steps = one.problem.clock.steps
    if study.tables.model == NSF:
        steps, stored = round(steps / study.tables.run.faster), nsf.Recording.stored
    point = sum(a[0].nbytes for a in stored.of(one.problem.bodies[0]).values())
    return (steps + 1) * (count or len(one.X)) * point


def recording(study, model, mu, count=None):
    """`Recording` of a reduced run with parameters mu, shown at so many points of the body's shape;
    None: at those of the study. Raises ValueError for samples that do not suffice, a precision that
    the map has not, points that it does not know, and a scene that reduced runs do not know.
    """
    one, run = known_of(study, mu), study.tables.run
    facts = {"study": study.digest, "name": study.path.stem, "map": model.about["map"],
             "points": len(one.X),
             "parameters": dict(zip(study.names, map(float, mu), strict=True)),
             "run": msgspec.to_builtins(run), **model_of(study)}
    if study.tables.model == NSF:
        if count is not None:
            raise ValueError(f"--points-out {count}: reduced runs with inferred stress are shown "
                             f"at their own {len(one.X)} points; leave it out")
        return nsf.recording(one, model, mu, run, facts)
    require_way(one, model, run)
    shown = one.problem if count is None else build(resampled(study.scene(mu), count))
    return Recording(one, model, run, watch(one, model.field, model.xhat),
                     field(model.field, shown.bodies[0]), shown, facts)
