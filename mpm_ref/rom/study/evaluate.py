"""Reduced runs of a study compared with the full-order runs that were held out, and with the
nearest states of the model, which reduced runs on it seldom beat: the search for these goes on from
each time level to the next.

Errors of the position are accumulated over all points and time levels (LDM-err): for LDM the start
included, for NSF without it (NSF-eq11). Errors of NSF's Kirchhoff stress likewise, over its norm.
"""

from math import inf, nan
from typing import NamedTuple

import numpy as np

from ...store.atomic import replacing
from ..kinematics import NoBody
from ..latent import nearest
from ..step import BREAKDOWNS
from ..symmetric import values
from .errors import PositionErrors, Squares
from .run import step_count
from .samples import ENOUGH

REDUCED, NEAREST = "reduced", "nearest"
LABELS = {REDUCED: "reduced run", NEAREST: "search of the map's nearest states"}
EVEN = 1e-6         # of a level: a state this near to one is compared with it


class PathErrors(NamedTuple):
    """Errors of a sequence of reduced states."""

    sums: np.ndarray        # the sums of `Squares`
    errors: PositionErrors  # over all time levels; infinite where the run did not reach its end
    levels: np.ndarray      # error of each time level, of the distance from the scene's origin; NaN
                            # of those that were not reached, or lie between longer steps
    breakdown: str = ""     # the sentence with which it broke down
    stress: np.ndarray | None = None    # (2,) sums of squares of the stress error, and of the
                                        # stress; None of a model without a stress of its own


class HeldOutRun(NamedTuple):
    """The errors in a run that was held out."""

    number: int
    mu: np.ndarray          # its parameters
    paths: dict             # {REDUCED, NEAREST: `PathErrors`}

    @property
    def breakdowns(self):
        """{REDUCED, NEAREST: sentence} of the paths that broke down."""
        return {name: path.breakdown for name, path in self.paths.items() if path.breakdown}


class ReferenceRun(NamedTuple):
    """A full-order run that reduced states are compared with."""

    X: np.ndarray               # (n, d) at rest [m]
    x: np.ndarray               # (k + 1, n, d) positions [m]
    tau: np.ndarray | None      # (k + 1, n, d(d+1)/2) stress [Pa], values of `symmetric`; or None
    first: int = 0              # the first time level whose error counts
    every_level: bool = True    # each state is at one of the time levels, in their order


def history_reference(histories, k=0):
    """Return run k of `Histories` as a `ReferenceRun`."""
    return ReferenceRun(histories.X, histories.x[k], histories.tau[k], 1, False)


def evaluate(study, model, data):
    """Yield a `HeldOutRun` of each run of `Snapshots` or `Histories`, those of `study.test`. Raises
    ValueError for samples that do not suffice, and for steps that end at no stored state.
    """
    method, levels = study.method, levels_of(study)
    for k, number in enumerate(study.test):
        mu = data.mu[k]
        full = method.full_model(study.scene(mu))
        field = method.field_of_run(model.field, full, mu)
        run = method.reduced_run(study, full, field, model.rest)
        reference = method.reference(full, data, k)
        points = method.point_names(full)
        search = nearest_states(field, reference.x, model.rest, points, method.search_points(full))
        nearest_path = ((level if level in levels else None, xhat) for level, xhat in search)
        reduced_path = run_states(run, field, points, full.problem, study.base)
        yield HeldOutRun(number, mu, {
            REDUCED: path_errors(field, reference, reduced_path, points),
            NEAREST: path_errors(field, reference, nearest_path, points)})


def levels_of(study):
    """Return the numbers of the stored states at which a step of a reduced run ends. Raises
    ValueError where only the start is one.
    """
    factor, base = getattr(study.tables.run, "dt_factor", 1.0), study.base
    ends = range(step_count(base, factor) + 1)
    levels = {level_of(step * factor / base.every) for step in ends} - {None}
    if not any(0 < level <= base.steps // base.every for level in levels):
        raise ValueError(f"dt_factor = {factor:g}: expected steps of which some end at a stored "
                         f"state, one every {base.every} steps of the scene; take a simple "
                         "fraction such as 1.5 or 2")
    return levels


def level_of(time):
    """Return the level that a time, in levels, is at; None between two."""
    return round(time) if abs(time - round(time)) < EVEN else None


def run_states(run, field, points, problem, base):
    """Yield (level or None, latent coordinates) of each state of a `ReducedRun`; base: the scene of
    the study. Raises `NoBody` as `require_slow` does.
    """
    spacing, before = base.every * base.dt, None
    for state in run.states():
        x = field.place(points, state.latent.xhat)
        require_slow(x, before, problem)
        before = x
        yield level_of(state.t / spacing), state.latent.xhat


def require_slow(x, before, problem):
    """Raise `NoBody` where a point crosses more cells in a step than the scene allows, where a run
    that is recorded ends too; x (n, d) after the step, and before it, None at the start.
    """
    most = problem.limits.cfl
    if before is not None and not largest_length(x - before) <= most * problem.dx:
        raise NoBody(f"a particle crosses more than {most:g} dx in a step")


def largest_length(u):
    """Return the largest length of displacements u (n, d)."""
    return np.sqrt(np.max(np.sum(u**2, axis=1)))


def nearest_states(field, x, xhat, points=None, search=None):
    """Yield (level, latent coordinates) of the states nearest to positions x (k + 1, n, d),
    searched from xhat on. points: names of all points, as the field takes them (default: their
    numbers); search: slice of those that the search uses (default: at most `samples.ENOUGH`).
    """
    n = x.shape[1]
    points = np.arange(n) if points is None else points
    search = slice(None, None, -(-n // ENOUGH)) if search is None else search
    for level, reference in enumerate(x):
        xhat = nearest(field, points[search], reference[search].astype(float), xhat)
        yield level, xhat


def path_errors(field, reference, states, points=None):
    """Return the `PathErrors` of states (level or None, latent coordinates) compared with a
    `ReferenceRun`. points: names of all points, as the field takes them (default: their numbers).
    Raises ValueError for another number of states than time levels where these go together.
    """
    points = np.arange(len(reference.X)) if points is None else points
    x, tau, step = reference.x, reference.tau, 0
    squares, levels = Squares(reference.X), np.full(len(x), np.nan)
    stress = None if tau is None else np.zeros(2)
    try:
        for level, xhat in states:
            if level is not None and level < len(x):
                position, expected = field.place(points, xhat), x[level].astype(float)
                if level >= reference.first:
                    squares.add(position, expected)
                    if tau is not None:
                        stress += square_sums(values(field.stress(points, xhat)),
                                              tau[level].astype(float))
                require_finite(squares, stress)
                levels[level] = np.linalg.norm(position - expected) / np.linalg.norm(expected)
            step += 1
    except BREAKDOWNS as fault:
        message = f"step {step}: {' '.join(str(fault).split())}"
        return PathErrors(np.full(4, inf), PositionErrors(inf, inf, inf), levels, message,
                          None if tau is None else np.full(2, inf))
    if reference.every_level and step != len(x):
        raise ValueError(f"{step} states compared with {len(x)} time levels: expected as many")
    return PathErrors(squares.sums, squares.errors, levels, stress=stress)


def require_finite(squares, stress):
    """Raise `NoBody` where sums of squares are not finite."""
    if stress is None and not np.isfinite(squares.sums).all():
        raise NoBody("the positions, or their squares, are not finite")
    if stress is not None and not (np.isfinite(squares.sums).all() and np.isfinite(stress).all()):
        raise NoBody("the positions or stresses, or their squares, are not finite")


def square_sums(a, reference):
    """Return sums of squares (2,) of the error of values, and of the reference."""
    return np.array([np.sum((a - reference) ** 2), np.sum(reference**2)])


def total_errors(runs, X):
    """Return {REDUCED, NEAREST: `PositionErrors`} of several `HeldOutRun`s together."""
    errors = {}
    for name in (REDUCED, NEAREST):
        total = Squares(X)
        total.sums = sum(run.paths[name].sums for run in runs)
        broken = not np.isfinite(total.sums).all()
        errors[name] = PositionErrors(inf, inf, inf) if broken else total.errors
    return errors


def facts(study, runs, total):
    """Return errors as plain values, as shares; infinite ones are of runs that broke down."""
    def plain(errors):
        return {name: errors[name]._asdict() for name in (REDUCED, NEAREST)}

    return {"all": plain(total), "runs": [
        {"number": run.number, "parameters": dict(zip(study.names, run.mu.tolist(), strict=True)),
         **plain({name: path.errors for name, path in run.paths.items()}),
         "broken": run.breakdowns} for run in runs]}


def breakdown_warnings(study, runs):
    """Yield sentences about the paths that broke down, with their runs' parameters."""
    for run in runs:
        parameters = ", ".join(f"{name} = {value:g}" for name, value in
                               zip(study.names, run.mu, strict=True))
        for name, message in run.breakdowns.items():
            yield f"run {run.number} ({parameters}): the {LABELS[name]} broke down in {message}"


def lines(study, runs, total):
    """Return errors as a table in per cent."""
    head = ["run", *study.names, *2 * ("origin", "centroid", "displaced")]
    rows = [[str(run.number), *(f"{value:.4g}" for value in run.mu),
             *_in_per_cent({name: path.errors for name, path in run.paths.items()})]
            for run in runs]
    rows.append(["all", *("" for _ in study.names), *_in_per_cent(total)])
    width = 2 + max(9, *(len(name) for name in study.names))
    return ["position errors [%] of reduced runs, then of the map's nearest states: of the "
            "distance from the scene's origin, from the body's centroid, of the displacement",
            *("".join(f"{cell:>{width}}" for cell in row) for row in (head, *rows))]


def _in_per_cent(errors):
    return [f"{100.0 * error:.3g}" for name in (REDUCED, NEAREST) for error in errors[name]]


def stress_share(sums):
    """Return the error that sums of squares (2,) make: infinite of a run that broke down, NaN where
    there is no stress.
    """
    if np.isinf(sums).any():
        return inf
    return float(np.sqrt(sums[0] / sums[1])) if sums[1] > 0.0 else nan


def stress_errors(runs):
    """Return errors of the stress of several `HeldOutRun`s: of all, and of each, {REDUCED, NEAREST:
    share}.
    """
    sums = [{name: path.stress for name, path in run.paths.items()} for run in runs]
    total = {name: stress_share(sum(one[name] for one in sums)) for name in (REDUCED, NEAREST)}
    return total, [{name: stress_share(one[name]) for name in one} for one in sums]


def stress_facts(runs):
    """Return errors of the stress as plain values, as shares."""
    total, each = stress_errors(runs)
    return {"all": total, "runs": [
        {"number": run.number, **shares} for run, shares in zip(runs, each, strict=True)]}


def stress_lines(runs):
    """Return errors of the stress as a table in per cent."""
    total, each = stress_errors(runs)
    rows = [("run", REDUCED, NEAREST)]
    for name, shares in zip([*(run.number for run in runs), "all"], [*each, total], strict=True):
        rows.append((name, *(f"{100.0 * shares[kind]:.3g}" for kind in (REDUCED, NEAREST))))
    return ["errors of the Kirchhoff stress [%], of its norm: of reduced runs, then of the nearest "
            "states", *("".join(f"{cell:>11}" for cell in row) for row in rows)]


def draw(runs, names, dt, out):
    """Write a picture of the errors over time, a colour for each run: png, pdf or svg."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 4.0), layout="constrained")
    axes = figure.add_subplot()
    for k, run in enumerate(runs):
        label = ", ".join(f"{name} = {value:.4g}" for name, value in
                          zip(names, run.mu, strict=True))
        for name, style in ((REDUCED, "-"), (NEAREST, ":")):
            levels = run.paths[name].levels
            finite = np.flatnonzero(np.isfinite(levels))
            axes.plot(dt * finite, 100.0 * levels[finite], style, color=f"C{k % 10}",
                      label=label if name == REDUCED else None)
    axes.set(xlabel="t [s]", ylabel="position error [%]", title="reduced runs; dotted: the map's "
             "nearest states")
    axes.legend(fontsize=7)
    with replacing(out) as part:
        figure.savefig(part)
