"""A run that notices an error of its own says so on the terminal, in JSON and in its file."""

import json

import pytest
from command_line import mpm_ref

from mpm_ref.indicators import IndicatorWatch
from mpm_ref.store.results import Results

SPUN = """
dim = 2
dx = 0.1
end = 0.2
gravity = [0.0, 0.0]
[[body]]
name = "bar"
density = 1000.0
shape = { type = "box", lower = [0.0, 0.0], upper = [0.4, 0.2] }
sampling = { type = "regular", per_cell = 2 }
material = { law = "fixed_corotated", E = 1e3, nu = 0.3 }
velocity = { angular = 40.0 }
"""


@pytest.fixture(scope="module")
def torn(tmp_path_factory):
    """The output of a run that tears its body, and its results file."""
    folder = tmp_path_factory.mktemp("torn")
    (folder / "spun.toml").write_text(SPUN)
    out = folder / "spun.h5"
    return mpm_ref("run", folder / "spun.toml", "--out", out, "--quiet", "--json"), out


def test_warning_is_printed_and_in_the_json(torn):
    done, _ = torn
    assert done.exit_code == 0
    warnings = json.loads(done.stdout)["warnings"]
    assert any(text.startswith("gap: neighbours of body 'bar'") for text in warnings)
    assert all(text in done.stderr for text in warnings)


def test_warning_is_in_the_file_and_info_repeats_it(torn):
    done, out = torn
    with Results(out) as results:
        stored = results.manifest["parts"][0]["error_warnings"]
    assert stored == json.loads(done.stdout)["warnings"]
    told = mpm_ref("info", out)
    assert all(text in told.stderr for text in stored)


def test_a_sound_run_warns_of_nothing(tmp_path):
    (tmp_path / "slow.toml").write_text(SPUN.replace("40.0", "1.0"))
    done = mpm_ref("run", tmp_path / "slow.toml", "--out", tmp_path / "slow.h5", "--json",
                   "--quiet")
    assert json.loads(done.stdout)["warnings"] == []


def test_warnings_leave_the_bits_of_a_run(torn, tmp_path, monkeypatch):
    monkeypatch.setattr(IndicatorWatch, "news", lambda *_: [])
    (tmp_path / "spun.toml").write_text(SPUN)
    done = mpm_ref("run", tmp_path / "spun.toml", "--out", tmp_path / "spun.h5", "--json",
                   "--quiet")
    digests = [json.loads(one.stdout)["state_sha256"] for one in (done, torn[0])]
    assert digests[0] == digests[1]


def test_a_resumed_run_measures_from_its_start(tmp_path):
    """The neighbours are those of the scene, not those of the checkpoint."""
    (tmp_path / "spun.toml").write_text(SPUN)
    command = ("run", tmp_path / "spun.toml", "--out", tmp_path / "spun.h5", "--json", "--quiet")
    assert not json.loads(mpm_ref(*command, "--steps", "10").stdout)["warnings"]
    warnings = json.loads(mpm_ref(*command, "--resume").stdout)["warnings"]
    assert any(text.startswith("gap: neighbours of body 'bar'") for text in warnings)
