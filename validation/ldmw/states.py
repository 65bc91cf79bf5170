"""What the workshop paper's Figure 1 shows: ends of reduced poking runs, beside full-order ones."""

from ..common.registry import experiment
from ..ldm.networks import trained
from ..ldm.published_bodies import keep
from ..ldm.workshop_studies import PUSHES
from .poke import HYPER, NET, samples
from .runs import by_points, compared, kept, record, runs

SHOWN = PUSHES.test[::2]    # of the test runs: those of the least and of the largest magnitude, too


@experiment("ldmw.fig1", title="LDM workshop: the cylinder under several pokes",
            profiles=("quick", "standard"), budget={"quick": 35, "standard": 35})
def pokes(run):
    """Keeps the ends of test runs, of one draw of sample points; records their errors."""
    tests, model = runs(PUSHES, SHOWN), trained(NET)
    chosen = samples(tests.cases[0], run.seed)
    approach = by_points(chosen, kept(NET, tests.cases[0], chosen))
    found = list(run.progress(tests.levels(model.field, model.rest, approach), "runs"))
    scale = (f"{len(tests.X)} particles, {len(found[0]) - 1} steps, r = {model.field.r}, "
             f"{HYPER} sample points, one run each")
    for k, levels in enumerate(found):
        record(run, f"ldmw.fig1.error.{k + 1}", compared([levels]), scale,
               "rho = {:g} R, theta = {:g} deg, phi = {:g} deg".format(*PUSHES.mu[SHOWN[k]]),
               comparator="info")
    ends = [levels[-1] for levels in found]
    keep(run, X=tests.X, mu=tests.full.mu, reduced=[here[0] for here, _ in ends],
         full=[there[0] for _, there in ends])
