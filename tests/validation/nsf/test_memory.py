"""Latent coordinates of position and stress together, where shear turns back."""

import numpy as np
import pytest

from mpm_ref.rom.fields.pod_fields import Sizes
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.nsf import memory

STUDY = memory.shear()._replace(train=(0.02, 0.04), test=(0.03, 0.035), steps=600,
                                sizes=Sizes(r=4, modes=8, tau=20, C=10, smoothing=1e-2))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """{id: `Record`} and the table of the experiment, of this study alone, with one test."""
    folder = tmp_path_factory.mktemp("memory")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(memory, "studies", lambda run: {"shear": STUDY})
        assert not run_all([memory.memory.experiment], RunSetting("quick", folder))
    results = ProfileResults(folder)
    return ({r.target: r.value for r in results.records("nsf.memory")},
            results.table("nsf.memory", "errors"))


def test_stress_is_better_known_where_loading_has_turned_back(recorded):
    """Of the nearest states, and of runs: measured 8 and 3 to 4 times at the standard profile."""
    found, _ = recorded
    for word in ("nearest", "few", "all"):
        alone, joint = (found[f"nsf.memory.shear.{kind}.{word}.stress"]
                        for kind in ("position", "joint"))
        assert joint < 0.5 * alone


def test_records_are_those_of_the_table(recorded):
    found, table = recorded
    assert table["value"].tolist() == 6 * [0.03]
    assert table["latent"].tolist() == 3 * ["position"] + 3 * ["joint"]
    assert table["samples"].tolist() == 2 * [0, 40, 640]
    for k, word in enumerate(("nearest", "few", "all")):
        for name in ("displacement", "stress"):
            assert found[f"nsf.memory.shear.position.{word}.{name}"] == pytest.approx(
                100.0 * table[name][k])
    assert np.isfinite(table["stress"]).all()
