"""Learned laws in bodies that are thrown faster, strained at the start, lighter or denser than the
one that they were trained on.
"""

import numpy as np

from ..common.registry import experiment
from ..common.scenes import with_
from ..nclaw.tasks import SEEDS, velocity
from .nclaw_runs import (
    CHOSEN,
    EVERY,
    Setup,
    laws,
    record_silent,
    scene_for,
    table_of,
    trials,
)

THROWS = {"quick": (3.0,), "standard": (0.0, 0.5, 1.5, 2.0, 3.0)}      # times the trained velocity
STRETCHES = {"quick": (1.5,), "standard": (0.5, 0.8, 1.2, 1.5, 2.0)}   # along x
DENSITIES = {"quick": (5.0,), "standard": (0.2, 0.5, 2.0, 5.0)}         # times the trained one
THRESHOLDS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0)                   # of `beyond`
RATES = ("laws", "error", "beyond", "bad", "misses", "good", "false_alarms")
RATED = 3.0, 5.0    # times the usual error


def thrown(scene, factor):
    """A scene whose body flies and spins so many times as fast."""
    v = scene.body[0].velocity
    faster = with_(v, linear=tuple(factor * a for a in v.linear),
                   angular=tuple(factor * a for a in v.angular))
    return with_(scene, body=(with_(scene.body[0], velocity=faster),))


def denser(scene, factor):
    """A scene whose body is so many times as dense."""
    body = scene.body[0]
    return with_(scene, body=(with_(body, density=factor * body.density),))


def strained(run, law):
    """`Setup`s of a law, the trained run first."""
    scene = scene_for(run, law.environment)
    seeds = run.choose(quick=(), standard=SEEDS)
    return [Setup("as trained", scene),
            *(Setup(f"velocity {seed}", with_(velocity(law.environment, seed), every=EVERY))
              for seed in seeds),
            *(Setup(f"thrown {k:g} times as fast", thrown(scene, k))
              for k in THROWS[run.profile]),
            *(Setup(f"stretched {k:g} times", scene, np.diag([k, 1.0, 1.0]))
              for k in STRETCHES[run.profile])]


@experiment("extremes.nclaw.strain", title="NCLaw: laws at strains that they have not seen",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 500})
def strain(run):
    """Other throws, and bodies that are stretched or pressed from the start, in place."""
    found = [t for law in laws(run) for t in trials(run, law, strained(run, law))]
    record_silent(run, found, "throws up to 3 times as fast, stretches of 0.5 to 2")
    record_farthest(run, found)
    table_of(run, found)
    run.table("rates", RATES, rates(found))


def record_farthest(run, found):
    """Record of each law the largest error, and the farthest run that is not bad."""
    for name in dict.fromkeys(t.law for t in found):
        mine = [t for t in found if t.law == name]
        worst = max(mine, key=lambda t: t.end.error)
        run.record(f"{run.experiment.id}.{name}.worst", worst.end.error / worst.usual,
                   comparator="info", scale=f"{len(mine)} runs", note="largest error over the "
                   f"usual one, {worst.usual:.3g} m^2: {worst.what}")
        good = max((t for t in mine if not t.bad()), key=lambda t: t.end.beyond)
        run.record(f"{run.experiment.id}.{name}.farthest", good.end.beyond, comparator="info",
                   scale=f"{len(mine)} runs", note="largest distance out of bounds, in their "
                   f"width, of a run that is not bad: {good.what}")


def rates(found):
    """Rows: misses among bad runs, and false alarms among the others, by what counts as bad, by
    the bound that would be set on `beyond`; of laws that it was chosen with, and of others.
    """
    rows = []
    for words, is_chosen in (("chosen", True), ("other", False)):
        some = [t for t in found if (t.law in CHOSEN) == is_chosen]
        for factor in RATED:
            for bound in THRESHOLDS:
                told = [(t.bad(factor), t.end.beyond > bound) for t in some]
                bad = sum(is_bad for is_bad, _ in told)
                rows.append((words, factor, bound, bad, told.count((True, False)),
                             len(told) - bad, told.count((False, True))))
    return rows


@experiment("extremes.nclaw.density", title="NCLaw: bodies of another density than in training",
            profiles=("quick", "standard"), budget={"quick": 12, "standard": 200})
def density(run):
    """Beside true laws at the same density; what is learned is a stress, not an acceleration."""
    found = []
    for law in laws(run):
        scene = scene_for(run, law.environment)
        found += trials(run, law, [Setup("as trained", scene), *(
            Setup(f"{k:g} times as dense", denser(scene, k)) for k in DENSITIES[run.profile])])
    record_silent(run, found, "0.2 to 5 times the trained density")
    record_farthest(run, found)
    table_of(run, found)
