"""The full-order run that laws are learned from, in a results file that is kept."""

from pathlib import Path

import numpy as np

from ...store.results import BadResults, Results
from ...store.running import Options, run
from ...store.writer import Fields, require_run
from ...trajectories import Observed

FIELDS = ("x", "v", "C", "F")
J_ALONE = "J"


def whole(path, problem):
    """Whether a results file holds all steps of a problem. Raises BadResults for a file that is no
    results file, or of another scene.
    """
    if not Path(path).exists():
        return False
    with Results(path) as results:
        require_run(results.h5, path, problem, 0)
        return len(results) == problem.clock.steps + 1


def make(path, problem, watch=None):
    """Run a problem into a results file, from its checkpoint if there is one; returns the steps
    that it has then, fewer than all where it was interrupted. Raises as `store.running.run`.
    """
    options = Options(fields=Fields(FIELDS), resume=True)
    return run(problem, path, options, watch).state.step


def read(path, problem):
    """`Observed` of a results file that is `whole`. Raises BadResults for one that lacks a
    field, or whose numbers are not all finite.
    """
    body, d = problem.bodies[0].name, problem.dim
    with Results(path) as results:
        found = {name: results.field(body, name) for name in FIELDS[:3]}
        last = J_ALONE if results.has(body, J_ALONE) else FIELDS[3]
        found[last] = results.field(body, last)
    require_finite(path, found)
    J = found.pop(J_ALONE, None)
    if J is not None:
        found["F"] = J[..., None, None] ** (1.0 / d) * np.eye(d)
    return Observed(**found)


def require_finite(path, fields):
    """Raise BadResults unless {name: field (k + 1, n, ..)} are finite numbers."""
    for name, a in fields.items():
        lost = np.argwhere(~np.isfinite(a))
        if len(lost):
            k, p = lost[0][:2]
            raise BadResults(f"{path}: {name} of particle {p} after step {k} is {a[k, p]}: "
                             "expected finite numbers to learn from; make the run again")
