import re

import numpy as np
import pytest
from command_line import mpm_ref
from sweep_scenes import BOUNCE, FLIGHT, observed_run, scene_of

from mpm_ref.scene import SceneError
from mpm_ref.store.results import BadResults, Results
from mpm_ref.sweep.difference import largest_change
from mpm_ref.sweep.observation import observe
from mpm_ref.sweep.recorded import (
    SHARE,
    at_times,
    cost_of,
    observe_results,
    require_same_problem,
)

FIXED = BOUNCE.replace("end = 0.3", "end = 0.3\ndt = 0.001\nevery = 30")
QUANTITIES = ("positions", "centroid", "front:x+", "profile:y", "path:0.3,0.4",
              "region:0.2,0.3,0.4,0.5", "kinetic", "elastic", "gravity", "energy",
              "mean:J:0,0,1,1", "mean:speed:0,0,1,1", "mean:pressure:0,0,1,1", "front:y-@end")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """The observation of a scene, and the path of its results."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "bounce.toml").write_text(FIXED)
    assert mpm_ref("run", folder / "bounce.toml", "--out", folder / "run.h5",
                   "--quiet").exit_code == 0
    return observed_run(scene_of(FIXED), QUANTITIES, n=11), folder / "run.h5"


@pytest.mark.parametrize("text", QUANTITIES)
def test_quantities_of_a_file_are_those_of_the_run(recorded, text):
    run, path = recorded
    expected, ours = observe(run).values[text], observe_results(path, run).values[text]
    assert ours.shape == expected.shape
    assert ours == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


def test_the_cost_is_that_of_the_whole_run(recorded):
    run, path = recorded
    cost = observe_results(path, run).cost
    with Results(path) as results:
        part, = results.manifest["parts"]
        assert (cost.cpu, cost.wall, cost.steps) == (part["cpu_s"], part["wall_s"], 300)
        assert cost.particles == results.count("block")


def test_what_a_file_does_not_hold_is_not_known(recorded, tmp_path):
    run, _ = recorded
    (tmp_path / "bounce.toml").write_text(FIXED)
    mpm_ref("run", tmp_path / "bounce.toml", "--out", tmp_path / "x.h5", "--fields", "x", "--quiet")
    texts = ("positions", "mean:speed:0,0,1,1", "mean:J:0,0,1,1", "impulse:floor",
             "force:floor")
    values = observe_results(tmp_path / "x.h5", run._replace(quantities=texts)).values
    assert np.isfinite(values["positions"]).all()
    assert all(np.isnan(values[text]).all() for text in texts[1:])


def test_between_frames_values_are_linear():
    series, t = np.array([[0.0, 1.0], [2.0, 1.0], [2.0, 5.0]]), np.array([0.0, 1.0, 2.0])
    assert at_times(series, t, (0.5, 1.75)).tolist() == [[1.0, 1.0], [2.0, 4.0]]


@pytest.mark.parametrize(("changes", "words"), [
    ({"times": (0.0, 0.5)}, "to 0.3 s; expected a run from 0 to the scene's end at 0.5 s"),
    ({"probes": (("other", np.zeros((1, 2))),)}, "block; expected those of the scene: other"),
    ({"probes": (("block", np.zeros((1, 3))),)}, "a run in 2D; the scene is in 3D")])
def test_a_file_of_another_problem_is_refused(recorded, changes, words):
    run, path = recorded
    with pytest.raises(SceneError, match=words):
        observe_results(path, run._replace(**changes))


def test_a_body_in_another_place_is_refused(recorded):
    run, path = recorded
    (name, X), = run.probes
    observe_results(path, run._replace(probes=((name, np.asarray(X) + 0.05),)))
    with pytest.raises(SceneError, match=r"no matter within 0\.1 m of where it is at the start"):
        observe_results(path, run._replace(probes=((name, np.asarray(X) + 0.2),)))


@pytest.mark.parametrize("times", [[], [0.0, 0.2, 0.1, 0.3], [0.0, 0.0, 0.3], [0.0, np.nan, 0.3]])
def test_frames_need_increasing_times(recorded, times):
    run, path = recorded
    with Results(path) as results:
        results.time = np.array(times)
        with pytest.raises(SceneError, match="expected frames at increasing times"):
            require_same_problem(results, run)


def frames_that_would_do(error):
    return int(re.search(r"about (\d+) frames would do where the motion is smooth \(`interval` of "
                         r"the scene\)$", str(error.value))[1])


def test_so_many_frames_would_do(tmp_path):
    """Of a smooth motion, a file with the number of frames that the refusal names is accepted."""
    run, error = observed_run(scene_of(FLIGHT), ("centroid",), n=7), 0.01

    def frames(n):
        text = FLIGHT.replace("end = 0.2", f"end = 0.2\ndt = 0.0005\ninterval = {0.2 / (n - 1)}")
        (tmp_path / "flight.toml").write_text(text)
        assert mpm_ref("run", tmp_path / "flight.toml", "--out", tmp_path / f"{n}.h5",
                       "--quiet").exit_code == 0
        return tmp_path / f"{n}.h5"

    with pytest.raises(SceneError) as few:
        observe_results(frames(5), run, error)
    n = frames_that_would_do(few)
    observe_results(frames(n), run, error)
    with pytest.raises(SceneError):
        observe_results(frames(n // 2), run, error)


def test_too_few_frames_are_refused(recorded):
    run, path = recorded
    between = run._replace(times=(0.0, 0.015, 0.3), quantities=("positions",))
    exact = observe(between).values["positions"]
    ours = observe_results(path, between).values["positions"]
    gap = np.sqrt(np.mean((ours - exact)[1] ** 2)) / largest_change(ours)
    assert 0.0 < gap < SHARE * 0.5
    observe_results(path, between, error=0.5)
    with pytest.raises(SceneError, match="11 frames, between which positions is known to") as few:
        observe_results(path, between, error=gap / SHARE)
    assert 11 < frames_that_would_do(few) < 33          # linear interpolation is of second order
    with pytest.raises(SceneError) as fewer:
        observe_results(path, between, error=gap / SHARE / 16.0)
    assert frames_that_would_do(fewer) == pytest.approx(4 * frames_that_would_do(few), abs=4)
    observe_results(path, run, error=gap / SHARE)       # at the frames nothing is interpolated


def test_a_damaged_file_is_refused(recorded, tmp_path):
    run, path = recorded
    content = path.read_bytes()
    (tmp_path / "half.h5").write_bytes(content[:len(content) // 2])
    with pytest.raises(BadResults):
        observe_results(tmp_path / "half.h5", run)


@pytest.mark.parametrize("parts", [[], [{"why": "killed"}],
                                   [{"cpu_s": 1.0, "wall_s": 1.0}, {"why": "killed"}],
                                   [{"cpu_s": "1", "wall_s": 1.0}], [3], "parts"])
def test_a_file_without_times_of_its_run_has_no_cost(recorded, parts):
    with Results(recorded[1]) as results:
        results.manifest = {"parts": parts}
        assert np.isnan(cost_of(results).cpu)
