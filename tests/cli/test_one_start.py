"""`mpm-ref run` validates and builds a scene once, and computes its first state once."""

import sys
from collections import Counter

import pytest
from command_line import SCENE, mpm_ref

from mpm_ref import explicit, simulate
from mpm_ref.cli import info
from mpm_ref.scene import builder, validate

SHORT = SCENE.replace("steps = 40", "steps = 5")
SCENES = {
    "explicit": SHORT,
    "adaptive": SHORT.replace("dt = 0.001", "cfl = 0.4"),
    "implicit": SHORT.replace("dim = 2", 'dim = 2\nintegrator = "hot"'),
}


@pytest.fixture
def calls(monkeypatch):
    """Counter of calls, by name, of what a run needs once."""
    count = Counter()

    def counted(module, name):
        real = getattr(module, name)

        def call(*arguments, **options):
            count[name] += 1
            return real(*arguments, **options)

        for other in list(sys.modules.values()):        # wherever it was imported by name
            if getattr(other, "__name__", "").startswith("mpm_ref") and (
                    getattr(other, name, None) is real):
                monkeypatch.setattr(other, name, call)

    for module, names in {
        validate: ["check_scene"],
        builder: ["build_clock", "build_conditions", "build_limits", "build_solver",
                  "build_material", "build_body"],
        explicit: ["initial_stress", "check_fit"],
        simulate: ["start", "account", "stable_dt", "update_bound"],
        info: ["misplaced"],
    }.items():
        for name in names:
            counted(module, name)
    return count


@pytest.mark.parametrize("kind", SCENES)
def test_a_run_starts_once(kind, calls, tmp_path):
    scene = tmp_path / "disk.toml"
    scene.write_text(SCENES[kind])
    done = mpm_ref("run", scene, "--out", tmp_path / "run.h5", "--quiet")
    assert done.exit_code == 0
    assert calls == dict.fromkeys(calls, 1)
    assert len(calls) == 14


def test_a_file_of_other_bodies_is_checked_and_built_once_each(calls, tmp_path):
    scene = tmp_path / "disks.toml"
    body = SHORT[SHORT.index("[[body]]"):]
    scene.write_text(SHORT + body.replace("disk", "other").replace("0.5, 0.3", "0.5, 0.9"))
    assert mpm_ref("run", scene, "--out", tmp_path / "run.h5", "--quiet").exit_code == 0
    assert {name for name, count in calls.items() if count == 2} == {
        "build_material", "build_body", "initial_stress", "check_fit"}
    assert max(calls.values()) == 2
