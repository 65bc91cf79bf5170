"""Every shipped scene runs with explicit and with implicit steps."""

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from mpm_ref.scene import build, load
from mpm_ref.scene.records import Solver
from mpm_ref.simulate import simulate

SCENES = sorted((Path(__file__).parents[2] / "scenes").glob("*.toml"))
STEPS = 2


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["explicit", "hot-plus"])
@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_shipped_scene_runs(path, integrator):
    scene = load(path)
    solver = None if integrator == "explicit" else scene.solver
    problem = build(msgspec.structs.replace(scene, integrator=integrator, solver=solver))
    clock = replace(problem.clock, steps=STEPS, end=None, every=1, interval=None)
    for frame in simulate(replace(problem, clock=clock, allow_unstable=integrator == "explicit")):
        state = frame.state
    assert state.step == STEPS
    assert all(np.isfinite(body.particles.x).all() for body in state.bodies)
    assert integrator == "explicit" or state.solve.converged


def test_solver_as_released():
    """Keys that are given win over the defaults of the public code."""
    scene = load(Path(__file__).parents[2] / "scenes" / "hot_twist.toml")
    printed, public = (build(msgspec.structs.replace(scene, solver=solver)).solver
                       for solver in (Solver(), Solver(as_released=True, window=5)))
    assert (printed.balance, printed.cycle.stop) == ("rigid", "residual")
    assert (public.start, public.balance, public.cycle.stop) == ("gravity", "none", "load")
    assert (printed.window, public.window) == (8, 5)
