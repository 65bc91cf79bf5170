"""The hardest states of the other experiments, solved by every method.

The other experiments try five methods on many states. Here all twelve solve one state of each kind,
in two dimensions, in one step of 1/24 s. None may end unsoundly; how many converge is recorded.
"""

from mpm_ref.hot.methods import METHODS as ALL

from ..common.registry import experiment
from .blocks import DX, FRAME, elastic, gravity
from .hot_broken import deformed_block
from .hot_parameters import STIFFEST, strained_box, thrown_box
from .hot_pieces import sparse_bodies
from .hot_solve import CONVERGED, EPS, OUTER, STOPPED, StepSetup, solve, solve_table

# Gast15 is printed with an L2 norm [kg m/s].
EQUAL_TOLERANCE = {"gast15": {"norm": "characteristic", "eps": EPS}}
QUICK = ("inverted", "contrast")


def setups(rng):
    """Return {name: `StepSetup`} of the hard states."""
    bodies = {
        "inverted": (deformed_block(2, 1e6, "inverted", "all", rng),),
        "collapsed": (deformed_block(2, 1e6, "flat", "all", rng),),
        "stretched": (deformed_block(2, 1e6, 3.0, "all", rng),),
        "one per cell": sparse_bodies(2, 1e9, rng)["one per cell"],
        "dust": sparse_bodies(2, 1e2, rng)["scattered dust"],
    }
    return {
        **{name: StepSetup(own, DX, FRAME, gravity(2)) for name, own in bodies.items()},
        "stiff": strained_box(2, (elastic(STIFFEST), elastic(STIFFEST))),
        "contrast": strained_box(2, (elastic(1e-8 * STIFFEST), elastic(STIFFEST))),
        "incompressible": strained_box(2, (elastic(1e6, 0.4999), elastic(1e6, 0.4999))),
        "past CFL 3": thrown_box(2, 1e9, FRAME, 3.0 * DX / FRAME),
    }


def solve_by_all_methods(setup):
    """Return the `SolveEnd`s of a setup by all methods, all to the same tolerance."""
    return [solve(setup, method, **EQUAL_TOLERANCE.get(method, {})) for method in ALL]


@experiment("extremes.hot.every_method", title="The hardest states by every method",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 15})
def every_method(run):
    """Solve one step from every state by every method."""
    states = setups(run.rng)
    names = run.choose(quick=QUICK, standard=tuple(states))
    rows = [(name, end) for name in run.progress(names, "states")
            for end in solve_by_all_methods(states[name])]
    for method in ALL:
        record_method(run, method, [(name, end) for name, end in rows if end.method == method])
    solve_table(run, ("state",), rows)


def record_method(run, method, rows):
    """Record how many of a method's solves, rows (state, `SolveEnd`), were unsound or converged."""
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
