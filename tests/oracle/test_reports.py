"""What a check says of files that are partly given, of another scene, or golden themselves; and
what is recorded of the length of a step.
"""

from dataclasses import replace
from math import ceil
from pathlib import Path

import numpy as np
import pytest
from goldens import STEPS, kernel_arrays, run_example, stretched
from problems import JELLY, ball

from mpm_ref import oracle
from mpm_ref.materials import NoFlow
from mpm_ref.oracle import recording
from mpm_ref.problem import Clock
from mpm_ref.simulate import simulate

ROOT = Path(__file__).resolve().parents[2]


def test_a_golden_file_agrees_with_itself(golden):
    report = oracle.check(golden, golden)
    assert report.agrees
    assert report.compared == STEPS * 24
    assert report.missing == report.unknown == ()


def test_how_many_steps_are_given_is_said_first(checked):
    theirs = kernel_arrays(stretched())
    report = checked(theirs[:1])
    assert report.steps == (1, STEPS)
    assert str(report).startswith("agrees as far as given (1 of 2 steps): 24 arrays at f64")
    assert str(report).endswith("; not given: step 1")
    assert str(checked([None, theirs[1]])).startswith("agrees as far as given (1 of 2 steps)")
    assert str(checked([{"jello/x": np.ones(3)}, theirs[1]])).startswith("agrees as far as given")
    assert str(checked(theirs)).startswith("agrees: 48 arrays at f64")
    assert checked([*theirs, theirs[0]]).unknown == ("step 2",)


def test_another_scene_is_thought_of(checked):
    smaller = ball("jelly", (0.31, 0.13), JELLY, NoFlow(), radius=1.0)
    report = checked(kernel_arrays(replace(stretched(), bodies=(smaller, stretched().bodies[1]))))
    assert report.first.array == "jelly/weights"
    assert f"has shape ({len(smaller.id)}, 9), expected (" in report.first.what
    assert report.first.what.endswith("; is it the same scene?")
    theirs = kernel_arrays(stretched())
    theirs[0]["jelly/F"] = theirs[0]["jelly/F"][:, 0]
    assert "same scene" not in checked(theirs).first.what         # as many particles


@pytest.mark.parametrize("clock", [
    Clock(dt=1e-3, steps=9), Clock(cfl=0.4, steps=9), Clock(cfl=0.4, end=0.0101),
    Clock(cfl=0.4, end=1.0, interval=0.0073), Clock(cfl=0.4, end=1.0, longest=1e-5),
], ids=["fixed", "adaptive", "end", "frames", "longest"])
def test_a_recorded_step_is_as_long_as_the_first_of_a_run(clock):
    made = []

    def note(state, dt):
        made.append(dt)
        raise StopIteration

    recorded, = recording.record_steps(replace(stretched(), clock=clock), 1)
    with pytest.raises(RuntimeError):
        list(simulate(replace(stretched(), clock=clock), on_step=note))
    assert recorded.dt == made[0]
    if clock.interval:
        assert ceil(clock.interval / recorded.dt - 1e-9) * recorded.dt == pytest.approx(
            clock.interval)


def test_the_example_runs_anywhere_and_leaves_nothing(tmp_path):
    output = run_example("check_my_backend.py", tmp_path)
    assert output.startswith("agrees: 33 arrays at f64 tolerance")
    assert "not given: disk/F_trial, disk/L, disk/energy" in output
