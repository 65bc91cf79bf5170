"""A study of LDM whose scene has two elastic bodies, through the command line."""

import json

import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from two_blocks import SCENE, STEPS, write

from mpm_ref.rom.study import dataset, evaluate, generate, reduce
from mpm_ref.rom.study.study import load
from mpm_ref.scene import build
from mpm_ref.store.results import Results


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a study, its runs and its map."""
    folder = tmp_path_factory.mktemp("made")
    study = write(folder)
    for command in (("generate", study, "--out", folder / "data", "--workers", 1),
                    ("train", study, "--data", folder / "data", "--out", folder / "map.npz")):
        done = mpm_ref("rom", *command)
        assert done.exit_code == 0, done.output
    return folder


def run(made, out, *options, study="study.toml"):
    return mpm_ref("rom", "run", made / study, "--map", made / "map.npz", *options, "--out", out)


def test_data_have_all_bodies(made):
    study = load(made / "study.toml")
    snapshots = dataset.load(study, made / "data", (0, 1))
    assert snapshots.x.shape == (2, STEPS + 1, 80, 2)
    assert snapshots.F.shape == (2, STEPS + 1, 80, 2, 2)
    with Results(generate.file_of(made / "data", 1)) as results:
        assert np.array_equal(snapshots.x[1, 3, 48:], results.field("hard", "x", 3))
        assert np.array_equal(snapshots.m[:48], results.field("soft", "m"))


@pytest.mark.parametrize("points", [None, 30], ids=["all", "some"])
def test_a_reduced_run_has_the_bodies_of_the_full_one(made, tmp_path, points):
    study = load(made / "study.toml")
    number, = study.test
    text = (made / "study.toml").read_text()
    (made / "some.toml").write_text(text + (f"\n[run]\npoints = {points}\n" if points else ""))
    done = run(made, tmp_path / "run.h5", "--set", f"v={study.mu[number, 0]}", study="some.toml")
    assert done.exit_code == 0, done.output
    with Results(tmp_path / "run.h5") as reduced, Results(
            generate.file_of(made / "data", number)) as full:
        assert reduced.bodies == full.bodies == ["soft", "hard"]
        for body in full.bodies:
            for name in ("m", "V0"):
                assert np.array_equal(reduced.field(body, name), full.field(body, name))
            x, expected = (one.field(body, "x", STEPS) for one in (reduced, full))
            assert np.allclose(*(one.field(body, "v", 0) for one in (reduced, full)), atol=1e-12)
            moved = np.linalg.norm(expected - full.field(body, "x", 0))
            assert np.linalg.norm(x - expected) < 0.03 * moved
        F, tau = (reduced.field("hard", name, STEPS) for name in ("F", "tau"))
        assert abs(F - np.eye(2)).max() > 1e-4
        soft = reduced.field("soft", "tau", STEPS)
        assert abs(tau).max() / abs(F - np.eye(2)).max() > 2.0 * abs(soft).max() / abs(
            reduced.field("soft", "F", STEPS) - np.eye(2)).max()
        assert np.isfinite(reduced.energy).all()


def test_errors_are_near_those_of_the_nearest_states(made):
    done = mpm_ref("rom", "evaluate", made / "study.toml", "--map", made / "map.npz", "--data",
                   made / "data", "--out", made / "errors.png", "--json")
    assert done.exit_code == 0, done.output
    errors = json.loads(done.stdout)["all"]
    assert 0.0 < errors["nearest"]["displacement"] < 1e-3
    assert errors["reduced"]["displacement"] < 10.0 * errors["nearest"]["displacement"] + 1e-3


def test_a_curved_map_is_one_of_several_bodies_too(made):
    study = load(write(made, ("r = 6", "r = 2\nmodes = 6"), ('"modes"', '"curved"'),
                       ("[map]", '[run]\nprojection = "nonlinear"\n\n[map]')))
    write(made)
    data = dataset.load(study, made / "data", study.train)
    model = reduce.compute_model(study, data, {})
    held_out = dataset.load(study, made / "data", study.test)
    one, = evaluate.evaluate(study, model, held_out)
    assert not one.breakdowns
    assert one.paths["reduced"].errors.displacement < 0.1


@pytest.mark.parametrize(("edit", "words"), [
    (("[map]", '[run]\nquadrature = "eulerian"\n\n[map]'), "quadrature = 'eulerian' with 2 bodies"),
    (("[map]", '[run]\nquadrature = "resampled"\n\n[map]'),
     "quadrature = 'resampled' with 2 bodies"),
    (('kind = "modes"', 'kind = "network"'), "map.kind = 'network' with 2 bodies"),
    (("[map]", '[run]\nboundary_cells = "cut"\n\n[map]'),
     "boundary_cells = 'cut' with quadrature = 'lagrangian'"),
], ids=["eulerian", "resampled", "network", "cut"])
def test_what_two_bodies_do_not_have_is_refused_before_runs_are_made(tmp_path, edit, words):
    study = write(tmp_path, edit)
    done = mpm_ref("rom", "generate", study, "--out", tmp_path / "data", "--workers", 1)
    assert_told(done, 2, words)
    assert not (tmp_path / "data").exists()


def test_a_network_is_refused_before_a_training(made, tmp_path):
    done = mpm_ref("rom", "train", made / "study.toml", "--data", made / "data", "--kind",
                   "network", "--out", tmp_path / "net.npz")
    assert_told(done, 2, "map.kind = 'network' with 2 bodies", "one continuous map")


def test_several_bodies_are_shown_at_their_own_points(made, tmp_path):
    done = run(made, tmp_path / "run.h5", "--set", "v=1", "--points-out", 100)
    assert_told(done, 2, "--points-out 100: reduced runs of several bodies", "leave it out")


def test_a_weight_without_prescribed_nodes_is_refused_before_runs_are_made(tmp_path):
    study = write(tmp_path, ("[map]", "[run]\ndriven_weight = 4.0\n\n[map]"),
                  scene=SCENE[:SCENE.index("[[fixed]]")])
    done = mpm_ref("rom", "generate", study, "--out", tmp_path / "data", "--workers", 1)
    assert_told(done, 2, "driven_weight = 4: expected 1")
    assert not (tmp_path / "data").exists()


def test_snapshots_of_several_bodies_come_from_a_study(made):
    study = load(made / "study.toml")
    with pytest.raises(ValueError, match="2 bodies: expected one"):
        dataset.simulate_snapshots([build(study.scene(study.mu[0]))], study.mu[:1])
