"""Reduced runs ten times as long as those that their map was trained with. Pokes in a row are
`ldm.table6`.
"""

import numpy as np

from mpm_ref.body import Body, particles_at
from mpm_ref.energy import energy
from mpm_ref.explicit import initial_stress
from mpm_ref.materials import NoFlow
from mpm_ref.rom.kinematics import evaluate
from mpm_ref.rom.latent import velocities
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.run import RunOptions

from ..common.registry import experiment
from ..common.scenes import with_
from ..ldm.studies import GRAVITY
from .ldm_runs import Trial, ended, full, learned, record_silent, table_of

LONGER = 10
FEW = RunOptions(points=50)
EVERY = 5           # steps between rows
TAIL = 3            # displacements are compared over the last third of a run
FALLS = {"quick": ((1.0, ("gravity-r4",)),),        # [m/s^2], maps; at 10 the body itself tears
         "standard": tuple((g, ("gravity-r2", "gravity-r4", "gravity-r7"))
                           for g in (1.0, 2.0, 4.0, 10.0))}


@experiment("extremes.ldm.long", title="LDM: ten times the trained time",
            profiles=("quick", "standard"), budget={"quick": 8, "standard": 100})
def long_run(run):
    """Drift beside the full-order run; energy, which nothing puts in."""
    found, table = [], []
    for g, names in run.progress(FALLS[run.profile], "gravity"):
        found += [DrawnOut(name, GRAVITY.scene(g), f"{g:g} m/s^2", FEW) for name in names]
    trials = [one.trial for one in found]
    record_silent(run, "extremes.ldm.long", trials, f"{LONGER} times the trained steps",
                  f"of the full-order runs {sum(bool(one.said) for one in found)} stopped")
    record_drift(run, found)
    for one in found:
        table += [(one.trial.map, one.trial.what, one.trial.points, *row) for row in one.rows]
    table_of(run, trials)
    run.table("drift", ("map", "what", "points", "step", "distance", "full", "energy"), table)


class DrawnOut:
    """A long run: its `Trial`, and rows (step, rms displacement, the full-order run's [m], energy
    above that of the start [J]). The usual error is that over the trained steps.
    """

    def __init__(self, name, scene, what, way):
        reduction, one = learned(name), ldm_full_model(with_(scene, steps=LONGER * scene.steps))
        x, self.said = full(one.problem)
        usual = ended(ldm_full_model(scene), x[:scene.steps + 1], reduction, way).error
        states = []
        end = ended(one, x, reduction, way, keep=states)
        self.trial = Trial(name, what + (" (full order stopped)" if self.said else ""), way.name,
                           way.points or len(one.X), usual, end)
        shown = range(0, len(states), EVERY)
        own = [distance(x[k], one.X) if k < len(x) else np.nan for k in shown]
        E = energies(one, reduction.map, way, [states[k][0] for k in shown])
        self.rows = np.stack([shown, [distance(states[k][1], one.X) for k in shown], own, E - E[0]],
                             axis=1)

    @property
    def end(self):
        """Mean rms displacement in the last third, over the full-order run's."""
        tail = self.rows[-(len(self.rows) // TAIL):]
        return tail[:, 1].mean() / tail[:, 2].mean()

    @property
    def gain(self):
        """Largest energy above that of the start, over the largest amount lost [1]."""
        return max(self.rows[:, 3].max(), 0.0) / max(-self.rows[:, 3].min(), 1e-300)


def distance(x, X):
    """Root mean square displacement [m]."""
    return float(np.sqrt(np.mean(np.sum((x - X) ** 2, axis=1))))


def energies(case, map, way, latents):
    """Mechanical energy of each of the states of a reduced run [J]."""
    law, dt = case.problem.bodies[0].law, case.problem.clock.dt
    found = []
    for latent in latents:
        at = evaluate(map, case.X, latent.xhat)
        v = velocities(map, latent, dt, case.X)[way.velocity](at)
        particles = particles_at(at.x, v, case.m, case.V0, transfer="pic")._replace(F=at.F)
        body = Body("reduced", particles, law, NoFlow(), np.arange(len(at.x)))
        initial_stress(body)
        found.append(energy((body,), case.problem.gravity).sum)
    return np.array(found)


def record_drift(run, found):
    """Record distances and energies at the end."""
    whole = [one for one in found if not one.said]
    for name, of, bound in (("farthest", max, 2.0), ("nearest", min, 0.5)):
        worst = of(whole, key=lambda one: one.end)
        run.record(f"extremes.ldm.long.{name}", worst.end, comparator="<=" if of is max else ">=",
                   bound=bound, scale=f"{len(whole)} runs beside full-order runs that stayed whole",
                   note=f"mean displacement in the last third, over the full-order run's: "
                        f"{worst.trial.map}, {worst.trial.what}, {worst.trial.points} samples")
    worst = max(found, key=lambda one: one.gain)
    run.record("extremes.ldm.long.energy", worst.gain, comparator="<=", bound=0.0,
               scale=f"{len(found)} runs", note="largest energy above the start's, over what was "
               f"lost: nothing puts energy in; {worst.trial.map}, {worst.trial.what}")
