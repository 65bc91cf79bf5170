"""The full-order runs of a study: read from the folder where `generate` put them, or simulated.

LDM's are `Snapshots`, with deformation gradient and velocity; NSF's are `Histories`, with stress
and affine field, a frame at a time. Both are of all points of a scene, one body after the other.
"""

import numpy as np
from msgspec.structs import replace

from ...simulate import simulate
from ...store.memmap import empty
from ...store.results import BadResults, Results
from ...trajectories import history
from ..snapshots import Histories, Snapshots
from ..symmetric import values
from .full_model import field_of, nsf_full_model, points_of
from .generate import file_of, is_finished


class Missing(ValueError):
    """Runs of a study that are not there, or not finished."""


def load(study, folder, numbers):
    """Return the training data of the runs of these numbers, as the study's method reads them.
    Raises `Missing`, `BadResults` for files that are damaged, no results, or of another scene, and
    OSError as `memmap.empty` does.
    """
    again = f"mpm-ref rom generate {study.path} --out {folder}"
    try:
        lacking = [k for k in numbers
                   if not is_finished(file_of(folder, k), study.scene(study.mu[k]))]
        if lacking:
            raise Missing(f"{folder} lacks {len(lacking)} of {len(numbers)} runs, the first is "
                          f"{file_of(folder, lacking[0]).name}: {again}")
        return study.method.load(study, folder, numbers)
    except BadResults as fault:
        raise BadResults(f"{fault}; remove the file, and make it again: {again}") from fault


def load_snapshots(study, folder, numbers):
    """Return the `Snapshots` of finished runs of LDM."""
    runs = []
    for k in numbers:
        with Results(file_of(folder, k)) as results:
            runs.append(tuple(joined_field(results, name, 1) for name in ("x", "F", "v")))
    with Results(file_of(folder, numbers[0])) as results:
        m, V0 = (joined_field(results, name, 0) for name in ("m", "V0"))
    x, F, v = (np.stack(field) for field in zip(*runs, strict=True))
    return Snapshots(x[0, 0].copy(), m, V0, study.mu[list(numbers)], x, F, v, study.base.dt)


def joined_field(results, name, axis):
    """Return a field of all bodies of a results file, in all frames, one body after the other along
    an axis.
    """
    fields = [results.field(body, name) for body in results.bodies]
    return fields[0] if len(fields) == 1 else np.concatenate(fields, axis)


def load_histories(study, folder, numbers, kind=np.float32):
    """Return the `Histories` of finished runs of NSF, stored as numbers of a kind; dt is the time
    between stored states. Raises ValueError as `nsf_full_model` does, OSError as `memmap.empty`
    does, and `BadResults`.
    """
    runs = [nsf_full_model(study.scene(study.mu[k])) for k in numbers]
    base, (n, d) = study.base, runs[0].X.shape
    levels = base.steps // base.every + 1
    x, C = (empty((len(runs), levels, n, k), kind) for k in (d, d * d))
    tau = empty((len(runs), levels, n, d * (d + 1) // 2), kind)
    for run, k in enumerate(numbers):
        with Results(file_of(folder, k)) as results:
            for level in range(levels):
                x[run, level] = frame_field(results, "x", level)
                tau[run, level] = values(frame_field(results, "tau", level))
                C[run, level] = frame_field(results, "C", level).reshape(n, -1)
    first = runs[0]
    return Histories(first.X, first.m, first.V0, np.stack([one.v for one in runs]),
                     study.mu[list(numbers)], x, tau, C, base.every * base.dt)


def frame_field(results, name, frame):
    """Return a field of all bodies of a results file in a frame, one body after the other."""
    return np.concatenate([results.field(body, name, frame) for body in results.bodies])


def simulate_snapshots(problems, mu, every=1):
    """Return the `Snapshots` of runs of problems that differ by parameters mu (s, parameters)
    alone; of one point in `every`.

    Raises ValueError where their points or time steps differ, and as `history` does for more than
    one body.
    """
    rest, dt, runs = None, None, []
    for problem in problems:
        points = points_of(problem.bodies[:1])[:3]
        if rest is None:
            rest, dt = points, problem.clock.dt
        if dt != problem.clock.dt or not all(map(np.array_equal, points, rest)):
            raise ValueError(f"run {len(runs)} has other points or another time step than run 0: "
                             "expected runs that differ by their parameters alone")
        runs.append(history(problem, every))
    return Snapshots(*(a[::every] for a in rest), np.asarray(mu, dtype=float), *(
        np.stack(field) for field in zip(*runs, strict=True)), dt)


def simulate_history(scene, mu, kind=np.float64, every=1):
    """Return the `Histories` of one run of a scene with parameters mu, of one step in `every`;
    stored as numbers of a kind.

    Raises ValueError as `nsf_full_model` does, where the time step is adaptive, and where `every`
    does not divide the number of steps; `Unstable` and `TooLarge` as `simulate` does.
    """
    full = nsf_full_model(replace(scene, every=every, interval=None))
    clock, (n, d) = full.problem.clock, full.X.shape
    if clock.dt is None:
        raise ValueError("the time step is adaptive: expected a fixed dt")
    if clock.steps % every:
        raise ValueError(f"one in {every} of {clock.steps} steps: expected a divisor of the steps, "
                         "so that the last is one of them")
    levels = clock.steps // every + 1
    x, C = (np.empty((1, levels, n, k), kind) for k in (d, d * d))
    tau = np.empty((1, levels, n, d * (d + 1) // 2), kind)
    for frame in simulate(full.problem):
        bodies = frame.state.bodies
        x[0, frame.index] = field_of(bodies, "x")
        tau[0, frame.index] = values(field_of(bodies, "tau"))
        C[0, frame.index] = field_of(bodies, "C").reshape(n, -1)
    return Histories(full.X, full.m, full.V0, full.v[None], np.array(mu, dtype=float)[None],
                     x, tau, C, every * clock.dt)
