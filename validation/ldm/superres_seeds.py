"""Table 4's Lagrangian errors over several trainings of the map: `ldm.table4` has one of them."""

import numpy as np

from mpm_ref.rom.study.errors import Squares
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import SCHEMES, RunOptions
from mpm_ref.scene import build
from mpm_ref.trajectories import history

from ..common.registry import experiment
from ..common.scenes import threads_for
from .networks import SEEDS, trained
from .references import record_seeds
from .studies import TORSION
from .superres import FINE, REFINE, fine, reduced

NAME = "ldm.table4-seeds"
NETS = tuple(f"torsion-{seed}" for seed in range(SEEDS))
LAGRANGIAN = tuple(RunOptions(*scheme) for scheme in SCHEMES if scheme[0] == "lagrangian")


@experiment(NAME, title="LDM: more points than it was trained on, over three trainings",
            profiles=("quick", "standard"), budget={"quick": 25, "standard": 500})
def seeds(run):
    """Record the errors of each training over the test runs, their median and their spread."""
    options = run.choose(quick=LAGRANGIAN[1:], standard=LAGRANGIAN)
    tests = TORSION.test[:run.choose(quick=1, standard=None)]
    found = {(net, one.name): np.zeros(4) for one in options for net in NETS}
    for k in run.progress(tests, "runs"):
        sums = run.cached(f"run.{k}", lambda k=k: squares(k, options))
        for key, own in zip(found, sums, strict=True):
            found[key] += own
    errors = {key: errors_of(sums) for key, sums in found.items()}
    scale = f"{FINE} particles, {len(tests)} of {len(TORSION.test)} test runs"
    for name in (one.name for one in options):
        record_seeds(run, f"{NAME}.{name}", {net: errors[net, name] for net in NETS}, scale)
    run.table("errors", ("net", "scheme", "origin", "centroid", "displacement"),
              [(*key, *own) for key, own in errors.items()])


def squares(k, options):
    """Return the sums of `Squares` of test run k as lists, by option and then by training."""
    mu = TORSION.mu[k]
    one = ldm_full_model(fine(*mu))
    with threads_for(one.problem.bodies):
        x = history(build(fine(*mu))).x[::REFINE]
    sums = []
    for choice in options:
        for net in NETS:
            found = Squares(one.X)
            for state, reference in zip(reduced(one, trained(net), choice)[::REFINE], x,
                                        strict=True):
                found.add(state, reference)
            sums.append(found.sums.tolist())
    return sums


def errors_of(sums):
    """Return the `PositionErrors` of sums of `Squares`."""
    total = Squares(np.zeros((1, 3)))
    total.sums += sums
    return total.errors
