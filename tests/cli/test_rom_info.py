"""`mpm-ref info` of maps and studies, and what `mpm-ref rom` lists and says in its help."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
import rom_toys
from command_line import assert_told, mpm_ref
from small_studies import CURVED, STEPS, modelled, write
from typer.main import get_command

from mpm_ref.cli import rom
from mpm_ref.cli.catalogue import bundled_studies
from mpm_ref.rom import model_file
from mpm_ref.rom.model_file import Model
from mpm_ref.rom.snapshots import displacement_error, position_error
from mpm_ref.rom.study import dataset, errors
from mpm_ref.rom.study.study import load
from mpm_ref.store.weights_file import pack

LDM = Path(__file__).parents[2] / "validation" / "ldm" / "weights"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with a study, its runs and its map."""
    return modelled(tmp_path_factory.mktemp("made"))


# info of a map

@pytest.mark.parametrize(("edits", "head"), [((), "modes, r = 3"), (CURVED, "curved, r = 2")])
def test_a_map_says_what_it_is_of_and_what_made_it(made, tmp_path, edits, head):
    study, file = write(tmp_path, *edits), tmp_path / "map.npz"
    assert mpm_ref("rom", "train", study, "--data", made / "data", "--out", file).exit_code == 0
    what, of, off, by = mpm_ref("info", file).stdout.splitlines()
    assert what == f"{file}: a map, {head}, 2D, 64 points, study bars, scene bar.toml"
    bars = load(study)
    mu = bars.mu[list(bars.train)]
    assert of == f"made of 3 runs of {STEPS} steps, g = {mu.min():g} .. {mu.max():g}"
    assert off.endswith(" % of the displacement")
    assert by.startswith(f"made by: mpm-ref rom train {study} --data ")


def test_the_errors_of_a_map_are_those_over_its_training_runs(made):
    found = json.loads(mpm_ref("info", made / "map.npz", "--json").stdout)
    bars, model = load(made / "bars.toml"), model_file.load(made / "map.npz")
    data = dataset.load(bars, made / "data", bars.train)
    x = np.array([model.field.place(data.X, y) for y in model.xhat.reshape(-1, 3)])
    reference = data.flat()[0]
    assert found["errors"] == pytest.approx({
        "origin": position_error(x, reference),
        "centroid": position_error(x, reference, data.X.mean(axis=0)),
        "displacement": displacement_error(x, reference, data.X)})
    assert found["points"] == 64


def test_errors_of_a_map_are_looked_at_some_points(monkeypatch):
    """Of 40 points at every fifth, which are 8."""
    data, map = rom_toys.snapshots(2), rom_toys.decoder(2, 3, seed=1)
    xhat = np.random.default_rng(0).uniform(size=(3, 5, 3))
    few = data._replace(X=data.X[::5], x=data.x[:, :, ::5])
    assert errors.misfit(map, data.X, data, xhat) != errors.misfit(map, few.X, few, xhat)
    monkeypatch.setattr(errors, "MEASURED", 8)
    assert errors.misfit(map, data.X, data, xhat) == errors.misfit(map, few.X, few, xhat)


def test_a_network_says_its_last_loss(tmp_path):
    about = {"loss": [[9.0, 3.0, 2.0, 1.0], [0.6, 0.3, 0.2, 0.1]], "study": 64 * "a"}
    model_file.save(tmp_path / "map.npz",
                 Model(rom_toys.decoder(3, 2), np.ones((4, 3, 2)), np.zeros(2), about))
    assert mpm_ref("info", tmp_path / "map.npz").stdout.splitlines() == [
        f"{tmp_path / 'map.npz'}: a map, network, r = 2, 3D, study aaaaaaaaaaaa",
        "made of 4 runs of 2 steps", "last loss kept: 0.6 (position 0.3, F 0.2, velocity 0.1)",
        "made by: unknown"]


@pytest.mark.parametrize("name", ["gravity-r4", "push", "tower"])
def test_the_maps_of_the_papers_experiments_say_what_they_know(name):
    what, of, loss, by = mpm_ref("info", LDM / f"{name}.npz").stdout.splitlines()
    r = model_file.load(LDM / f"{name}.npz").field.r
    assert f"a map, network, r = {r}, 3D, study " in what
    assert of.startswith("made of ")
    assert loss.startswith("last loss kept: ")
    assert by.startswith("made by: python -m validation")


def test_what_is_no_map_is_told(made, tmp_path):
    damaged = bytearray((made / "map.npz").read_bytes())
    damaged[100] ^= 1
    (tmp_path / "map.npz").write_bytes(damaged)
    assert_told(mpm_ref("info", tmp_path / "map.npz"), 2, "map.npz is damaged")
    (tmp_path / "map.npz").write_bytes(pack({"format": np.array(model_file.FORMAT)}))
    assert_told(mpm_ref("info", tmp_path / "map.npz"), 2,
                "map.npz holds no reduced model: its kind is None")


# info of a study

def test_a_study_says_what_it_is_made_of(made):
    file = made / "bars.toml"
    assert mpm_ref("info", file).stdout.splitlines() == [
        f"{file}: a study, Bars: 4 runs of the scene bar.toml, 1 held out",
        f"2D, 64 points, dx = 0.1 m, {STEPS} steps of 0.01 s",
        "parameters: g = 1 .. 4 (gravity[1])",
        "map: modes, r = 3; reduced runs: lagrangian quadrature, linear projection, all points"]
    found = json.loads(mpm_ref("info", file, "--json").stdout)
    assert found["held_out"] == list(load(file).test)
    assert found["map"] == {"kind": "modes", "r": 3}
    assert found["study_sha256"] == load(file).digest


def test_a_bundled_study_is_known_by_its_name():
    what, size, *_ = mpm_ref("info", "gravity_small").stdout.splitlines()
    assert "gravity_small.toml: a study, Cylinder under gravity, small: 8 runs" in what
    assert size.startswith("3D, 400 points, ")


@pytest.mark.parametrize(("before", "after", "words"), [
    ('kind = "modes"', 'kind = "mode"', "kind = 'mode': expected one of"),
    ('scene = "bar.toml"', "", "scene"),
    ('key = "gravity[1]"', 'key = "weight"', "leads nowhere in the scene"),
])
def test_a_study_with_a_fault_is_told_as_one(tmp_path, before, after, words):
    assert_told(mpm_ref("info", write(tmp_path, (before, after))), 2, "bars.toml", words)


# lists and help

def test_the_bundled_studies_are_listed_with_their_titles():
    tables = {name: tomllib.loads(file.read_text()) for name, file in bundled_studies().items()}
    titles = {name: found["title"] for name, found in tables.items() if "map" in found}
    assert len(titles) >= 3
    assert json.loads(mpm_ref("rom", "studies", "--json").stdout) == titles
    assert mpm_ref("rom", "studies").stdout.splitlines() == [
        f"{name:24} {title}" for name, title in titles.items()]
    assert "`mpm-ref rom studies` lists" in get_command(rom.app).epilog


def test_each_command_has_a_sentence_and_an_example():
    commands = get_command(rom.app).commands
    assert list(commands) == ["studies", "generate", "train", "play", "run", "evaluate"]
    for name, command in commands.items():
        sentence = command.help.split("\n\n")[0]
        assert sentence.endswith(".")
        assert sentence.count(". ") == 0
        assert "\n" not in sentence
        assert f"\n\nmpm-ref rom {name}" in command.epilog
