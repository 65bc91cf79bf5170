"""`mpm-ref rom train` of matter that flows: a hint where fields are hardly smoothed."""

import pytest
from command_line import mpm_ref
from small_nsf_studies import SCENE, modelled, write

from mpm_ref.rom.study.study import load, training_hints

BARE, SMOOTH = ("smoothing = 1e-6\n", ""), "smoothing = 1e-6"
ELASTIC = SCENE.replace(', flow = { type = "von_mises", tau_y = 2e3 }', "")
NETWORKS = (("modes = 5\ntau = 8\nC = 8\nsmoothing = 1e-6", "beta = [2, 2, 2]"), ('"modes"',
                                                                              '"network"'))


@pytest.mark.parametrize(("edits", "scene", "told"), [
    ((BARE,), SCENE, True), ((), SCENE, False), (((SMOOTH, "smoothing = 0.1"),), SCENE, False),
    ((BARE,), ELASTIC, False), (NETWORKS, SCENE, False),
], ids=["default", "least", "more", "elastic", "networks"])
def test_a_hint_is_given_where_matter_flows_and_modes_are_hardly_smoothed(
        tmp_path, edits, scene, told):
    found = list(training_hints(load(write(tmp_path, *edits, scene=scene))))
    assert len(found) == told
    assert all("1e-08 is for elastic matter, and that of soft flows" in one for one in found)


def test_it_is_said_before_the_fields_are_made(tmp_path):
    folder = modelled(tmp_path)
    command = ("rom", "train", write(folder, BARE), "--data", folder / "data", "--out",
               folder / "bare.npz")
    done = mpm_ref(*command)
    assert done.exit_code == 0, done.output
    assert "mpm-ref: warning: map.smoothing = 1e-08 is for elastic" in done.stderr
