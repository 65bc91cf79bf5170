"""Reduced runs with up to ten times the time step, beside the full-order run with the same one."""

from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import SCHEMES, RunOptions

from ..common.registry import experiment
from ..common.scenes import with_
from ..ldm.studies import GRAVITY
from .ldm_range import beside
from .ldm_runs import FINE, Trial, ended, full, learned, record_silent, table_of

FACTORS = (1, 2, 3, 5, 6, 10)       # divisors of the 30 steps


@experiment("extremes.ldm.dt", title="LDM: time steps up to ten times the trained one",
            profiles=("quick", "standard"), budget={"quick": 8, "standard": 130})
def time_step(run):
    """Errors beside the full-order run with the trained step."""
    names = run.choose(quick=("gravity-r4", "gravity-r7"),
                       standard=tuple(f"gravity-r{r}" for r in (1, 2, 4, 7)))
    ways = [RunOptions(*scheme, points)
            for scheme in run.choose(quick=SCHEMES[1:2], standard=SCHEMES[:2])
            for points in (None, 50)]
    found, whole = [], {}
    for g in run.choose(quick=(GRAVITY.mu[21, 0],), standard=GRAVITY.mu[(2, 21), 0]):
        scene, (_, x, _) = GRAVITY.scene(g), beside("gravity", (g,))
        for factor in run.progress(FACTORS, f"g = {g:.3g}"):
            longer = ldm_full_model(with_(scene, dt=factor * scene.dt, steps=scene.steps // factor))
            whole[g, factor] = not full(longer.problem)[1]
            for name in names:
                found += [(factor, trial(name, f"{g:.3g} m/s^2, {factor} dt", way, longer,
                                         x[::factor])) for way in ways]
    found = with_usual(found)
    record_silent(run, "extremes.ldm.dt", [t for _, t in found], f"dt to {FACTORS[-1]} times")
    record_reach(run, found, whole)
    table_of(run, [t for _, t in found])


def trial(name, what, way, longer, x):
    """`Trial` of a map on a `Case` with a longer step, beside x at its time levels."""
    return Trial(name, what, way.name, way.points or len(longer.X), 0.0,
                 ended(longer, x, learned(name), way))


def with_usual(found):
    """(factor, `Trial`) with the largest error of its map at the trained step as the usual one."""
    return [(factor, t._replace(usual=max(u.end.error for k, u in found
                                          if k == 1 and u.map == t.map))) for factor, t in found]


def record_reach(run, found, whole):
    """Record how far reduced runs go, and full-order runs."""
    sound = [factor for factor, t in found
             if all(u.kind == FINE for k, u in found if k <= factor and u.map == t.map)]
    going = [factor for factor, _ in found
             if all(not u.end.said for k, u in found if k <= factor)]
    own = [factor for _, factor in whole if all(ok for (_, k), ok in whole.items() if k <= factor)]
    run.record("extremes.ldm.dt.fine", max(sound, default=0), comparator=">=", bound=1.0,
               scale=f"{len(found)} runs", note="times the trained step, up to which the runs of "
               "some map are all fine")
    run.record("extremes.ldm.dt.going", max(going, default=0), comparator=">=",
               bound=float(max(own)), scale=f"{len(found)} runs", note="times the trained step, up "
               f"to which all runs reach their end; the full-order runs do up to {max(own)}")
