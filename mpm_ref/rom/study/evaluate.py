"""Reduced runs of a study beside the full-order runs that were held out, and beside the nearest
states of the map, which reduced runs on it seldom beat: the search for them goes on from each time
to the next.
"""

from math import inf
from typing import NamedTuple

import numpy as np

from ...store.atomic import replacing
from ..kinematics import NoBody
from ..projection import project_position
from ..step import BREAKDOWNS
from .case import case
from .errors import Errors, Squares
from .model import require_way
from .run import march

REDUCED, NEAREST = "reduced", "nearest"
WORDS = {REDUCED: "reduced run", NEAREST: "search of the map's nearest states"}


class Course(NamedTuple):
    """How far a run is off."""

    sums: np.ndarray        # what `Squares` adds up
    errors: Errors          # over all time levels; infinite where the run did not reach its end
    levels: np.ndarray      # error of each time level, of the distance from the scene's origin; NaN
                            # of those between longer steps
    said: str = ""          # the sentence with which it broke down


class Held(NamedTuple):
    """A run that was held out."""

    number: int
    mu: np.ndarray          # its parameters
    courses: dict           # {REDUCED, NEAREST: `Course`}
    stress: dict | None = None      # {REDUCED, NEAREST: (2,) sums of squares of the stress off, and
                                    # of the stress}, where it has a field of its own

    @property
    def broken(self):
        """{REDUCED, NEAREST: the sentence with which it broke down} of those that did."""
        return {name: course.said for name, course in self.courses.items() if course.said}


def evaluate(study, model, snapshots):
    """Yield a `Held` of each run of `Snapshots`, those of `study.test`. Raises ValueError for
    samples that do not suffice.
    """
    for number, mu, x in zip(study.test, snapshots.mu, snapshots.x, strict=True):
        one = case(study.scene(mu))
        require_way(one, model, study.tables.run)
        yield Held(number, mu, {
            REDUCED: course(one.X, x, reduced(one, model, study.tables.run)),
            NEAREST: course(one.X, x, nearest(one.X, x, model))})


def reduced(one, model, run):
    """Yield the positions (n, d) of a reduced run of a `Case`. Raises `NoBody` as `require_slow`
    does.
    """
    before = None
    for latent, _ in march(one, model.field, run.way, model.rest, run.seed):
        x = model.field.place(one.X, latent.xhat)
        require_slow(x, before, one.problem)
        before = x
        yield x


def require_slow(x, before, problem):
    """Raise `NoBody` where a point crosses more cells in a step than the scene allows, where a run
    that is recorded ends too; x (n, d) after the step, and before it, None at the start.
    """
    most = problem.limits.cfl
    if before is not None and not farthest(x - before) <= most * problem.dx:
        raise NoBody(f"a particle crosses more than {most:g} dx in a step")


def farthest(u):
    """Largest length of displacements u (n, d)."""
    return np.sqrt(np.max(np.sum(u**2, axis=1)))


def nearest(X, x, model):
    """Yield the positions (n, d) of a map's states that are nearest to x (k + 1, n, d)."""
    xhat = model.rest
    for reference in x:
        xhat = project_position(model.field, X, reference, xhat).y
        yield model.field.place(X, xhat)


def course(X, x, positions):
    """`Course` of positions beside those of the full model x (k + 1, n, d)."""
    sums, levels = Squares(X), []
    try:
        for at, reference in zip(positions, x, strict=True):
            sums.add(at, reference)
            if not np.isfinite(sums.sums).all():
                raise NoBody("the positions, or their squares, are not finite")
            levels.append(np.linalg.norm(at - reference) / np.linalg.norm(reference))
    except BREAKDOWNS as fault:
        said = f"step {len(levels)}: {' '.join(str(fault).split())}"
        return Course(np.full(4, inf), Errors(inf, inf, inf), np.array(levels), said)
    return Course(sums.sums, sums.errors, np.array(levels))


def together(found, X):
    """{REDUCED, NEAREST: `Errors`} of several `Held` as one."""
    errors = {}
    for name in (REDUCED, NEAREST):
        every = Squares(X)
        every.sums = sum(one.courses[name].sums for one in found)
        broken = not np.isfinite(every.sums).all()
        errors[name] = Errors(inf, inf, inf) if broken else every.errors
    return errors


def facts(study, found, all_runs):
    """Errors as plain values, as shares; infinite ones are of runs that broke down."""
    def plain(errors):
        return {name: errors[name]._asdict() for name in (REDUCED, NEAREST)}

    return {"all": plain(all_runs), "runs": [
        {"number": one.number, "parameters": dict(zip(study.names, one.mu.tolist(), strict=True)),
         **plain({name: course.errors for name, course in one.courses.items()}),
         "broken": one.broken} for one in found]}


def breakdowns(study, found):
    """Sentences about the courses that broke down, with their runs' parameters."""
    for one in found:
        of = ", ".join(f"{name} = {value:g}" for name, value in
                       zip(study.names, one.mu, strict=True))
        for name, said in one.broken.items():
            yield f"run {one.number} ({of}): the {WORDS[name]} broke down in {said}"


def lines(study, found, all_runs):
    """Errors as a table in per cent."""
    head = ["run", *study.names, *2 * ("origin", "centroid", "displaced")]
    rows = [[str(one.number), *(f"{value:.4g}" for value in one.mu),
             *_in_per_cent({name: course.errors for name, course in one.courses.items()})]
            for one in found]
    rows.append(["all", *("" for _ in study.names), *_in_per_cent(all_runs)])
    width = 2 + max(9, *(len(name) for name in study.names))
    return ["position errors [%] of reduced runs, then of the map's nearest states: of the "
            "distance from the scene's origin, from the body's centroid, of the displacement",
            *("".join(f"{cell:>{width}}" for cell in row) for row in (head, *rows))]


def _in_per_cent(errors):
    return [f"{100.0 * error:.3g}" for name in (REDUCED, NEAREST) for error in errors[name]]


def draw(found, names, dt, out):
    """Write a picture of the errors over time, a colour for each run: png, pdf or svg."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 4.0), layout="constrained")
    axes = figure.add_subplot()
    for k, one in enumerate(found):
        words = ", ".join(f"{name} = {value:.4g}" for name, value in
                          zip(names, one.mu, strict=True))
        for name, style in ((REDUCED, "-"), (NEAREST, ":")):
            levels = one.courses[name].levels
            known = np.flatnonzero(np.isfinite(levels))
            axes.plot(dt * known, 100.0 * levels[known], style, color=f"C{k % 10}",
                      label=words if name == REDUCED else None)
    axes.set(xlabel="t [s]", ylabel="position error [%]", title="reduced runs; dotted: the map's "
             "nearest states")
    axes.legend(fontsize=7)
    with replacing(out) as part:
        figure.savefig(part)
