"""Deviation of the stress of laws from symmetry: tau = R T F^T is symmetric where T and S of F = R
S commute (NCLAW-X5).
"""

import numpy as np

from mpm_ref.explicit import initial_stress
from mpm_ref.materials import NoFlow
from mpm_ref.nclaw.bodies import (
    copy_body,
    deformation_gradients,
    kirchhoff_stresses,
    material_points,
)
from mpm_ref.nclaw.study.compare import positions
from mpm_ref.scene import build

from ..common.registry import experiment
from ..common.scenes import threads_for
from .dissipation import BOUND, tested_laws
from .environments import ENVIRONMENTS, environment

ROUND_OFF = 1e-12       # of the size of the stress
COLUMNS = ("method", "environment", "skew", "median", "most")


@experiment("nclaw.symmetry", title="NCLaw: how symmetric the stress of laws is",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 20})
def symmetry(run):
    """Skew parts of the stress at the deformation gradients of all points in frames of training
    runs.
    """
    laws, rows, every = tested_laws(run), [], run.choose(quick=50, standard=5)
    F = {name: visited_gradients(name, every) for name in run.progress(ENVIRONMENTS,
                                                                       "environments")}
    for (method, name), pair in laws.items():
        skew, size = split(pair.law, F[name])
        of_each = skew[size > 0.0] / size[size > 0.0]
        overall = np.sqrt(np.mean(skew**2) / np.mean(size**2))
        rows.append((method, name, overall, np.median(of_each), of_each.max()))
        record(run, rows[-1], len(size))
    run.table("skew", COLUMNS, rows)


def visited_gradients(name, every):
    """Return the deformation gradients (n, 3, 3) in an environment's run with its true law, of one
    step in `every`.
    """
    problem = build(environment(name, every=every))
    body = copy_body(problem.bodies[0])
    with threads_for(problem.bodies):
        return np.concatenate([deformation_gradients(body).copy()
                               for _ in positions(problem, (body,))])


def split(law, F):
    """Return the norms [Pa] (n,) of the skew part of a law's Kirchhoff stress, and of all of it."""
    body = material_points(law, NoFlow(), F)
    initial_stress(body)
    tau = kirchhoff_stresses(body)
    return (np.linalg.norm(a, axis=(1, 2)) for a in (0.5 * (tau - tau.mT), tau))


def record(run, row, n):
    """Record the skew part of a law's stress at n states."""
    method, name, overall, median, most = row
    rule = {"comparator": "<=", "bound": ROUND_OFF} if method in BOUND else {"comparator": "info"}
    run.record(f"nclaw.symmetry.{method}.{name}", overall, unit="1",
               scale=f"{n} states of the training run", **rule,
               note="root mean square of the skew part of tau over that of tau; of single states "
                    f"{median:.2g} in the median, {most:.2g} at most")
