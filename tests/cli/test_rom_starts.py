"""Studies of LDM whose bodies start with a velocity, by another transfer, and with weights."""

import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from small_studies import SCENE, write

from mpm_ref.store.results import Results

THROWN = (SCENE.replace('transfer = "pic"', 'transfer = "mls"')
          .replace("point = [0.0, 0.0]", "point = [0.1, 0.0]")
          .replace('density = 1000.0', 'density = 1000.0\nvelocity = { linear = [0.0, 0.0] }'))
KICKS = (("gravity[1]", "body.bar.velocity.linear[1]"), ('name = "g"', 'name = "kick"'))


def make(folder, scene, *changes):
    """Make a study of velocities at the start, its runs and its map in a folder; return it."""
    study = write(folder, *KICKS, *changes, scene=scene)
    for command in (("generate", study, "--out", folder / "data", "--workers", 1),
                    ("train", study, "--data", folder / "data", "--out", folder / "map.npz")):
        done = mpm_ref("rom", *command)
        assert done.exit_code == 0, done.output
    return folder


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder of `make`, with a region that reaches into the body."""
    return make(tmp_path_factory.mktemp("made"), THROWN)


def positions(path):
    """The positions (frames, n, 2) of a results file."""
    with Results(path) as results:
        return np.array([results.field("bar", "x", k) for k in range(len(results))])


def run(made, out, *options, study="bars.toml"):
    return mpm_ref("rom", "run", made / study, "--map", made / "map.npz", *options, "--out", out)


def test_a_reduced_run_starts_with_the_velocity_of_its_parameters(made, tmp_path):
    for kick in (1.0, 2.0):
        done = run(made, tmp_path / f"{kick}.h5", "--set", f"kick={kick}")
        assert done.exit_code == 0, done.output
    slow, fast = (positions(tmp_path / f"{kick}.h5") for kick in (1.0, 2.0))
    moved = [abs(x[-1] - x[0]).max() for x in (slow, fast)]
    assert moved[1] > 1.5 * moved[0] > 0.01


def test_weights_of_driven_samples_are_an_option_of_a_study(made, tmp_path):
    for weight, word in (("4.0", "weighted.toml"), ("0.0", "none.toml")):
        text = (made / "bars.toml").read_text()
        (made / word).write_text(text.replace("[map]", f"[run]\ndriven_weight = {weight}\n\n[map]"))
    for study in ("bars.toml", "weighted.toml"):
        done = run(made, tmp_path / f"{study}.h5", "--set", "kick=1", study=study)
        assert done.exit_code == 0, done.output
    plain, weighted = (positions(tmp_path / f"{study}.h5")
                       for study in ("bars.toml", "weighted.toml"))
    assert abs(weighted - plain).max() > 1e-6
    assert_told(run(made, tmp_path / "none.h5", "--set", "kick=1", study="none.toml"), 2,
                "driven_weight")


def test_boundary_cells_without_cells_are_refused_in_a_sentence(made, tmp_path):
    text = (made / "bars.toml").read_text()
    for quadrature, cells, word in (("eulerian", "cut", "cut.toml"),
                                    ("eulerian", "whole", "whole.toml"),
                                    ("lagrangian", "cut", "points.toml")):
        (made / word).write_text(text.replace(
            "[map]",
            f'[run]\nquadrature = "{quadrature}"\nboundary_cells = "{cells}"\n\n[map]'))
    for study in ("cut.toml", "whole.toml"):
        done = run(made, tmp_path / f"{study}.h5", "--set", "kick=1", study=study)
        assert done.exit_code == 0, done.output
    cut, whole = (positions(tmp_path / f"{study}.h5") for study in ("cut.toml", "whole.toml"))
    assert abs(cut - whole).max() > 1e-6
    assert_told(run(made, tmp_path / "none.h5", "--set", "kick=1", study="points.toml"), 2,
                "boundary_cells = 'cut' with quadrature = 'lagrangian': expected 'whole'")


def test_a_weight_where_nothing_is_prescribed_is_refused_in_a_sentence(tmp_path):
    folder = make(tmp_path, THROWN[:THROWN.index("[[fixed]]")], ("r = 3", "r = 1"))
    text = (folder / "bars.toml").read_text()
    (folder / "free.toml").write_text(
        text.replace("[map]", "[run]\ndriven_weight = 4.0\n\n[map]"))
    assert_told(run(folder, tmp_path / "run.h5", "--set", "kick=1", study="free.toml"), 2,
                "driven_weight = 4: expected 1, since the scene prescribes no velocity")
