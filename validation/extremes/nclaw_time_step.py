"""Learned laws in time steps of another length than those of their training.

A learned return map corrects F once a step, by how much it was trained to in steps of one length:
in shorter steps it corrects more often.
"""

from ..common.registry import experiment
from ..common.scenes import with_
from .nclaw_runs import EVERY, Setup, laws, record_silent, scene_for, table_of, trials

FACTORS = {"quick": (1.0, 4.0), "standard": (1.0, 0.25, 0.5, 2.0, 4.0)}     # trained first


def longer(scene, factor):
    """A scene with time steps so many times as long, looked at at the same times."""
    return with_(scene, dt=factor * scene.dt, steps=round(scene.steps / factor),
                 every=round(EVERY / factor))


@experiment("extremes.nclaw.dt", title="NCLaw: time steps of other lengths than in training",
            profiles=("quick", "standard"), budget={"quick": 12, "standard": 300})
def time_step(run):
    """A quarter to four times the trained step, beside true laws with the same one."""
    found = {}
    for law in laws(run):
        scene, factors = scene_for(run, law.environment), FACTORS[run.profile]
        setups = [Setup(f"{k:g} dt", longer(scene, k)) for k in factors]
        found[law.name] = dict(zip(factors, trials(run, law, setups), strict=True))
    record_silent(run, [t for own in found.values() for t in own.values()],
                  "0.25 to 4 times the trained step")
    for name, own in found.items():
        for factor, t in own.items():
            run.record(f"extremes.nclaw.dt.{name}.{factor:g}", t.end.error, unit="m^2",
                       comparator="info", scale=f"{t.end.steps} steps, 1000 particles",
                       note=f"{t.end.error / t.usual:.3g} times that with the trained step; "
                            f"farthest out of the bounds of strains {t.end.beyond:.2g} widths "
                            + t.end.said)
    table_of(run, [t for own in found.values() for t in own.values()])
