"""Input by accident or on purpose wrong ends in one short sentence, soon."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import SCENE, assert_told, mpm_ref
from fuzz import cases

from mpm_ref.cli import errors
from mpm_ref.store.weights_file import pack

ROOT = Path(__file__).resolve().parents[2]
STUDY = "studies/gravity_small.toml", "studies/law_jelly_small.toml"
SCENES = "hello", "incline", "dam_break", "cantilever", "nclaw_jelly", "hot_boxes", "ldm_gravity"


@pytest.mark.parametrize("command", [("info",), ("run",), ("rom", "generate"), ("law", "train")])
@pytest.mark.parametrize(("text", "words"), [
    ("a = " + "[" * 100_000 + "]" * 100_000, ("not valid TOML: too deeply nested",)),
    ("a = " + "[" * 200 + "]" * 200, ("more than 50 tables and lists within each other",)),
    ('{"a": ' + "[" * 100_000 + "]" * 100_000 + "}", ("not valid TOML",)),
    ("a = " + "{b = " * 80 + "1" + "}" * 80, ("more than 50 tables",)),
], ids=["deep", "nested", "json", "tables"])
def test_nested_tables_are_told(tmp_path, command, text, words):
    (tmp_path / "a.toml").write_text(text)
    done = mpm_ref(*command, tmp_path / "a.toml")
    assert_told(done, 2, *words)
    assert len(done.stderr) < 500


def test_a_text_without_end_is_told(tmp_path):
    with open(tmp_path / "a.toml", "wb") as file:
        file.truncate(20_000_000)
    assert_told(mpm_ref("run", tmp_path / "a.toml"), 2, "has 20 MB, expected a text of at most 10")


@pytest.mark.parametrize(("arguments", "near"), [
    (("run", "helo"), "did you mean hello?"), (("info", "dam_brake"), "did you mean dam_break?"),
    (("rom", "generate", "gravty_small"), "did you mean gravity_small?"),
    (("law", "train", "law_jely"), "did you mean law_jelly? `mpm-ref law studies` lists all"),
    (("law", "train", "hello"), "bundled studies of laws: law_"),
    (("rom", "generate", "law_jely"), "did you mean jelly? `mpm-ref rom studies` lists all"),
    (("run", "quite_other"), "bundled scenes: cantilever,"),
])
def test_the_nearest_name_is_offered(arguments, near):
    assert_told(mpm_ref(*arguments), 2, near)


def test_an_angle_is_no_coefficient_of_friction(scene):
    scene.write_text(SCENE + '[[collider]]\nshape = { type = "half_space", point = [0.0, 0.1], '
                     'normal = [0.0, 1.0] }\nkind = "separate"\nfriction = 45\n')
    assert_told(mpm_ref("info", scene), 2, "collider[0].friction = 45: expected", "<= 10")


def test_an_npz_file_without_content_is_told(tmp_path):
    (tmp_path / "a.npz").write_bytes(b"")
    assert_told(mpm_ref("info", tmp_path / "a.npz"), 2, "a.npz: the file is empty; expected a sc")
    (tmp_path / "a.npz").write_bytes(b"text")
    assert_told(mpm_ref("info", tmp_path / "a.npz"), 2, "a.npz: the file is no scene")
    (tmp_path / "a.npz").write_bytes(pack({}))
    assert_told(mpm_ref("info", tmp_path / "a.npz"), 2, "holds no map, no laws")


@pytest.mark.parametrize("edit", [
    ("dim = 2", 'dim = "%s"'), ("title = ", 'integrator = "%s"\ntitle = '),
    ('"disk"', '"disk"\n%s = 1'), ('"fixed_corotated"', '"%s"'), ("dx = 0.05", "dx = [%s]"),
])
def test_a_long_value_is_shortened(scene, edit):
    scene.write_text(SCENE.replace(edit[0], edit[1] % ("1" * 100_000)))
    done = mpm_ref("info", scene)
    assert_told(done, 2)
    assert len(done.stderr) < 600


def test_a_long_name_is_shortened(tmp_path):
    for command in (("info",), ("run",), ("oracle", "check", tmp_path), ("rom", "train")):
        done = mpm_ref(*command, "x" * 100_000)
        assert done.exit_code == 2
        assert len(done.stderr) < 3000
    words = " ".join(["word"] * 50_000)
    assert len(errors.shortened(words)) < errors.LONGEST + 10
    assert errors.shortened("scene.toml: dx = 0: expected") == "scene.toml: dx = 0: expected"


@pytest.fixture(scope="module")
def files(tmp_path_factory, golden):
    """A folder with scenes, studies and files of every kind."""
    folder = tmp_path_factory.mktemp("fuzz") / "in"
    folder.mkdir()
    for path in (*(f"scenes/{name}.toml" for name in SCENES), *STUDY,
                 "validation/ldm/weights/gravity-r1.npz", "validation/nclaw/weights/dough.npz"):
        (folder / Path(path).name).write_bytes((ROOT / path).read_bytes())
    (folder / "golden.h5").write_bytes(golden.read_bytes())
    (folder / "disk.toml").write_text(SCENE)
    assert mpm_ref("run", folder / "disk.toml", "-o", folder / "run.h5", "--steps", 20,
                   "--quiet").exit_code == 0
    np.savez(folder / "state.npz", x=np.ones((4, 2)), m=np.ones(4), V0=np.ones(4))
    (folder / "arrays.toml").write_text(SCENE.replace(
        'shape = { type = "sphere", center = [0.5, 0.3], radius = 0.1 }',
        'particles = { file = "state.npz" }').replace("density = 1000.0\n", "").replace(
        'sampling = { type = "regular", per_cell = 2 }\n', ""))
    assert mpm_ref("info", folder / "arrays.toml").exit_code == 0
    return folder


def faults(files, seed, count):
    done = subprocess.run([sys.executable, ROOT / "tests/support/fuzz.py", files, str(seed),
                           str(count)], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, f"{done.returncode}: {done.stderr[-2000:]}"
    return json.loads(done.stdout)


def test_mutated_files_end_in_sentences(files):
    assert not faults(files, 0, 80)


@pytest.mark.slow
def test_two_thousand_mutated_files_end_in_sentences(files):
    assert not faults(files, 1, 2000)


def test_the_same_seed_gives_the_same_cases(files):
    first, again, other = (list(cases(files, seed, 30)) for seed in (3, 3, 4))
    assert first == again != other
    assert len({name for name, _ in first}) > 5


def test_an_answer_that_cannot_be_printed_is_told(scene):
    with open("/dev/full", "w", encoding="utf-8") as full:
        done = subprocess.run([sys.executable, "-m", "mpm_ref", "info", scene], stdout=full,
                              stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 4
    assert done.stderr.endswith("mpm-ref: the answer could not be printed: No space left on "
                                "device; is the disk full?\n")
