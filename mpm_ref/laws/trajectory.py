"""The full-order run that laws are learned from, in a results file that is kept."""

from pathlib import Path

import numpy as np

from ..cases import Observed
from ..store import Fields, require_run
from ..store.results import Results
from ..store.running import Options, run

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
    """`cases.Observed` of a results file that is `whole`. Raises BadResults for one that lacks a
    field.
    """
    body, d = problem.bodies[0].name, problem.dim
    with Results(path) as results:
        x, v, C = (results.field(body, name) for name in FIELDS[:3])
        if results.has(body, J_ALONE):
            J = results.field(body, J_ALONE)
            return Observed(x, v, C, J[..., None, None] ** (1.0 / d) * np.eye(d))
        return Observed(x, v, C, results.field(body, FIELDS[3]))
