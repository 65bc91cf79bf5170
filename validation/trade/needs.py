"""Are the claims of `mpm-ref needs` right? Lean scenes run once more, beside the scenes as given.

Each scene gets a collider and a body that touch nothing: they must not be required. What holds or
moves the scene must be. The change of the lean scene is measured again at other material points and
other times than those by which it was chosen, and both scenes are timed in turn.
"""

from typing import NamedTuple

import msgspec
import numpy as np

from mpm_ref.executor import open_executor
from mpm_ref.needs.removal import NOT_REQUIRED, REQUIRED, RemovalStudy
from mpm_ref.needs.variant import changes, first_variant
from mpm_ref.scene import build, digest, loads
from mpm_ref.sweep.observation import ObservedRun, observe
from mpm_ref.sweep.probes import choose_probes
from mpm_ref.sweep.runs import SceneRuns
from mpm_ref.sweep.store import RunStore

from ..common.registry import experiment
from .advice_scenes import advice_scenes

JUDGED = ("slide", "stick", "roll", "swing", "lean", "shove", "dam", "sand", "splash", "impact",
          "forge", "slope")
SOLID = "channel"       # a scene in 3D whose section in 2D is enough
QUANTITY, ERROR = "positions", 0.01
TIMES, OTHER_TIMES = 17, 48
REPEATS = 3
KEPT = 0.95             # the aim: share of lean scenes that keep the error
VITAL = {               # what cannot be removed without a change
    "slide": "collider floor", "stick": "initial velocity of body", "roll": "collider floor",
    "swing": "initial velocity of body", "lean": "collider floor",
    "shove": "initial velocity of first", "dam": "gravity", "sand": "gravity",
    "splash": "initial velocity of body", "impact": "collider floor",
    "forge": "initial velocity of hammer", "slope": "gravity", SOLID: "friction of collider floor"}
IDLE = ("collider roof", "body distant")
PARTS = """
dim = {dim}
dx = 0.1
end = 1.0

[[collider]]
name = "roof"
shape = {{ type = "half_space", point = {above}, normal = {down} }}

[[body]]
name = "distant"
density = 1000.0
shape = {{ type = "sphere", center = {far}, radius = 0.1 }}
material = {{ law = "fixed_corotated", E = 1e5, nu = 0.3 }}
"""
CHANNEL = """
dim = 3
dx = 0.04
end = 0.25
gravity = [0.0, 0.0, -9.8]

[[body]]
name = "block"
density = 1200.0
shape = { type = "box", lower = [0.2, 0.0, 0.0], upper = [0.6, 0.2, 0.2] }
velocity = { linear = [1.2, 0.0, 0.0] }
material = { law = "fixed_corotated", E = 2e5, nu = 0.3 }

[[collider]]
name = "floor"
kind = "separate"
friction = 0.4
shape = { type = "half_space", point = [0.0, 0.0, 0.0], normal = [0.0, 0.0, 1.0] }

[[collider]]
name = "south"
kind = "slip"
shape = { type = "half_space", point = [0.0, 0.0, 0.0], normal = [0.0, 1.0, 0.0] }

[[collider]]
name = "north"
kind = "slip"
shape = { type = "half_space", point = [0.0, 0.2, 0.0], normal = [0.0, -1.0, 0.0] }
"""
COLUMNS = ("scene", "change", "again", "cpu", "lean_cpu", "vital", "idle", "removed", "dim")


class Lean(NamedTuple):
    """A lean scene beside the scene as given."""

    scene: str
    change: float           # of the lean scene as the study measured it
    again: float            # at other material points and times
    cpu: float              # [s] of the scene as given, the median of runs in turn
    lean_cpu: float         # [s]
    vital: str              # verdict on what must not be removed
    idle: str               # verdicts on what does nothing
    removed: int            # number of removals
    dim: int                # of the lean scene


@experiment("trade.needs", title="The claims of `mpm-ref needs`, measured once more",
            profiles=("quick", "standard"), budget={"quick": 60, "standard": 1800})
def needs(run):
    """Judge the claims on all scenes."""
    names = run.choose(quick=("stick",), standard=(*JUDGED, SOLID))
    scenes = {one.name: one.scene for one in advice_scenes()} | {SOLID: loads(CHANNEL)}
    texts = {name: scenes[name] for name in names}
    rows = [Lean(*run.cached(name, lambda name=name, scene=scene: list(lean_of(name, scene))))
            for name, scene in run.progress(texts.items(), "scenes")]
    run.table("scenes", COLUMNS, rows)
    record_lean(run, rows)


def with_idle_parts(scene):
    """Return a scene with a collider and a body that touch nothing."""
    d = scene.dim
    more = loads(PARTS.format(dim=d, far=[2.0] * d, above=[0.0] * (d - 1) + [4.0],
                              down=[0.0] * (d - 1) + [-1.0]))
    return msgspec.structs.replace(scene, collider=(*scene.collider, *more.collider),
                                   body=(*scene.body, *more.body))


def lean_of(name, scene):
    """Return the `Lean` scene of a study without a budget."""
    scene = with_idle_parts(scene)
    kept = [body.name for body in scene.body if body.name != "distant"]
    quantities = tuple(f"{QUANTITY}:{body}" for body in kept)
    observed = observed_of(scene, quantities, TIMES, seed=0)
    with open_executor(workers=1) as executor:
        runs = SceneRuns(observed, executor, RunStore())
        result = RemovalStudy(runs, first_variant(scene, observed.probes), ERROR).result()
    other = observed_of(scene, quantities, OTHER_TIMES, seed=1)
    lean = result.lean
    given = first_variant(scene, other.probes)
    for removal in lean.removals:
        given = given.without(removal)
    first = first_variant(scene, other.probes)
    both = [other._replace(scene=text_of(one.scene), probes=one.probes,
                           quantities=tuple(map(one.quantity, quantities)))
            for one in (first, given)]
    made = [[observe(one) for one in both] for _ in range(REPEATS)]
    change = changes(made[0][0], made[0][1], given, first)
    cpu = np.median([[one.cost.cpu for one in pair] for pair in made], axis=0)
    verdicts = {one.label: one.verdict for one in result.singles}
    last = result.order[-1].change if result.order else 0.0
    return Lean(name, last, max(float(error[-1]) for error in change.values()), *cpu.tolist(),
                verdicts[VITAL[name]], ", ".join(verdicts[label] for label in IDLE),
                len(lean.removals), lean.scene.dim)


def observed_of(scene, quantities, times, seed):
    """Return the `ObservedRun` of a scene at even times, with material points of a seed."""
    probes = tuple((p.body, p.X) for p in choose_probes(build(scene).bodies, seed=seed))
    return ObservedRun(text_of(scene), digest(scene), quantities,
                       tuple(np.linspace(0.0, scene.end, times).tolist()), probes)


def text_of(scene):
    """Return a scene as JSON."""
    return msgspec.json.encode(scene).decode()


def record_lean(run, rows):
    """Record how many lean scenes keep the error, what they cost, and the verdicts on parts."""
    scale = f"{len(rows)} scenes at {ERROR:g} of {QUANTITY}"
    wrong = [f"{one.scene} {one.again:.3g}" for one in rows if not one.again <= ERROR]
    run.record("trade.needs.kept", 1.0 - len(wrong) / len(rows), comparator=">=", paper=KEPT,
               scale=scale, note="share of lean scenes that keep the error at other material "
               "points and times" + (f"; not: {', '.join(wrong)}" if wrong else ""))
    ratios = [one.lean_cpu / one.cpu for one in rows]
    run.record("trade.needs.cost", float(np.median(ratios)), comparator="<=", bound=1.0,
               scale=scale, note="CPU time of the lean scene over that of the scene as given, "
               f"median; {min(ratios):.2g} to {max(ratios):.2g}")
    run.record("trade.needs.vital", sum(one.vital != REQUIRED for one in rows), unit="scenes",
               comparator="<=", bound=0, scale=scale,
               note="scenes in which what moves or holds them was found not to be required")
    idle = ", ".join([NOT_REQUIRED] * len(IDLE))
    run.record("trade.needs.idle", sum(one.idle != idle for one in rows), unit="scenes",
               comparator="<=", bound=0, scale=scale, note="scenes in which a collider or a body "
               "that touches nothing was not found to be removable")
    for one in rows:
        if one.scene == SOLID:
            run.record("trade.needs.section", one.dim, unit="dimensions", comparator="<=", bound=2,
                       scale=one.scene, note="of the lean scene of a block between smooth plates "
                       f"in 3D, in {one.lean_cpu / one.cpu:.2g} of the CPU time")
