"""Last states of reduced and full-order poking runs, for the workshop paper's Figure 1."""

from ..common.registry import experiment
from ..ldm.networks import trained
from ..ldm.published_bodies import keep
from ..ldm.workshop_studies import PUSHES
from .poke import HYPER, NET, samples
from .runs import by_points, field_errors, record, study_runs, training_neighbours

SHOWN = PUSHES.test[::2]    # of the test runs: those of the least and of the largest magnitude, too


@experiment("ldmw.fig1", title="LDM workshop: the cylinder under several pokes",
            profiles=("quick", "standard"), budget={"quick": 35, "standard": 35})
def pokes(run):
    """Keep the last states of test runs with one draw of sample points, and record their errors."""
    tests, model = study_runs(PUSHES, SHOWN), trained(NET)
    chosen = samples(tests.cases[0], run.seed)
    approach = by_points(chosen, training_neighbours(NET, tests.cases[0], chosen))
    shown = list(run.progress(tests.levels(model.field, model.rest, approach), "runs"))
    scale = (f"{len(tests.X)} particles, {len(shown[0]) - 1} steps, r = {model.field.r}, "
             f"{HYPER} sample points, one run each")
    for k, levels in enumerate(shown):
        record(run, f"ldmw.fig1.error.{k + 1}", field_errors([levels]), scale,
               "rho = {:g} R, theta = {:g} deg, phi = {:g} deg".format(*PUSHES.mu[SHOWN[k]]),
               comparator="info")
    ends = [levels[-1] for levels in shown]
    keep(run, X=tests.X, mu=tests.full.mu, reduced=[reduced[0] for reduced, _ in ends],
         full=[full[0] for _, full in ends])
