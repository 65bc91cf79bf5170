"""A soft arm in a design loop: held at one end, of a stiffness that is to be chosen, under a load
of any direction, after a kick to the side. Six parameters and few runs, so that no training run is
near another.
"""

from math import ceil
from time import process_time
from typing import NamedTuple

import numpy as np

from mpm_ref.materials import make_law, stiffness
from mpm_ref.rom.snapshots import Histories
from mpm_ref.rom.study.full_model import field_of, nsf_full_model
from mpm_ref.rom.study.study import latin
from mpm_ref.rom.symmetric import values
from mpm_ref.scene import Scheme, Velocity, build
from mpm_ref.simulate import simulate

from ..common.scenes import catalogue_scene, with_
from ..ldm.studies import refined

ENDS = ((-6.0, 6.0),) * 3 + ((1e4, 2e4),) + ((-0.3, 0.3),) * 2     # of the parameters: acceleration
                            # along x, y, z [m/s^2], E [Pa], kick along y and z [m/s]
NU, RHO = 0.3, 1000.0       # of the cylinder; [kg/m^3]
LEVELS = 8                  # at which states are compared
CFL = 0.5                   # of a step, by the fastest wave of the stiffest arm
PER_CELL = 2                # particles per cell and axis


class ArmRun(NamedTuple):
    """States of a full-order run at the levels 0 .. LEVELS in single precision, and its cost."""

    fields: dict            # {name of a particle field: (LEVELS + 1, n, ..)}
    cpu: float              # CPU seconds of its steps

    @property
    def x(self):
        """Positions (LEVELS + 1, n, 3) [m]."""
        return self.fields["x"]


def draws(train, test, seed):
    """Return parameters (runs, 6) of runs to train on and to test on, each of its own Latin
    hypercube of so many runs.
    """
    rngs = np.random.default_rng(seed).spawn(2)
    return tuple(latin(n, ENDS, rng) for n, rng in zip((train, test), rngs, strict=True))


def arm(mu, dx, transfer="apic"):
    """Return the scene of the arm with parameters mu (6,), LDM's cylinder on a grid of spacing dx
    [m]; its steps are a multiple of LEVELS.
    """
    *gravity, E, vy, vz = map(float, mu)
    scene = refined(catalogue_scene("ldm_gravity", gravity=tuple(gravity)), dx, PER_CELL)
    body = scene.body[0]
    body = with_(body, velocity=Velocity(linear=(0.0, vy, vz)),
                 material=with_(body.material, E=E))
    end = scene.dt * scene.steps
    steps = LEVELS * ceil(end * sound() / (CFL * dx) / LEVELS)
    return with_(scene, body=(body,), dt=end / steps, steps=steps,
                 scheme=Scheme(transfer=transfer, degree=2))


def sound():
    """Return the speed of the fastest wave of the stiffest arm at rest [m/s]."""
    return float(np.sqrt(stiffness(make_law("fixed_corotated", E=ENDS[3][1], nu=NU)) / RHO))


def simulated(scene, names=("x",)):
    """Return the `ArmRun` of a scene with particle fields of these names."""
    frames, cpu = simulate(build(with_(scene, every=scene.steps // LEVELS))), 0.0
    states = {name: [] for name in names}
    while True:
        start = process_time()
        frame = next(frames, None)
        cpu += process_time() - start
        if frame is None:
            return ArmRun({name: np.array(a) for name, a in states.items()}, cpu)
        for name, a in states.items():
            a.append(field_of(frame.state.bodies, name).astype(np.float32))


def histories(runs, scene, mu):
    """Return the `Histories` of `ArmRun`s with x, tau and C and of parameters mu (runs, 6), with
    the points of a scene.
    """
    full = nsf_full_model(scene)
    x, tau, C = (np.stack([run.fields[name] for run in runs]) for name in ("x", "tau", "C"))
    v = np.zeros((len(mu), *full.X.shape))
    v[..., 1:] = mu[:, None, 4:]
    return Histories(full.X, full.m, full.V0, v, mu, x, values(tau),
                     C.reshape(*x.shape[:3], -1), scene.dt * scene.steps / LEVELS)
