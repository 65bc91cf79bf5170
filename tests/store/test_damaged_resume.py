"""No flipped bit of results or of a checkpoint ends `run --resume` by a signal or a traceback."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import mpm_ref

ROOT = Path(__file__).resolve().parents[2]


def endings(folder, seed, count):
    """[case, [exit status, stderr]] of each case, all of them in one process of their own."""
    (folder / "scene.toml").write_bytes((ROOT / "scenes/hello.toml").read_bytes())
    begun = mpm_ref("run", folder / "scene.toml", "--out", folder / "run.h5", "--quiet", "--steps",
                    12)
    assert begun.exit_code == 0, begun.output
    done = subprocess.run([sys.executable, ROOT / "tests/support/damaged_runs.py", folder,
                           str(seed), str(count)], capture_output=True, text=True, check=False)
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0, f"{done.returncode} at {lines[-1:]}: {done.stderr[-1000:]}"
    return list(zip(lines[::2], lines[1::2], strict=True))


def assert_all_told(found, count):
    assert len(found) == count + 8
    assert {case[0] for case, _ in found} == {"run.h5", "run.checkpoint.h5"}
    for case, (status, stderr) in found:
        assert status == 2, (case, status, stderr)
        assert case[0] in stderr
        assert stderr.count("\n") == 1


def test_flipped_bits_are_told(tmp_path):
    assert_all_told(endings(tmp_path, 0, 4), 4)


@pytest.mark.slow
def test_four_hundred_flipped_bits_are_told(tmp_path):
    assert_all_told(endings(tmp_path, 1, 400), 400)
