"""What NSF's state figures show, and the figures themselves."""

import importlib
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest

from figures.common import field_panels
from figures.common.bodies import ROOM, padded_box
from figures.nsf import fig18
from mpm_ref.rom.kinematics import NoBody
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.run import FieldRunOptions, nsf_run
from mpm_ref.rom.symmetric import tensor
from validation.ldm.published_bodies import read
from validation.nsf import reduced_runs, states
from validation.nsf.studies import jelly

pytestmark = pytest.mark.slow

mpl.use("Agg")
TEST, ID = 0.45, "nsf.jelly"


@pytest.fixture(scope="module")
def cube():
    """The jelly cube at half the resolution."""
    return reduced_runs.fit_study(jelly(2))


@pytest.fixture
def run(tmp_path):
    """What an experiment is told of its run."""
    return SimpleNamespace(folder=tmp_path, experiment=SimpleNamespace(id=ID))


def test_states_are_those_of_both_runs_at_the_same_times(cube, run, monkeypatch):
    monkeypatch.setattr(states, "MOST", 100)
    states.keep_states(run, cube, (TEST,), ("map", "stress"))
    kept = read(run.folder, ID)
    x, last = cube.tests[TEST].x[0], cube.tests[TEST].x.shape[1] - 1
    assert kept["values"].tolist() == ["0.45"]
    assert kept["levels"].tolist() == [round(last / 3), round(2 * last / 3), last]
    shown = states.even_subset(cube.runs.X, 100)
    assert len(shown) == 100
    assert kept["0.45_true"] == pytest.approx(x[kept["levels"]][:, shown], abs=1e-4)
    own, alone = (np.abs(kept[f"0.45_{word}"] - kept["0.45_true"]).max()
                  for word in ("ours", "map"))
    assert 1e-4 < own < 0.3 * alone
    tau = tensor(cube.tests[TEST].tau[0, -1, shown].astype(float), 3)
    size = np.sqrt(np.sum(tau**2, axis=(1, 2)))
    assert kept["0.45_true_tau"][-1] == pytest.approx(size, abs=1e-3 * size.max())
    assert kept["0.45_ours_tau"].shape == (3, len(shown))
    for word, k in (("first", 0), ("last", -1)):
        assert kept[word] == pytest.approx(cube.runs.x[k, kept["levels"]][:, shown], abs=1e-4)


def test_stress_is_kept_where_it_is_asked_for(cube, run):
    states.keep_states(run, cube, (TEST,))
    assert {*read(run.folder, ID)} == {"values", "levels", "first", "last", "0.45_true",
                                       "0.45_ours"}


def test_a_run_on_samples_with_weights_is_kept_where_it_is_asked_for(cube, run):
    states.keep_states(run, cube, (TEST,), ("weighed",))
    kept = read(run.folder, ID)
    assert "0.45_map" not in kept
    scene, shown = nsf_full_model(cube.study.run(TEST)), np.arange(len(cube.runs.X))
    plan = FieldRunOptions(cube.study.chosen(scene, cube.study.samples, 0, cube.fields))
    *_, (_, last, *_) = nsf_run(scene, cube.fields_of_run(TEST), plan, cube.rest).states()
    assert kept["0.45_weighed"][-1] == pytest.approx(cube.fields.place(shown, last.xhat), abs=1e-4)
    assert np.abs(kept["0.45_weighed"] - kept["0.45_ours"]).max() > 1e-3


def test_a_run_that_breaks_down_has_no_place_from_then_on(cube, monkeypatch):
    make_run, test = states.nsf_run, cube.tests[TEST]

    def breaks(*given):
        for state in make_run(*given).states():
            if state.t > 0.5 * test.dt * (test.x.shape[1] - 1):
                raise NoBody("gone")
            yield state

    monkeypatch.setattr(states, "nsf_run",
                        lambda *given: SimpleNamespace(states=lambda: breaks(*given)))
    found = states.run_points("one", cube, TEST, np.arange(5))
    assert [np.isfinite(found["one"][k]).all() for k in range(3)] == [True, False, False]


@pytest.fixture
def results(cube, run):
    """Results with kept states."""
    states.keep_states(run, cube, (TEST,), ("map", "stress"))
    return SimpleNamespace(folder=run.folder)


def test_a_row_for_each_way_and_a_column_for_each_time(results):
    view = field_panels.RunView(ID, jelly, "{} m/s")
    figure = field_panels.reduced_and_full(results, view, ("true", "ours", "map"))
    assert len(figure.axes) == 9
    assert [ax.texts[0].get_text() for ax in figure.axes[::3]] == [
        "0.45 m/s\nfull order", "reduced", "map alone"]
    assert [ax.get_title() for ax in figure.axes] == [
        "t = 0.4 s", "t = 0.8 s", "t = 1.2 s", *6 * [""]]
    training = field_panels.training_range(results, view)
    assert [ax.texts[0].get_text() for ax in training.axes[::3]] == ["0.3 m/s", "0.5 m/s"]
    assert len(field_panels.stress_panels(results, view).axes) == 7     # with a colour bar
    ends = field_panels.ends_by_value(results, view, ("true", "ours", "map"))
    assert [ax.get_title() for ax in ends.axes] == ["0.45 m/s, t = 1.2 s", "", ""]


def test_points_that_fly_away_are_left_out(rng):
    """A run may lose points; the box of the full-order runs and ROOM of its longest side stay."""
    x = rng.uniform(size=(30, 3)) * (1.0, 0.2, 0.2)
    x[:2] = [[0.0, 0.0, 0.0], [1.0, 0.2, 0.2]]
    ends = padded_box(x)
    assert ends == pytest.approx(np.array([3 * [-ROOM], [1.0 + ROOM, 0.2 + ROOM, 0.2 + ROOM]]))
    far = 1.0 + ROOM
    gone = np.concatenate([x, [[far - 0.01, 0, 0], [far + 0.01, 0, 0], [0, -5.0, 0]]])
    panel = field_panels.clipped_panel(gone, "#ffffff", 0.1, ends)
    assert len(panel.solid.x) == 31
    assert panel.note == "6.1 % outside"
    assert field_panels.clipped_panel(x, "#ffffff", 0.1, ends).note == ""
    away = field_panels.clipped_panel(x + 10.0, "#ffffff", 0.1, ends)
    assert len(away.solid.x) == 0
    assert away.note == "1e+02 % outside"


def test_points_taken_out_in_rows_are_as_far_apart_as_rows():
    """Balls then fill the body; on a whole lattice they are as large as its spacing."""
    rows = np.stack(np.meshgrid(0.25 * np.arange(20), np.arange(6.0), np.arange(6.0)), -1)
    assert field_panels.spread(rows.reshape(-1, 3)) == pytest.approx(0.375)     # nearest: 0.25
    lattice = np.stack(np.meshgrid(*3 * [np.arange(6.0)]), -1).reshape(-1, 3)
    assert field_panels.spread(lattice) == pytest.approx(1.0)


@pytest.mark.parametrize(("number", "values", "also", "sides"), [
    ("01", 3, (), ["full order", "reduced"]),
    ("05", 1, ("map",), ["E = {0} Pa\nfull order", "reduced", "map alone"]),
    ("07", 2, (), ["friction {0}°\nfull order", "reduced", "friction {1}°\nfull order", "reduced"]),
    ("08", 2, ("stress",), ["$\\xi$ = {0}\nfull order", "reduced", "$\\xi$ = {1}\nfull order",
                            "reduced"]),
    ("09", 2, ("stress",), ["$\\xi$ = {0}\nfull order", "reduced"]),
    ("10", 2, ("weighed",), ["full order", "reduced", "with weights"]),
    ("12", 1, ("map",), ["{0} m/s\nfull order", "reduced", "map alone"]),
    ("13", 1, ("map",), ["plane at {0}°\nfull order", "reduced", "map alone"]),
    ("14", 2, (), ["{0}\nfull order", "reduced", "{1}\nfull order", "reduced"]),
    ("17", 2, (), ["friction {0}°\nfull order", "reduced", "friction {1}°\nfull order", "reduced"]),
    ("15", 1, ("map",), ["E = 1 Pa", "E = 13 Pa"]),
    ("16", 2, (), ["friction 21°", "friction 38.5°"])])
def test_figures_show_all_that_experiments_keep(number, values, also, sides, tmp_path, rng):
    """A row for each parameter kept (of the stress, for one) and each way."""
    script = importlib.import_module(f"figures.nsf.fig{number}")
    names, x = [f"{0.1 * k:g}" for k in range(1, values + 1)], rng.uniform(size=(3, 40, 3))
    words = ["true", "ours", *(word for word in states.KINDS if word in also)]
    kept = {"values": np.array(names), "levels": np.arange(1, 4), "first": x, "last": x}
    kept |= {f"{name}_{word}": x for name in names for word in words}
    if "stress" in also:
        kept |= {f"{name}_{word}_tau": x[..., 0] for name in names for word in words}
    states.keep(SimpleNamespace(folder=tmp_path, experiment=SimpleNamespace(id=script.NEEDS[0])),
                **kept)
    axes = script.draw(SimpleNamespace(folder=tmp_path)).axes
    found = [ax.texts[0].get_text() for ax in axes if ax.texts and ax.texts[0].get_text()]
    assert found == [side.format(*names) for side in sides]


def test_a_run_that_broke_down_is_an_empty_panel():
    gone = field_panels.clipped_panel(np.full((4, 3), np.nan), "white", 0.1)
    assert len(gone.solid.x) == 0
    assert gone.note == "broke down"


def test_time_shares_are_of_the_most_samples_and_gauss_newton():
    stages = {"integration": 3e-3, "inferred": 2e-3, "moved": 1e-3, "inverted": 1e-3}
    rows = [("metal", 10, "nonlinear", 1.0), ("metal", 30, "linear", 2.0),
            ("metal", 30, "nonlinear", 4.0), ("cake", 700, "nonlinear", 8.0)]
    table = {"scene": np.array([r[0] for r in rows]), "samples": np.array([r[1] for r in rows]),
             "inversion": np.array([r[2] for r in rows]),
             "reduced": np.array([1e-3 * r[3] for r in rows])}
    table |= {name: np.full(4, value) for name, value in stages.items()}
    cake, metal = fig18.draw(SimpleNamespace(table=lambda id, name: table)).axes
    assert cake.get_title() == "cake, 700 samples: 8 ms a step"
    assert metal.get_title() == "metal, 30 samples: 4 ms a step"
    assert cake.patches[0].r == pytest.approx(np.sqrt(2.0) * metal.patches[0].r)
