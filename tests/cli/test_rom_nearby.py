"""`mpm-ref rom evaluate`: training runs in place of the reduced model, the nearest one as it is and
the linear interpolation between several.
"""

import json
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
import small_nsf_studies
import small_studies
from command_line import mpm_ref

from mpm_ref.rom.study import baselines, dataset
from mpm_ref.rom.study.baselines import (
    NEAREST,
    TrainingBaseline,
    facts,
    interpolation_weights,
    lines,
    nearest_parameters,
)
from mpm_ref.rom.study.errors import Squares
from mpm_ref.rom.study.study import load

LDM = small_studies, "bars.toml", "map.npz", 0
NSF = small_nsf_studies, "pairs.toml", "fields.npz", 1


@pytest.fixture(scope="module", params=[LDM, NSF], ids=["ldm", "nsf"])
def made(request, tmp_path_factory):
    """Folder with a study, its runs and its map; the study's file, the map, and the first of the
    levels that count.
    """
    module, study, map, first = request.param
    return module.modelled(tmp_path_factory.mktemp(module.__name__)), study, map, first


def evaluated(made, data, *options, study=None):
    folder, name, map, _ = made
    done = mpm_ref("rom", "evaluate", study or folder / name, "--map", folder / map, "--data", data,
                   "--overwrite", *options)
    assert done.exit_code == 0, done.output
    return done.stdout


def errors(X, x, reference):
    """Of positions (k, n, d), by hand."""
    off = np.linalg.norm(x - reference)
    return {name: off / np.linalg.norm(reference - of) for name, of in
            {"origin": 0.0, "centroid": X.mean(axis=0), "displacement": X}.items()}


def expected(made, levels):
    """Number of the run held out, of the nearest training run, and its errors, by hand."""
    folder, name, *_ = made
    study = load(folder / name)
    (number,) = study.test
    both = {k: dataset.load(study, folder / "data", (number, k)) for k in study.train}
    near = np.abs(study.mu[list(study.train), 0] - study.mu[number, 0])
    found = {k: errors(both[k].X, *both[k].x[::-1, levels].astype(float))
             for k, away in zip(study.train, near, strict=True) if away < near.min() + 1e-6}
    taken = min(found, key=lambda k: found[k]["origin"])
    return number, taken, found[taken]


def test_its_errors_are_those_of_its_states_beside_the_run_held_out(made, tmp_path):
    folder, *_, first = made
    number, taken, own = expected(made, slice(first, None))
    out = tmp_path / "e.png"
    found = json.loads(evaluated(made, folder / "data", "--json", "--out", out))["nearest_run"]
    assert found["all"] == pytest.approx(own, rel=1e-6)
    assert found["runs"] == [{"number": number, "weights": {str(taken): 1.0}, **found["all"]}]
    heading = "position errors [%] of the training run with the nearest parameters"
    told = evaluated(made, folder / "data", "--out", out).splitlines()
    at, = (k for k, line in enumerate(told) if line.startswith(heading))
    shares = [f"{100.0 * share:.3g}" for share in own.values()]
    assert [row.split() for row in told[at + 1:at + 4]] == [
        ["run", "training", "runs", "origin", "centroid", "displaced"],
        [str(number), str(taken), *shares], ["all", *shares]]


@pytest.mark.parametrize("made", [NSF], indirect=True)
def test_longer_steps_are_compared_at_the_same_states(made, tmp_path):
    """Of three steps of 1.5 two end between states of NSF's small study, two steps apart."""
    folder = made[0]
    study = small_nsf_studies.write(tmp_path, ("points = 20", "points = 20\ndt_factor = 1.5"))
    number, taken, own = expected(made, [3, 6])
    found = json.loads(evaluated(made, folder / "data", "--json", "--out", tmp_path / "e.png",
                                 study=study))["nearest_run"]
    assert found["all"] == pytest.approx(own, rel=1e-6)
    assert [(one["number"], one["weights"]) for one in found["runs"]] == [
        (number, {str(taken): 1.0})]


@pytest.mark.parametrize("damaged", [False, True])
def test_without_its_data_it_is_left_out(made, tmp_path, damaged):
    folder, name, *_ = made
    study = load(folder / name)
    (number,) = study.test
    shutil.copy(folder / "data" / f"case-{number:03d}.h5", tmp_path)
    for k in study.train if damaged else ():
        (tmp_path / f"case-{k:03d}.h5").write_bytes(b"no results")
    out = tmp_path / "e.png"
    found = json.loads(evaluated(made, tmp_path, "--json", "--out", out))["nearest_run"]
    taken = nearest_parameters(study, number)[0]
    assert found == {"all": None, "runs": [{"number": number, "weights": {str(taken): 1.0}}]}
    assert [str(number), str(taken), "no", "data"] in [
        row.split() for row in evaluated(made, tmp_path, "--out", out).splitlines()]


def test_parameters_are_measured_in_their_ranges():
    """Without, the third one would decide alone. The second does not vary in the training, and is
    no reason to divide by zero.
    """
    mu = np.array([[0.0, 5.0, 0.0], [1.0, 5.0, 1000.0], [0.1, 5.0, 600.0], [0.9, 5.0, 400.0]])
    study = SimpleNamespace(mu=mu, train=(1, 0), test=(2, 3))
    assert (nearest_parameters(study, 2), nearest_parameters(study, 3)) == ([0], [1])


def test_of_runs_that_are_equally_near_the_better_one_is_taken(monkeypatch):
    """Up to round-off: 0.1 + 0.2 is no 0.3."""
    study = SimpleNamespace(mu=np.array([[0.1], [0.1 + 0.2], [0.5], [0.9]]), train=(0, 2, 3),
                            test=(1,))
    snapshots = SimpleNamespace(X=None, x=[None])
    off = {0: 3.0, 2: 2.0, 3: 1.0}
    monkeypatch.setattr(baselines, "_squares", lambda study, folder, weights, X, x: SimpleNamespace(
        errors=SimpleNamespace(origin=off[next(iter(weights))])))
    assert nearest_parameters(study, 1) == [0, 2]
    (found,) = baselines.nearest_training_runs(study, "", snapshots)
    assert found.weights == {2: 1.0}
    off[2] = 4.0
    (found,) = baselines.nearest_training_runs(study, "", snapshots)
    assert found.weights == {0: 1.0}


def test_all_runs_are_one_where_all_have_data(rng):
    X, x = rng.uniform(size=(5, 2)), rng.uniform(size=(2, 2, 5, 2))
    found = []
    for k in range(2):
        squares = Squares(X)
        squares.add(*x[k])
        found.append(TrainingBaseline(k, {7: 1.0}, squares))
    every = facts(found)
    assert every["all"] == pytest.approx(errors(X, x[:, 0], x[:, 1]))
    assert [row.split()[0] for row in lines(found, NEAREST)[2:]] == ["0", "1", "all"]
    some = [found[0], TrainingBaseline(3, {2: 1.0}, None)]
    assert facts(some) == {"all": None, "runs": [
        every["runs"][0], {"number": 3, "weights": {"2": 1.0}}]}
    assert [row.split()[:3] for row in lines(some, NEAREST)[3:]] == [["3", "2", "no"]]
    outside = [found[0], TrainingBaseline(3, {}, None)]
    assert [row.split() for row in lines(outside, NEAREST)[3:]] == [["3", "outside"]]


def test_interpolated_states_are_weighted_sums(made, tmp_path):
    folder, name, *_, first = made
    study = load(folder / name)
    (number,) = study.test
    found = json.loads(evaluated(made, folder / "data", "--json", "--out", tmp_path / "e.png"))[
        "interpolated_run"]
    weights = {int(k): w for k, w in found["runs"][0]["weights"].items()}
    mu = study.mu[:, 0]
    assert sum(weights.values()) == pytest.approx(1.0)
    assert sum(w * mu[k] for k, w in weights.items()) == pytest.approx(mu[number])
    data = dataset.load(study, folder / "data", (number, *weights))
    mean = np.tensordot(list(weights.values()), data.x[1:, first:].astype(float), 1)
    rounding = 1e-3                 # of errors of 2e-5, as NSF's histories are single precision
    assert found["all"] == pytest.approx(errors(data.X, mean, data.x[0, first:].astype(float)),
                                         rel=rounding)


def test_one_parameter_is_interpolated_between_its_neighbours():
    mu = np.array([[3.0], [0.0], [1.0]])
    assert interpolation_weights(mu, np.array([1.5])) == pytest.approx({2: 0.75, 0: 0.25})
    assert interpolation_weights(mu, np.array([1.0])) == {2: 1.0}
    assert interpolation_weights(mu, np.array([0.0])) == {1: 1.0}
    assert interpolation_weights(mu, np.array([3.1])) == {}


def test_several_parameters_are_interpolated_within_a_simplex(rng):
    """Linear functions are met exactly, on whatever scales the parameters have; one that does not
    vary is left out, but has to be the same.
    """
    mu = np.column_stack([rng.uniform(size=12), 1e6 * rng.uniform(size=12), np.full(12, 2.0)])
    target = np.array([*mu[:, :2].mean(axis=0), 2.0])
    weights = interpolation_weights(mu, target)
    assert 1 < len(weights) <= 3
    assert sum(w * mu[k] for k, w in weights.items()) == pytest.approx(target)
    assert min(weights.values()) > 0.0
    assert interpolation_weights(mu, np.array([2.0, 0.0, 2.0])) == {}
    assert interpolation_weights(mu, np.array([*target[:2], 3.0])) == {}


def test_runs_that_span_no_simplex_are_not_interpolated(rng):
    """Fewer runs than a simplex has corners, and runs whose parameters lie on a line."""
    mu = rng.uniform(size=(4, 6))
    assert interpolation_weights(mu, mu.mean(axis=0)) == {}
    line = np.linspace(0.0, 1.0, 5)[:, None] * np.array([1.0, 2.0])
    assert interpolation_weights(line, line.mean(axis=0)) == {}
