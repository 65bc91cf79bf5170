"""Strange scenes, hostile paths and tiny budgets end soon, in sentences, and in their folder."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from fuzz_sweeps import cases

from mpm_ref.cli.sweep_options import SweepRequest
from mpm_ref.scene import SceneError, loads

ROOT = Path(__file__).resolve().parents[2]


def answer_of(folder, seed, count):
    """Return the faults of some cases, and the numbers of answers by command and exit status."""
    done = subprocess.run(
        [sys.executable, ROOT / "tests/support/fuzz_sweeps.py", folder / "fuzz", str(seed),
         str(count)], capture_output=True, text=True, check=False, cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)})
    assert done.returncode == 0, f"{done.returncode}: {done.stderr[-2000:]}"
    answer = json.loads(done.stdout)
    return answer["faults"], answer["statuses"]


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "count"), [(0, 40), (1, 300)])
def test_strange_scenes_end_in_sentences(tmp_path, seed, count):
    faults, statuses = answer_of(tmp_path, seed, count)
    assert not faults
    for command in ("limits", "needs"):
        assert statuses[f"{command} 0"] > 0     # some give an answer


def test_a_few_strange_scenes_end_in_sentences(tmp_path):
    assert not answer_of(tmp_path, 2, 8)[0]


def test_the_same_seed_gives_the_same_cases(tmp_path):
    first, again, other = (list(cases(tmp_path, seed, 20)) for seed in (3, 3, 4))
    assert first == again != other


def test_most_strange_scenes_are_valid(tmp_path):
    valid = 0
    for text, *_ in cases(tmp_path, 5, 100):
        try:
            loads(text)
            valid += 1
        except SceneError:
            continue
    assert valid > 60


@pytest.mark.parametrize(("name", "stem"), [
    ("scenes/disk.toml", "disk"), ("disk", "disk"), ("a.b.toml", "a.b"), ("..toml", "..toml"),
    ("x/...toml", "...toml"), (".toml", ".toml")])
def test_files_of_a_scene_of_any_name_stay_in_the_folder(tmp_path, name, stem):
    request = SweepRequest(name, 0.01, 60.0, (), 1, None, tmp_path, True)
    assert request.stem == stem
    assert Path(f"{request.out / request.stem}.limits.json").parent == tmp_path
