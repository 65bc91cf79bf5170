"""Steps that are measured over an entire run lie evenly, and are steps of the run itself."""

import numpy as np

from mpm_ref.scene import build
from mpm_ref.simulate import simulate
from validation.common.scenes import catalogue_scene, with_
from validation.hot.table3_runs import steps_evenly


def small(steps):
    """The first steps of a bust of few particles, held at its foot and turned at its head."""
    scene = catalogue_scene("hot_faceless", unstable="allow", dx=0.06, integrator="hot")
    scene = with_(scene, end=steps * scene.longest)
    body = scene.body[0]
    return with_(scene, body=(with_(body, sampling=with_(body.sampling, count=500)),))


def test_steps_lie_evenly_over_a_run_and_do_not_change_it():
    problem, found = build(small(6)), []
    for state, step in steps_evenly(problem, 3):
        found.append((state.step, step.t, step.dt))
    dt = found[0][2]
    assert [n for n, _, _ in found] == [1, 3, 5]
    np.testing.assert_allclose([t for _, t, _ in found], [dt, 3 * dt, 5 * dt], rtol=1e-12)
    *_, last = simulate(build(small(6)))
    for ours, theirs in zip(state.bodies, last.state.bodies, strict=True):
        np.testing.assert_array_equal(ours.particles.x, theirs.particles.x)
