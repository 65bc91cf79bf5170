"""Real runs: parts that matter cannot go, parts that do not matter can, and nothing runs twice."""

from math import inf

import numpy as np
import pytest
from needs_toys import SCENE, few_offers, runs_of

from mpm_ref.needs import removal
from mpm_ref.needs.removal import COARSE, NOT_REQUIRED, REQUIRED, RemovalStudy
from mpm_ref.needs.variant import changes

IDLE = {"return map of block", "collider collider1", "friction of collider collider1",
        "body distant"}
VITAL = {"gravity", "collider floor", "initial velocity of block"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def study(folder):
    first = few_offers(SCENE, IDLE | VITAL)
    study = RemovalStudy(runs_of(first, folder), first, 0.01)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(removal, "NOISE", inf)        # what a run costs is no matter here
        return study, study.result()


def test_what_matters_is_required(study):
    verdicts = {run.label: run.verdict for run in study[1].singles}
    assert verdicts == dict.fromkeys(IDLE, NOT_REQUIRED) | dict.fromkeys(VITAL, REQUIRED)


def test_what_does_not_matter_changes_nothing(study):
    for run in study[1].singles:
        if run.label in IDLE:
            assert run.change < 1e-9, run.label


def test_lean_scene_keeps_the_error(study):
    study, result = study
    lean = study.observe({"lean": result.lean})["lean"]
    error = changes(result.base, lean, result.lean, result.first)["positions"]
    assert error[-1] == result.order[-1].change <= 0.01
    assert {one.label for one in result.lean.removals} == IDLE - {"friction of collider collider1"}
    assert [part.name for part in result.lean.scene.collider] == ["floor"]


def test_errors_of_the_scene_itself(study):
    errors = study[1].errors
    assert 0.0 < errors.perturbation["positions"] < 1e-6
    assert 1e-6 < errors.grid["positions"] < 1.0
    assert errors.grid_factor in (0.5, COARSE)


def test_second_time_no_run_is_made(study, folder):
    first = few_offers(SCENE, IDLE | VITAL)
    runs = runs_of(first, folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(removal, "NOISE", inf)
        again = RemovalStudy(runs, first, 0.01).result()
    assert runs.count == 0
    assert again.order == study[1].order
    assert np.array_equal(again.base.values["positions"], study[1].base.values["positions"])


def test_quantity_of_a_removed_part_cannot_be_measured():
    first = few_offers(SCENE, {"collider floor"})
    study = RemovalStudy(runs_of(first, None, ("impulse:floor",)), first, 0.01)
    single, = study.result().singles
    assert single.verdict == "impossible"
    assert "impulse:floor" in single.message
