"""The guard of learned laws (see `learned.guard`): runs with it and without it, side by side.

The runs of the paper's tables have no guard. Here are throws of their training bodies, and the
stand-in for the body of Table 2 (c), in which water breaks down; in the paper's own it does not.
"""

from typing import NamedTuple

from mpm_ref.nclaw.bodies import body_maker
from mpm_ref.scene import Transformed

from ..common.registry import experiment
from ..common.scenes import with_
from ..common.weights_needed import load_available
from ..nclaw.environments import ENVIRONMENTS
from ..nclaw.stand_in_bodies import STAND_INS
from ..nclaw.tasks import TOYS, geometry
from ..nclaw.trained_laws import trained
from .nclaw_extrapolation import thrown
from .nclaw_runs import EVERY, LawEnd, LawSetup, law_end, scene_for, trained_law

THROWS = {"quick": (5.0,), "standard": (1.0, 1.5, 2.0, 3.0)}    # times the trained velocity
BODY = "water"      # which breaks down without the guard, thrown and as the body of Table 2 (c)
COLUMNS = ("law", "what", "unguarded_error", "unguarded_message", "error", "message", "beyond")
PRINTED = 2.4e-4    # nclaw.table2.ours.water.geometry [m^2]


class GuardedTrial(NamedTuple):
    """A run without the guard and with it."""

    law: str
    what: str
    unguarded: LawEnd
    guarded: LawEnd

    @property
    def is_saved(self):
        """True where the run breaks down without the guard alone."""
        return bool(self.unguarded.message) and not self.guarded.message


@experiment("extremes.nclaw.guard", title="NCLaw: learned laws with a guard",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 400})
def guard(run):
    """Compare throws with and without the guard."""
    names = run.choose(quick=(BODY,), standard=ENVIRONMENTS)
    trials = [guarded_trial(law, setup) for law in load_available(run, names, trained_law).values()
              for setup in run.progress(throws(run, law), law.name)]
    record_guard(run, trials)
    run.table("runs", COLUMNS, [(*t[:2], t.unguarded.error, t.unguarded.message, t.guarded.error,
                                 t.guarded.message, t.guarded.beyond) for t in trials])


@experiment("extremes.nclaw.guarded_body", title="NCLaw: water with a guard in another body",
            profiles=("standard",), budget={"standard": 1200})
def guarded_body(run):
    """Run water in the stand-in for the body of Table 2 (c), without the guard and with it."""
    for law in load_available(run, (BODY,), trained_law).values():
        t = guarded_trial(law, LawSetup("Table 2 (c)", with_(stand_in_scene(BODY), every=EVERY)))
        run.record(f"extremes.nclaw.guarded_body.{BODY}", t.guarded.error, unit="m^2",
                   comparator="info",
                   scale="31 580 particles, 2 000 steps, a stand-in for the paper's body",
                   note=f"with the guard {t.guarded.message or 'to its end'}; printed "
                        f"{PRINTED:g} m^2 for another body; without it: "
                        f"{t.unguarded.message or f'{t.unguarded.error:.3g} m^2'}")


def stand_in_scene(name):
    """Return the scene of task (c) with the stand-in for its body, also where its mesh is there."""
    scene, of = geometry(name), TOYS[name]
    shape = Transformed(shape=STAND_INS[of.name], scale=of.size, about=(0.0, 0.0, 0.0),
                        translate=(0.5, 0.5, 0.5))
    return with_(scene, body=(with_(scene.body[0], shape=shape),))


def throws(run, law):
    """Return the `LawSetup`s of a law's body, thrown faster and faster."""
    scene = scene_for(run, law.environment)
    return [LawSetup(f"thrown {k:g} times as fast", thrown(scene, k)) for k in THROWS[run.profile]]


def guarded_trial(law, setup):
    """Return the `GuardedTrial` of a setup."""
    with_guard = law._replace(make=body_maker(trained(law.name), law.bounds))
    return GuardedTrial(law.name, setup.what, law_end(law, setup), law_end(with_guard, setup))


def record_guard(run, trials):
    """Record how many runs break down, with and without the guard, and what it costs in error."""
    name, scale = "extremes.nclaw.guard", f"{len(trials)} runs"
    unguarded = [t for t in trials if t.unguarded.message]
    broken = [t for t in trials if t.guarded.message]
    run.record(f"{name}.broken", len(broken), unit="runs", paper=0, comparator="=", scale=scale,
               note=f"runs that break down with the guard; without it {len(unguarded)}; with it "
                    f"alone finish {sum(t.is_saved for t in trials)}"
                    + "".join(f"; {t.law}, {t.what}" for t in broken))
    both = {t: t.guarded.error / t.unguarded.error for t in trials
            if not (t.unguarded.message or t.guarded.message)}
    if both:
        worst = max(both, key=both.get)
        run.record(f"{name}.harm", both[worst], comparator="info", scale=f"{len(both)} runs",
                   note="largest error with the guard over that without, of runs that finish with "
                        f"both: {worst.law}, {worst.what}")
