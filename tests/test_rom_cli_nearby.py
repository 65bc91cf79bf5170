"""`mpm-ref rom evaluate`: the training run with the nearest parameters, taken as it is."""

import json
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
import small_nsf_studies
import small_studies
from command_line import mpm_ref

from mpm_ref.reduced import dataset
from mpm_ref.reduced.errors import Errors
from mpm_ref.reduced.nearby import Nearby, facts, lines, nearest_run
from mpm_ref.reduced.study import load


@pytest.fixture(scope="module", params=[
    (small_studies, "bars.toml", "map.npz", 0), (small_nsf_studies, "pairs.toml", "fields.npz", 1),
], ids=["ldm", "nsf"])
def made(request, tmp_path_factory):
    """Folder with a study, its runs and its map; the study's file, the map, and the first of the
    levels that count.
    """
    module, study, map, first = request.param
    return module.modelled(tmp_path_factory.mktemp(module.__name__)), study, map, first


def evaluated(made, data, *options):
    folder, study, map, _ = made
    done = mpm_ref("rom", "evaluate", folder / study, "--map", folder / map, "--data", data,
                   "--overwrite", *options)
    assert done.exit_code == 0, done.output
    return done.stdout


def test_its_errors_are_those_of_its_states_beside_the_run_held_out(made, tmp_path):
    folder, name, _, first = made
    study = load(folder / name)
    (number,) = study.test
    taken = nearest_run(study, number)
    assert abs(study.mu[taken] - study.mu[number]) == min(
        abs(study.mu[k] - study.mu[number]) for k in study.train)
    out = tmp_path / "e.png"
    own, = json.loads(evaluated(made, folder / "data", "--json", "--out", out))["nearby"]
    both = dataset.load(study, folder / "data", (number, taken))
    reference, x = both.x[:, first:].astype(float)
    error = np.linalg.norm(x - reference)
    assert (own["number"], own["training_run"]) == (number, taken)
    assert own["origin"] == pytest.approx(error / np.linalg.norm(reference), rel=1e-6)
    assert own["displacement"] == pytest.approx(
        error / np.linalg.norm(reference - both.X), rel=1e-6)
    row = f"{number:>13}{taken:>13}{100.0 * own['origin']:>13.3g}"
    assert row in evaluated(made, folder / "data", "--out", out)


def test_without_its_data_it_is_left_out(made, tmp_path):
    folder, name, *_ = made
    study = load(folder / name)
    (number,) = study.test
    shutil.copy(folder / "data" / f"case-{number:03d}.h5", tmp_path)
    own, = json.loads(evaluated(made, tmp_path, "--json", "--out", tmp_path / "e.png"))["nearby"]
    assert own == {"number": number, "training_run": nearest_run(study, number)}


def test_parameters_are_measured_in_their_ranges():
    """Without, the third one would decide alone. The second does not vary in the training, and is
    no reason to divide by zero.
    """
    mu = np.array([[0.0, 5.0, 0.0], [1.0, 5.0, 1000.0], [0.1, 5.0, 600.0], [0.9, 5.0, 400.0]])
    study = SimpleNamespace(mu=mu, train=(1, 0), test=(2, 3))
    assert (nearest_run(study, 2), nearest_run(study, 3)) == (0, 1)


def test_a_table_has_a_row_for_each():
    found = [Nearby(3, 1, Errors(0.01, 0.02, 0.5)), Nearby(4, 2, None)]
    heading, *rows = lines(found)
    assert "[%]" in heading
    assert [row.split() for row in rows] == [
        ["run", "of", "origin", "centroid", "displacement"], ["3", "1", "1", "2", "50"],
        ["4", "2", "no", "data", "no", "data", "no", "data"]]
    assert facts(found) == [
        {"number": 3, "training_run": 1, "origin": 0.01, "centroid": 0.02, "displacement": 0.5},
        {"number": 4, "training_run": 2}]
