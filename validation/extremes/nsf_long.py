"""Reduced runs with inferred stress ten times as long as those that their fields were made of."""

import numpy as np

from mpm_ref.core.grid import OutOfRange
from mpm_ref.monitor import Unstable
from mpm_ref.rom.step import BREAKDOWNS
from mpm_ref.rom.study.full_model import field_of, nsf_full_model
from mpm_ref.simulate import simulate
from mpm_ref.timestep import TooLarge

from ..common.registry import experiment
from ..common.scenes import with_
from .ldm_long import LONGER, distance
from .nsf_runs import GONE, Bench, scenes

ROWS = 100          # of a run
COLUMNS = ("scene", "samples", "step", "beyond", "distance", "full_distance", "kinetic",
           "full_kinetic")
WORDS = {"distance": "rms displacement", "kinetic": "kinetic energy"}


@experiment("extremes.nsf.long", title="NSF: ten times the trained time",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 300})
def long_run(run):
    """How far latent coordinates go, and kinetic energy, beside the full-order run."""
    rows = []
    for name, one in scenes(run):
        bench, scene = Bench(name, one), one.study.run(one.study.test[0])
        steps = LONGER * scene.steps
        long = with_(scene, steps=steps, every=max(1, steps // ROWS), interval=None)
        full, stopped = full_run(long)
        chosen = bench.drawn(bench.count)
        own, said = reduced_run(bench, long, chosen)
        record_end(run, name, (own, said), (full, stopped), scene.steps)
        rows += [(name, len(chosen.points), step, beyond, far, full.get(step, (np.nan,) * 2)[0],
                  kinetic, full.get(step, (np.nan,) * 2)[1])
                 for step, (beyond, far, kinetic) in own.items() if step % long.every == 0]
    run.table("drift", COLUMNS, rows)


def full_run(scene):
    """{step: (rms displacement [m], kinetic energy [J])} of a full-order run's frames as far as it
    goes, and the sentence with which it stopped.
    """
    one, found = nsf_full_model(scene), {}
    try:
        for frame in simulate(one.problem):
            x, v = (field_of(frame.state.bodies, name) for name in "xv")
            found[frame.state.step] = distance(x, one.X), kinetic(one.m, v)
    except (Unstable, TooLarge, OutOfRange) as stop:
        return found, str(stop)
    return found, ""


def reduced_run(bench, scene, chosen):
    """{step: (beyond, rms displacement [m], kinetic energy [J])} of every step of a reduced run,
    and the sentence with which it broke down, or was GONE.
    """
    one, fields, found = nsf_full_model(scene), bench.one.of(bench.value), {}
    everything, before, dt = np.arange(len(one.X)), None, one.problem.clock.dt
    try:
        for step, state in enumerate(bench.inferred(one, fields, chosen)):
            x = fields.place(everything, state.latent.xhat)
            v = one.v if before is None else (x - before) / dt
            found[step] = (bench.monitor.check(state).beyond, distance(x, one.X),
                           kinetic(one.m, v))
            before = x
    except BREAKDOWNS as stop:
        return found, " ".join(str(stop).split())
    gone = len(found) <= one.problem.clock.steps
    return found, f"ended, {GONE:g} times as far off as any trained state" if gone else ""


def kinetic(m, v):
    """Kinetic energy [J] of points of mass m (n,) with velocities v (n, d)."""
    return 0.5 * float(m @ np.sum(v**2, axis=1))


def record_end(run, name, reduced, full, trained):
    """Record how far a run came, -1 without a start, and where it went; trained: steps of the
    training runs.
    """
    (own, said), (frames, stopped) = reduced, full
    id, scale = f"extremes.nsf.long.{name}", f"{name}, {LONGER} times {trained} steps"
    run.record(f"{id}.steps", max(own, default=-1), unit="steps", comparator="info", scale=scale,
               note=said or "to its end; the full-order run " + (stopped or "too"))
    if own:
        record_beyond(run, id, np.array([one[0] for one in own.values()]), scale, trained)
    both = set(own) & set(frames)
    if both:
        record_state(run, id, (own, frames), scale, max(both))


def record_beyond(run, id, far, scale, trained):
    """Record how far the latent coordinates of each step were from the trained ones."""
    left = np.flatnonzero(~(far <= 1.0))
    run.record(f"{id}.beyond", far.max(), comparator="info", scale=scale,
               note="largest distance of the latent coordinates from the trained ones, over their "
                    f"gap; within the trained steps {far[:trained + 1].max():.3g}; above 1 first "
                    + (f"in step {left[0]}" if len(left) else "never"))


def record_state(run, id, both, scale, last):
    """Record displacement and kinetic energy in the last step that both runs have."""
    own, frames = both
    for k, what, unit in ((0, "distance", "m"), (1, "kinetic", "J")):
        peak = max(one[k] for one in frames.values())
        run.record(f"{id}.{what}", own[last][k + 1], unit=unit, comparator="info", scale=scale,
                   note=f"{WORDS[what]} in step {last}; the full-order run {frames[last][k]:.3g}, "
                        f"at its most {peak:.3g}")
