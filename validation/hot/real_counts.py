"""The bodies of HOT's release: their particles at the printed grid spacing, and first steps.

Table 2 prints the particles of a scene. Those of the bodies that stand for meshes were chosen to
come to that number; here it follows from the meshes. Where the user names no meshes, the numbers
are those of the stand-ins, and none is judged.
"""

from tempfile import TemporaryDirectory
from time import process_time

from mpm_ref.store.text import counted

from ..common import targets
from ..common.registry import experiment
from ..common.scenes import with_
from . import run_history as histories
from .real_bodies import BODIES, absent, bodies_text, filled, real_scene
from .sizes import sized
from .warm_states import START_TIMES
from .whole_runs import scale_text

ID = "hot.scenes.meshes"
NEAR = 0.05         # of the printed number: the release draws the radius of the donut's ring
PATIENCE = 900      # CPU seconds of a small run, at most


@experiment(ID, title="HOT's scenes with the bodies of the release: particles and first steps",
            profiles=("quick", "standard"), budget={"quick": 45, "standard": 300})
def meshes(run):
    """Record the particles of each scene, the bodies' volumes, and whether first steps converge."""
    names = run.choose(quick=("armacat", "boxes", "donut"), standard=tuple(BODIES))
    for name in run.progress(names, "scenes"):
        if reason := absent(name):
            record_stand_ins(run, name, reason)
        else:
            record_bodies(run, name)
            record_steps(run, name)


def printed(name):
    """Return the particles of a scene in Table 2."""
    return targets.load()[f"hot.table2.{name}.particles"].value


def record_stand_ins(run, name, reason):
    """Record the particles of the stand-ins beside the printed number, unjudged."""
    count = sum(body.sampling.count for body in sized(f"hot_{name}", "paper").body)
    run.record(f"{ID}.{name}.particles", count, comparator="info",
               scale=f"stand-ins; the paper: {printed(name):.0f}", note=reason)


def record_bodies(run, name):
    """Record the particles of a scene at the printed spacing, and each body's volumes."""
    scene = sized(f"hot_{name}", "paper")
    scale = f"dx = {scene.dx:.4g} m, as printed"
    replaced = {old for real in BODIES[name].values() for old in real.replaces}
    count = sum(body.sampling.count for body in scene.body if body.name not in replaced)
    for k, (body, real) in enumerate(BODIES[name].items()):
        since = process_time()
        found = filled(real, scene.dx, [scene.seed, k])
        count += len(found.points.x)
        run.record(f"{ID}.{name}.{body}.volume", found.volume, unit="m^3", comparator="info",
                   scale=real.file, note=f"of the mesh; {len(found.points.x)} particles, "
                   f"{found.vertices} of them vertices, filled in {process_time() - since:.0f} s")
        run.record(f"{ID}.{name}.{body}.excess", found.points.V0.sum() / found.volume,
                   comparator="info", scale=scale, note="volume of the particles, and with it the "
                   "mass, over that of the mesh, as in the release")
    run.record(f"{ID}.{name}.particles", count, comparator="=", paper=printed(name),
               tolerance=NEAR, scale=scale, note=bodies_text(name))


def record_steps(run, name):
    """Record how far a small run by HOT gets, and the share of its steps that are solved.

    It ends where contact, pull or yield has begun; at the quick profile after two steps.
    """
    with TemporaryDirectory() as folder:
        small = real_scene(name, small_scene(run, name), folder, as_released=False)
        history = histories.run(small, PATIENCE)
    scale = f"{scale_text(history)}; vertices are no particles"
    run.record(f"{ID}.{name}.done", history.column("t")[-1] / small.end, comparator="=", paper=1.0,
               scale=scale, note=f"share of the time; it ended by: {history.facts['why']}; "
               f"{counted(history.facts['rejected'], 'rejected step')}")
    run.record(f"{ID}.{name}.converged", float(history.column("converged").mean()),
               comparator="=", paper=1.0, scale=scale, note="share of the steps that met their "
               f"tolerance; {history.column('iterations').mean():.3g} iterations in the mean")


def small_scene(run, name):
    """Return a scene at the quick size, which ends early."""
    scene = sized(f"hot_{name}", "quick", unstable="allow")
    begun = START_TIMES.get(name, START_TIMES["armacat_stiff"])
    return with_(scene, end=run.choose(quick=2.0 * scene.longest, standard=begun))
