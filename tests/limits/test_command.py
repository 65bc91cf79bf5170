"""The command on small scenes: margins at bounds that are known, files, the store, and errors."""

import json

import pytest
from command_line import SCENE, assert_told, mpm_ref
from offline_page import assert_holds

from mpm_ref.cli.sweep_options import load_sweep, observed_of
from mpm_ref.cli.terminal import as_json
from mpm_ref.executor import open_executor
from mpm_ref.limits import axes
from mpm_ref.limits.figure import draw_limits
from mpm_ref.limits.page import page_facts
from mpm_ref.limits.verdict import CellJudge
from mpm_ref.scene import build, load
from mpm_ref.sweep.quantity import with_companions
from mpm_ref.sweep.runs import RunRequest, SceneRuns
from mpm_ref.sweep.setting import scene_at, setting
from mpm_ref.sweep.store import RunStore
from mpm_ref.timestep import stable_dt

AT_REST = SCENE.replace("gravity = [0.0, -9.8]\n", "").replace(
    "dt = 0.001\nsteps = 40", "dt = 0.0005\nsteps = 10")


def limit_to(monkeypatch, *names):
    """Let the command change some axes alone, so that a test takes seconds."""
    monkeypatch.setattr(axes, "AXES", tuple(axes.AXIS[name] for name in names))


def limits(folder, text, *arguments):
    """The answer of the command on a scene, and its JSON file."""
    (folder / "disk.toml").write_text(text)
    done = mpm_ref("limits", folder / "disk.toml", "--out", folder, "--workers", "1",
                   "--budget", "10min", "--quiet", *arguments)
    file = folder / "disk.limits.json"
    return done, json.loads(file.read_text()) if file.exists() else None


def direction(facts, axis, way):
    return next(one for one in facts["directions"]
                if (one["axis"], one["direction"]) == (axis, way))


def test_bounds_of_the_time_step_are_the_margins(tmp_path, monkeypatch):
    """A disk at rest stays right up to the stable time step, whatever is changed."""
    limit_to(monkeypatch, "time_step", "density")
    done, facts = limits(tmp_path, AT_REST)
    problem = build(load(tmp_path / "disk.toml"))
    bound = stable_dt(problem.bodies, problem.stepper()).dt / 0.0005
    for axis, way, expected in (("time_step", "up", bound), ("density", "down", bound**2)):
        one = direction(facts, axis, way)
        assert one["margin"] <= expected <= 1.1 * one["margin"]
        assert (one["first_bad"]["outcome"], one["end"]) == ("refused", "failure")
        assert "past the stable time step" in one["sentence"]
    assert done.exit_code == 0
    assert facts["nearest"]["axis"] == "time_step"
    assert f"nearest failure: {facts['nearest']['sentence']}" in done.stdout
    assert direction(facts, "density", "up")["end"] == "not tried farther"
    assert facts["complete"]
    assert not facts["wrong"]
    assert "no cell finished with a wrong result" in done.stdout


@pytest.fixture(scope="module")
def falling(tmp_path_factory):
    """The answer for a falling disk whose longer steps are wrong by the error of Euler's method,
    and the folder.
    """
    folder = tmp_path_factory.mktemp("falling")
    with pytest.MonkeyPatch.context() as patch:
        limit_to(patch, "time_step", "gravity")
        return *limits(folder, SCENE), folder


def test_wrong_cells_come_first(falling):
    done, facts, _ = falling
    assert facts["wrong"]
    assert facts["limits"] == {"setting": len(facts["wrong"])}
    assert done.stdout.startswith(f"finished and wrong: {len(facts['wrong'])} of "
                                  f"{len(facts['cells'])} cells, {len(facts['wrong'])} by setting"
                                  "\n  time_step x")
    one = direction(facts, "time_step", "up")
    assert one["first_bad"]["outcome"] == "wrong"
    assert one["first_bad"]["error"] > facts["tolerance"]["positions"]
    assert one["good_value"].startswith("dt = 0.001")
    distances = [max(cell["factors"].values()) for cell in facts["wrong"]
                 if len(cell["factors"]) == 1]
    assert distances == sorted(distances)


def test_figure_shows_margins_and_maps(falling):
    _, facts, folder = falling
    figure = draw_limits(facts)
    bars, *maps = figure.axes
    assert [label.get_text() for label in bars.get_yticklabels()] == ["time step", "gravity"]
    assert len(bars.patches) == 4
    assert len(maps) == len(facts["maps"]) == 1
    assert {text.get_text() for text in figure.legends[0].texts} >= {"right", "finished and wrong"}
    caption = figure.legends[0].get_title().get_text()
    assert caption == f"finished and wrong: {len(facts['wrong'])} by setting"
    labels = [text.get_text() for text in bars.texts]
    assert any(label.endswith(" setting") for label in labels)
    assert (folder / "disk.limits.png").read_bytes().startswith(b"\x89PNG")


def test_page_is_written(falling):
    _, facts, folder = falling
    page = (folder / "disk.limits.html").read_text()
    assert_holds(page, json.loads(as_json(page_facts(facts))))


def test_second_command_makes_no_new_run(falling, monkeypatch):
    _, facts, folder = falling
    limit_to(monkeypatch, "time_step", "gravity")
    monkeypatch.setattr(RunStore, "put", lambda *_: pytest.fail("a new run"))
    again, facts_again = limits(folder, SCENE, "--json")
    assert facts_again == facts
    assert json.loads(again.stdout) == facts


def test_the_scene_as_given_and_its_grids_are_runs_of_trade(falling, monkeypatch):
    _, _, folder = falling
    monkeypatch.setattr(RunStore, "put", lambda *_: pytest.fail("a new run"))
    record, path, _ = load_sweep(folder / "disk.toml")
    observed = observed_of(record, path, with_companions(("positions",), 2))
    with open_executor(workers=1) as executor:
        runs = SceneRuns(observed, executor, RunStore(folder / "disk.trade"))
        chosen = {factor: setting(dx=factor) for factor in (1.0, 0.5)}
        assert all(run.finished for run in runs.observe(
            {factor: RunRequest(scene_at(record, one)) for factor, one in chosen.items()}).values())


def test_small_budget_says_so_and_the_next_command_goes_on(tmp_path, monkeypatch):
    limit_to(monkeypatch, "time_step")
    with monkeypatch.context() as patch:
        patch.setattr(CellJudge, "judge", lambda self, cells, *_: dict.fromkeys(cells))
        done, facts = limits(tmp_path, SCENE)
    assert done.exit_code == 0
    assert not facts["complete"]
    assert "the time step: whether it may grow was not tried within the budget" in done.stdout
    assert "larger --budget goes on: at least" in done.stdout
    assert facts["missing_cpu"] == pytest.approx(6.0 * facts["cpu"])        # rungs, of one cell
    assert limits(tmp_path, SCENE)[1]["complete"]


def test_scene_that_breaks_as_given_has_no_answer(tmp_path):
    done, facts = limits(tmp_path, SCENE.replace("-9.8", "-2000.0"))
    assert_told(done, 1, "disk.toml", "as given", "unstable")
    assert facts is None


@pytest.mark.parametrize(("arguments", "words"), [
    (("--error", "2"), ("--error 2", "between 0 and 1")),
    (("--budget", "soon"), ("--budget soon", "20min")),
    (("--quantity", "warmth"), ("warmth", "expected positions")),
    (("--workers", "0"), ("--workers 0",)),
    (("--quantity", "path:0.5"), ("path:0.5", "expected path:X,Y")),
    (("--quantity", "path:0.5,1,1"), ("[0.5, 1.0, 1.0]", "expected 2 numbers")),
])
def test_bad_option_is_one_sentence(tmp_path, arguments, words):
    done, facts = limits(tmp_path, SCENE, *arguments)
    assert_told(done, 2, *words)
    assert facts is None


def test_unknown_scene_is_one_sentence(tmp_path):
    assert_told(mpm_ref("limits", "helo", "--out", tmp_path), 2, "did you mean hello?")


def test_ctrl_c_says_how_to_go_on(tmp_path, monkeypatch):
    def interrupted(self):
        self.runs.count = 7
        raise KeyboardInterrupt
    monkeypatch.setattr(CellJudge, "start", interrupted)
    done, _ = limits(tmp_path, SCENE)
    assert_told(done, 130, "after 7 runs", "disk.trade", "the same command goes on")


def test_warning_of_a_wrong_cell_is_shown(tmp_path, monkeypatch):
    """A cell whose run would begin with a warning is not silent."""
    limit_to(monkeypatch, "time_step")
    text = SCENE + ('\n[[collider]]\nshape = { type = "half_space", point = [0.0, 0.22], '
                    'normal = [0.0, 1.0] }\nkind = "slip"\n')
    done, facts = limits(tmp_path, text)
    assert facts["wrong"]
    assert all("start inside collider[0]" in cell["warnings"][0] for cell in facts["wrong"])
    assert f", {len(facts['wrong'])} by a warning of the run\n" in done.stdout


def test_interval_is_no_bound_of_a_longer_step(tmp_path, monkeypatch):
    limit_to(monkeypatch, "time_step")
    _, facts = limits(tmp_path, AT_REST.replace("every = 10", "interval = 0.0005"))
    assert "past the stable time step" in direction(facts, "time_step", "up")["sentence"]
