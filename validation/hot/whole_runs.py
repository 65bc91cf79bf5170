"""Every scene of HOT from its start to its end, by HOT: the steps, and pictures of the states.

The particles at some times are stored as ``results/<profile>/states/<scene>.npz``, which is not
published. A scene that is there, run by the same version of the package, is not run again: records
say at which commit it was. What the state figures draw is kept among ``results/<profile>/bodies``.
At the printed size bodies are those of the release, where the user names their meshes
(`real_bodies`).
"""

from math import inf

import numpy as np

from mpm_ref.hot.methods import METHODS
from mpm_ref.store.text import counted

from ..common.even_points import even_subset
from ..common.registry import experiment
from ..common.scenes import catalogue_scene, evenly, with_
from ..ldm.published_bodies import keep
from .real_bodies import BODIES, bodies_text, with_real_bodies
from .run_history import COLUMNS, run_history, unpublished
from .sizes import AFFORDABLE, SIZES
from .warm_states import catalogue_name
from .warm_states import scene as sized_scene

METHOD = "hot"
ROWS = 500          # of the table, at most
MOST = 20_000       # particles that are kept for pictures
COLOURED = ("wheel",)       # scenes whose pictures show the stress
PATIENCE = 3600     # CPU seconds of a whole run, at most, unless it is of the printed size
PRINTED_ENDS = {"boxes": 0.5}   # [s] of motion at the printed size, where all of it takes hours


def scene_experiment(scene, seconds, quick=None, printed_size=True):
    """Declare the experiment ``hot.scenes.<scene>``, which takes about `seconds`.

    `quick`: seconds of the motion that the quick profile runs, where it does. printed_size: whether
    the paper profile runs it, where the paper prints a size.
    """
    printed_size = printed_size and SIZES[f"hot_{catalogue_name(scene)}"].paper is not None
    profiles = ["standard"] + ["quick"] * bool(quick) + ["paper"] * printed_size

    title = scene.replace("_", ", ").capitalize()

    @experiment(f"hot.scenes.{scene}", title=f"{title}: a whole run by HOT",
                profiles=profiles, budget={"quick": 6, "standard": seconds, "paper": 1e5})
    def whole_run(run):
        """Run the scene and record the work of its steps."""
        printed = {"end": PRINTED_ENDS[scene]} if scene in PRINTED_ENDS else {}
        end = run.choose(quick={"end": quick}, standard={}, paper=printed)
        size, patience = run.choose(quick=("quick", PATIENCE), standard=("standard", PATIENCE),
                                    paper=("paper", inf))
        record = with_(sized_scene(scene, size), **end)
        if run.profile == "paper" and scene in BODIES:
            record = printed_bodies(run, scene, record)
        record_run(run, scene, record, patience)
    return whole_run


def printed_bodies(run, name, scene):
    """Return a scene with the release's bodies, where their meshes are there, and note which."""
    run.note(bodies_text(name))
    return with_real_bodies(name, scene, unpublished(run.folder / "states"))


def is_measured(run, name):
    """Return whether steps of a whole run are measured later, from its states."""
    return run.profile == "standard" or (run.profile == "paper" and name in AFFORDABLE)


def record_run(run, name, scene, patience):
    """Record a run of a scene, for `patience` CPU seconds at most, or its stored history."""
    file = run.folder / "states" / f"{name}.npz"
    history = run_history(scene, file, patience, with_states=is_measured(run, name))
    run.table("steps", COLUMNS, history.steps[evenly(len(history.steps), ROWS)].tolist())
    record_end(run, name, history)
    record_beginning(run, name, history)
    record_cost(run, name, history)
    keep_states(run, history, stress=name in COLOURED)


def keep_states(run, history, stress):
    """Keep particles at the times of the pictures, few and rounded enough to be published."""
    shown = shown_particles(history.x)
    scalars = {"stress": history.stress[:, shown]} if stress else {}
    keep(run, times=history.times, body=history.body[shown], x=history.x[:, shown], **scalars)


def shown_particles(x):
    """Return the numbers of at most `MOST` particles, evenly spread at the start of a run; at its
    last picture where some enter during the run, all at one place.
    """
    if np.isfinite(x[0]).all():
        return even_subset(x[0], MOST)
    seen = np.flatnonzero(np.isfinite(x[-1]).all(axis=1))
    return seen[even_subset(x[-1, seen], MOST)]


def scale_text(history):
    """Return the size and the length of a run as text."""
    t, end = history.column("t")[-1] if len(history.steps) else 0.0, history.facts["end"]
    length = f"{end:.3g} s" if history.facts["why"] == "end" else f"{t:.3g} of {end:.3g} s"
    steps = len(history.steps)
    count = int(history.column("particles")[-1]) if steps else len(history.body)
    return (f"{count} particles, dx = {history.facts['dx']:.4g} m, {length} in "
            f"{steps} steps")


def record_end(run, name, history):
    """Record the share of the run that was reached, and of its steps that converged."""
    id, scale = f"hot.scenes.{name}", scale_text(history)
    run.record(f"{id}.done", history.column("t")[-1] / history.facts["end"], unit="1",
               comparator="=", paper=1.0, scale=scale,
               note=f"share of the time that was asked for; it ended by: {history.facts['why']}; "
               f"{counted(history.facts['rejected'], 'rejected step')}; run at "
               f"{history.facts['commit']}")
    eps = METHODS[METHOD].eps
    run.record(f"{id}.converged", float(history.column("converged").mean()), unit="1",
               comparator="=", paper=1.0, scale=scale,
               note=f"share of the steps that met eps = {eps:g}")


def record_beginning(run, name, history):
    """Record how much of the scene's motion a run was asked for, where it is not all."""
    asked, whole = history.facts["end"], catalogue_scene(f"hot_{catalogue_name(name)}").end
    if asked < whole:
        run.record(f"hot.scenes.{name}.asked", asked / whole, unit="1", comparator="info",
                   scale=scale_text(history), note=f"share of the scene's {whole:.3g} s that this "
                   "run was asked for; `done` is the share of what was asked")


def record_cost(run, name, history):
    """Record iterations and time."""
    id, scale, iterations = f"hot.scenes.{name}", scale_text(history), history.column("iterations")
    for word, value in (("mean", iterations.mean()), ("worst", iterations.max())):
        run.record(f"{id}.iterations.{word}", float(value), unit="1", comparator="info",
                   scale=scale, note="outer iterations of a step")
    run.record(f"{id}.backtracks", float(history.column("backtracks").sum()), unit="1",
               comparator="info", scale=scale, note="trial steps refused, in the whole run")
    cpu = history.column("cpu").sum()
    run.record(f"{id}.cpu", 1e6 * cpu / history.column("particles").sum(), unit="us",
               comparator="info", scale=scale, note=f"CPU time per particle and step; "
               f"{cpu:.0f} s in all, {history.column('solve').sum() / cpu:.0%} of it in the solves")
    if "memory" in history.facts:
        run.record(f"{id}.memory", 1e-9 * history.facts["memory"], unit="GB", comparator="info",
                   scale=scale, note="peak of the process, in which other experiments may have run")


sauce = scene_experiment("sauce", 900)
boxes = scene_experiment("boxes", 700, quick=0.05)
donut = scene_experiment("donut", 1200)
wheel = scene_experiment("wheel", 150)
twist = scene_experiment("twist", 1200)
faceless = scene_experiment("faceless", 70)
boards = scene_experiment("boards", 1100)
armacat = scene_experiment("armacat", 260)
armacat_soft = scene_experiment("armacat_soft", 260, printed_size=False)
chain = scene_experiment("chain", 2300)
aluminium = scene_experiment("aluminium", 170)
stiffness = scene_experiment("stiffness", 70)
