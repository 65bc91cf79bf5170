"""Rivals of learned laws: positions that cost no run, and what is recorded beside them."""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.scene import build
from validation.common.scenes import with_
from validation.nclaw import beats
from validation.nclaw.errors import ErrorRow
from validation.nclaw.evaluate import compare, frames
from validation.nclaw.rivals import RIVALS
from validation.nclaw.tasks import scenes

STEPS = 20


@pytest.fixture
def scene():
    """The start of the jelly's training run, in free flight."""
    return with_(scenes("reconstruction", "jelly")[0], steps=STEPS)


def test_points_stay_or_fly(scene):
    problem = build(scene)
    q, t = problem.bodies[0].particles, STEPS * scene.dt
    *_, still = frames(problem, RIVALS["no-motion"])
    *_, flown = frames(problem, RIVALS["ballistic"])
    assert np.array_equal(still, q.x)
    assert np.allclose(flown, q.x + t * q.v + t * t * problem.gravity / 2, rtol=0.0, atol=1e-15)


def test_points_in_flight_end_at_the_walls(scene):
    problem = build(with_(scene, steps=100 * STEPS))
    *_, flown = frames(problem, RIVALS["ballistic"])
    low, high = problem.clip
    assert (flown >= low).all()
    assert (flown <= high).all()
    assert (flown == low).any()


def test_free_flight_is_nearer_than_no_motion_before_an_impact(scene):
    still, flown = compare(scene, [RIVALS["no-motion"], RIVALS["ballistic"]])
    assert 0.0 < flown.error < 0.1 * still.error


def test_learned_laws_are_recorded_beside_each_rival():
    """Means over draws; a run that broke down beats none."""
    errors = {"ours": (1.0, 3.0), "neural": (np.inf, 1.0), "sys-id": (0.5, 0.5),
              "no-motion": (8.0, 8.0), "gnn": (1.0, 1.0)}
    rows = [ErrorRow(method, "jelly", "velocity", draw, error, -1, "")
            for method, own in errors.items() for draw, error in enumerate(own)]
    found = {}
    run = SimpleNamespace(profile="standard", record=lambda name, value, **rule: found.update(
        {name: (value, rule.get("bound"))}))
    beats.record_beats(run, "nclaw.table2", rows)
    start = "nclaw.table2.beats"
    assert found == {
        f"{start}.sys-id.ours.jelly.velocity": (4.0, None),
        f"{start}.no-motion.ours.jelly.velocity": (0.25, 1.0),
        f"{start}.sys-id.neural.jelly.velocity": (np.inf, None),
        f"{start}.no-motion.neural.jelly.velocity": (np.inf, 1.0)}
