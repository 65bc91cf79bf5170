"""Every scene of HOT from its start to its end, by HOT: the steps, and pictures of the states.

The particles at some times are kept as ``results/<profile>/states/<scene>.npz``, which the state
figures draw and which is not published. A scene that is there, run by the same version of the
package, is not run again: records say at which commit it was.
"""

from math import inf

import numpy as np

from mpm_ref.hot.methods import METHODS

from ..common.registry import experiment
from .run_history import COLUMNS, course
from .sizes import SIZES, sized

METHOD = "hot"
ROWS = 500          # of the table, at most
PATIENCE = 900      # CPU seconds of a whole run, at most, unless it is of the printed size
BALANCE = 1e-9      # round-off of a sum over all particles and nodes, with forces that cancel


def declared(scene, seconds, quick=None):
    """The experiment ``hot.scenes.<scene>``, which takes so many seconds; `quick`: seconds of the
    motion that the quick profile runs, where it does.
    """
    profiles = ["standard"] + ["quick"] * bool(quick)
    profiles += ["paper"] * (SIZES[f"hot_{scene}"].paper is not None)

    @experiment(f"hot.scenes.{scene}", title=f"{scene.capitalize()}: a whole run by HOT",
                profiles=profiles, budget={"quick": 6, "standard": seconds, "paper": 1e5})
    def whole_run(run):
        """Runs the scene and records what its steps took."""
        end = run.choose(quick={"end": quick}, standard={}, paper={})
        size, patience = run.choose(quick=("quick", PATIENCE), standard=("quick", PATIENCE),
                                    paper=("paper", inf))
        made = sized(f"hot_{scene}", size, unstable="allow", **end)
        of_scene(run, scene, made, patience)
    return whole_run


def of_scene(run, name, scene, patience):
    """Run a scene, for so many CPU seconds at most, or read what is known of its run; records and
    table.
    """
    file = run.folder / "states" / f"{name}.npz"
    known = course(scene, file, patience)
    run.table("steps", COLUMNS, thinned(known.steps))
    record_end(run, name, known)
    record_cost(run, name, known)
    record_balance(run, name, known)


def thinned(steps):
    """At most `ROWS` rows, the first and the last among them."""
    if len(steps) <= ROWS:
        return steps.tolist()
    return steps[np.linspace(0, len(steps) - 1, ROWS).round().astype(int)].tolist()


def scale(known):
    """Size and length of a run in words."""
    t, end = known.column("t")[-1] if len(known.steps) else 0.0, known.facts["end"]
    whole = f"{end:.3g} s" if known.facts["why"] == "end" else f"{t:.3g} of {end:.3g} s"
    return (f"{len(known.body)} particles, dx = {known.facts['dx']:.4g} m, {whole} in "
            f"{len(known.steps)} steps")


def record_end(run, name, known):
    """How far it came, and how many of its steps converged."""
    id, said = f"hot.scenes.{name}", scale(known)
    run.record(f"{id}.done", known.column("t")[-1] / known.facts["end"], unit="1", comparator="=",
               paper=1.0, scale=said, note=f"share of the scene's time; it ended by: "
               f"{known.facts['why']}; run at {known.facts['commit']}")
    eps = METHODS[METHOD].eps
    run.record(f"{id}.converged", float(known.column("converged").mean()), unit="1",
               comparator="=", paper=1.0, scale=said,
               note=f"share of the steps that met eps = {eps:g}")


def record_cost(run, name, known):
    """Iterations and time."""
    id, said, iterations = f"hot.scenes.{name}", scale(known), known.column("iterations")
    for word, value in (("mean", iterations.mean()), ("worst", iterations.max())):
        run.record(f"{id}.iterations.{word}", float(value), unit="1", comparator="info", scale=said,
                   note="outer iterations of a step")
    run.record(f"{id}.backtracks", float(known.column("backtracks").sum()), unit="1",
               comparator="info", scale=said, note="trial steps refused, in the whole run")
    cpu = known.column("cpu").sum()
    run.record(f"{id}.cpu", 1e6 * cpu / (len(known.steps) * len(known.body)), unit="us",
               comparator="info", scale=said, note=f"CPU time per particle and step; "
               f"{cpu:.0f} s in all, {known.column('solve').sum() / cpu:.0%} of it in the solves")


def record_balance(run, name, known):
    """Mass stays; momentum changes by gravity and by what the conditions give."""
    id, said, (before, after) = f"hot.scenes.{name}", scale(known), known.facts["mass"]
    run.record(f"{id}.mass", after / before, unit="1", comparator="=", paper=1.0, scale=said,
               note="of all particles, end over start")
    run.record(f"{id}.momentum", known.column("gap").max(), unit="1", comparator="<=",
               bound=BALANCE, scale=said, note="largest gap in a step between its change and the "
               "impulses of gravity and of the conditions, relative to all momenta in it")


sauce = declared("sauce", 20)
boxes = declared("boxes", 90, quick=0.05)
donut = declared("donut", 120)
wheel = declared("wheel", 20)
twist = declared("twist", 120)
faceless = declared("faceless", 10)
boards = declared("boards", 40)
armacat = declared("armacat", 30)
chain = declared("chain", 240)
aluminium = declared("aluminium", 20)
stiffness = declared("stiffness", 10)
