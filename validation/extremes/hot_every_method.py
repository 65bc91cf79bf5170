"""The hardest states of the other experiments, each solved by every method there is.

The others try five methods on many states. Here all twelve meet one state of each kind, in two
dimensions, in one step of 1/24 s. What is judged is that none ends unsoundly; which of them
converge is told.
"""

from mpm_ref.hot.methods import METHODS as ALL

from ..common.registry import experiment
from .hot_bodies import DX, FRAME, elastic, gravity
from .hot_broken import broken
from .hot_solve import CONVERGED, EPS, OUTER, STOPPED, Setup, solve, table_of
from .hot_sparse import bodies
from .hot_stiffness import STIFFEST, bent
from .hot_time_step import thrown

LIKE_ALL = {"gast15": {"norm": "characteristic", "eps": EPS}}   # printed with an L2 norm [kg m/s]
QUICK = ("inverted", "contrast")


def setups(rng):
    """{name: `Setup`} of the hard states."""
    made = {
        "inverted": (broken(2, 1e6, "inverted", "all", rng),),
        "collapsed": (broken(2, 1e6, "flat", "all", rng),),
        "stretched": (broken(2, 1e6, 3.0, "all", rng),),
        "one per cell": bodies(2, 1e9, rng)["one per cell"],
        "dust": bodies(2, 1e2, rng)["scattered dust"],
    }
    return {
        **{name: Setup(found, DX, FRAME, gravity(2)) for name, found in made.items()},
        "stiff": bent(2, (elastic(STIFFEST), elastic(STIFFEST))),
        "contrast": bent(2, (elastic(1e-8 * STIFFEST), elastic(STIFFEST))),
        "incompressible": bent(2, (elastic(1e6, 0.4999), elastic(1e6, 0.4999))),
        "past CFL 3": thrown(2, 1e9, FRAME, 3.0 * DX / FRAME),
    }


def ends_of(setup):
    """`End`s of a setup by all methods, all to the same tolerance."""
    return [solve(setup, method, **LIKE_ALL.get(method, {})) for method in ALL]


@experiment("extremes.hot.every_method", title="The hardest states by every method",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 15})
def every_method(run):
    """One step from every state by every method."""
    made = setups(run.rng)
    names = run.choose(quick=QUICK, standard=tuple(made))
    rows = [(name, end) for name in run.progress(names, "states") for end in ends_of(made[name])]
    for method in ALL:
        record_method(run, method, [(name, end) for name, end in rows if end.method == method])
    table_of(run, ("state",), rows)


def record_method(run, method, rows):
    """How many of a method's solves, rows (state, `End`), were unsound, and how many converged."""
    target = f"extremes.hot.every_method.{method}"
    scale = f"2D, one step of 1/24 s from {len(rows)} states: {', '.join(name for name, _ in rows)}"
    unsound = [f"{name}: {e.kind}" for name, e in rows if e.kind not in (CONVERGED, STOPPED)]
    stopped = [f"{name}: {e.why.partition(':')[0]}" for name, e in rows if e.kind == STOPPED]
    run.record(f"{target}.unsound", len(unsound), paper=0, comparator="=", scale=scale,
               note="; ".join(unsound) or "each converged, or stopped with a reason, within its "
                    "caps, finite and at no higher energy")
    run.record(f"{target}.converged", len(rows) - len(unsound) - len(stopped), comparator="info",
               scale=scale, note="; ".join((f"to eps = {EPS:.0e} in {OUTER} iterations, of "
                                            f"{len(rows)} solves", *stopped)))
