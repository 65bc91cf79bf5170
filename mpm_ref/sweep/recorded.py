"""Quantities of interest of a results file, such as that of a reduced model or of another code.

Between two frames a quantity is interpolated linearly in time. Particles that bear the masses of
the file carry the scene's probes along, with weights from their positions in its first frame.
"""

from math import ceil, sqrt
from typing import Annotated, NamedTuple

import msgspec
import numpy as np
from scipy.spatial import cKDTree

from ..scene import SceneError
from ..store.results import ENERGIES, Results
from .difference import largest_change
from .observation import FINISHED, RunCost, RunObservation
from .probes import interpolation
from .quantity import OutputQuantity, Snapshot

LATE = 1e-6             # of the run by which a file may end before it
SHARE = 0.1             # of the error asked, which the interpolation between frames may have
NEAR = 1e-9             # of the run, within which a frame is at a time
COLUMNS = {"energy": (0, 1, 2), **{name: (k,) for k, name in enumerate(ENERGIES)}}


class PartCost(msgspec.Struct):
    """The cost of a part of a run, as a manifest has it [s]."""

    cpu_s: Annotated[float, msgspec.Meta(ge=0.0)]
    wall_s: Annotated[float, msgspec.Meta(ge=0.0)]


class RunParts(msgspec.Struct):
    """The parts of a run in a manifest."""

    parts: list[PartCost]


class RecordedParticles(NamedTuple):
    """The stored fields of a body's particles in one frame; None for what is not stored."""

    x: np.ndarray
    m: np.ndarray
    V0: np.ndarray
    v: np.ndarray | None
    F: np.ndarray | None    # J (N,) of a fluid
    tau: np.ndarray | None


class RecordedBody(NamedTuple):
    """A body in one frame, as quantities read it."""

    name: str
    particles: RecordedParticles


class ProblemFacts(NamedTuple):
    """The entries of a problem that quantities read."""

    dim: int


def observe_results(path, observed, error=np.inf):
    """Return the `RunObservation` of a results file, with the quantities of an `ObservedRun`.

    error: relative, of which `SHARE` may be that of the interpolation in time. A quantity that
    the file cannot give, such as an impulse, is NaN. The cost is that of the whole run, with its
    start and output, if the file says so. Raises `BadResults` for a file that cannot be read,
    SceneError for one of another problem or with too few frames.
    """
    with Results(path) as results:
        require_same_problem(results, observed)
        require_same_start(results, observed)
        series, times = series_of(results, observed), observed.times
        if not has_frames_at(times, results.time):
            require_dense(path, series, error)
        values = {text: at_times(series[text], results.time, times) if text in series
                  else np.full((len(times), 1), np.nan) for text in observed.quantities}
        return RunObservation(values, cost_of(results), FINISHED, until=times[-1])


def require_same_problem(results, observed):
    """Raise SceneError unless a results file has the bodies, dimension and end of a run."""
    names = sorted(body for body, _ in observed.probes)
    if sorted(results.bodies) != names:
        raise SceneError(f"{results.path}: bodies {', '.join(sorted(results.bodies))}; expected "
                         f"those of the scene: {', '.join(names)}")
    dim = len(observed.probes[0][1][0])
    if results.dim != dim:
        raise SceneError(f"{results.path}: a run in {results.dim}D; the scene is in {dim}D")
    if not len(results) or not (np.diff(results.time) > 0.0).all():
        raise SceneError(f"{results.path}: expected frames at increasing times")
    first, last, end = results.time[0], results.time[-1], observed.times[-1]
    if first > LATE * end or last < end * (1.0 - LATE):
        raise SceneError(f"{results.path}: frames from t = {first:.6g} to {last:.6g} s; expected "
                         f"a run from 0 to the scene's end at {end:.6g} s")


def require_same_start(results, observed):
    """Raise SceneError where a body of a results file is not at first where the scene has it."""
    for body, X in observed.probes:
        distance = np.max(cKDTree(results.field(body, "x", 0)).query(X)[0])
        if not distance <= results.dx:
            raise SceneError(f"{results.path}: {body} has no matter within {results.dx:.3g} m of "
                             "where it is at the start of the scene; expected a run of the same "
                             "problem")


def has_frames_at(times, t):
    """Return whether there is a frame, of those at times t, at each of some times."""
    return bool(np.all(np.min(np.abs(np.subtract.outer(times, t)), axis=1) <= NEAR * times[-1]))


def require_dense(path, series, error):
    """Raise SceneError if linear interpolation between frames errs by too much of the error asked.

    Its error is an eighth of the second difference.
    """
    for text, rows in series.items():
        second = np.diff(rows, 2, axis=0) if len(rows) > 2 else rows[-1:] - rows[:1]
        gap = np.max(np.sqrt(np.mean(second**2, axis=1))) / 8.0 / largest_change(rows)
        if gap > SHARE * error:
            enough = ceil(len(rows) * sqrt(gap / (SHARE * error)))
            raise SceneError(f"{path}: {len(rows)} frames, between which {text} is known to "
                             f"{100.0 * gap:.2g} % only; expected at most {100.0 * SHARE:g} % of "
                             f"the error asked: about {enough} frames would do where the motion "
                             "is smooth (`interval` of the scene)")


def series_of(results, observed):
    """Return {text: values (frames, k)} of the quantities that a file can give."""
    quantities = [OutputQuantity(text) for text in observed.quantities]
    series = {one.text: results.energy[:, COLUMNS[one.kind]].sum(axis=1, keepdims=True)
              for one in quantities if one.kind in COLUMNS}
    others = [one for one in quantities if one.kind not in COLUMNS and is_stored(one, results)]
    rows = [[one.sample(snapshot) for one in others] for snapshot in snapshots(results, observed)]
    return series | {one.text: np.array([row[k] for row in rows])
                     for k, one in enumerate(others)}


def snapshots(results, observed):
    """Yield the `Snapshot` of each frame."""
    starts = {body: np.asarray(X, dtype=float) for body, X in observed.probes}
    weights = {body: interpolation(results.field(body, "x", 0), X) for body, X in starts.items()}
    for frame in range(len(results)):
        bodies = [body_of(results, name, frame) for name in results.bodies]
        probes = {body.name: weights[body.name] @ body.particles.x for body in bodies}
        yield Snapshot(ProblemFacts(results.dim), bodies, probes, starts, {})


def is_stored(quantity, results):
    """Return whether a file has what a quantity is computed from."""
    if quantity.kind == "mean":
        return results.offers(quantity.record.field)
    return quantity.kind not in ("impulse", "force")


def at_times(series, t, times):
    """Return values (T, k) at some times of a series (frames, k) at times t."""
    return np.stack([np.interp(times, t, column) for column in series.T], axis=1)


def body_of(results, name, frame):
    """Return the `RecordedBody` of a name in a frame."""
    def stored(field):
        return results.field(name, field, frame) if results.has(name, field) else None
    m, V0 = results.field(name, "m"), results.field(name, "V0")
    F = stored("J") if results.has(name, "J") else stored("F")
    return RecordedBody(name, RecordedParticles(stored("x"), m, V0, stored("v"), F,
                                                stored("tau")))


def cost_of(results):
    """Return the `RunCost` of the whole run of a results file, NaN where it does not say."""
    try:
        parts = msgspec.convert(results.manifest, RunParts).parts
    except msgspec.ValidationError:
        parts = []
    cpu, wall = (sum(getattr(part, key) for part in parts) if parts else np.nan
                 for key in ("cpu_s", "wall_s"))
    return RunCost(cpu, wall, int(results.step[-1]), sum(map(results.count, results.bodies)))
