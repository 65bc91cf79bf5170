"""Samples, their nodes and integration points, as Figure 4 shows them."""

from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest

from figures.nsf import fig04
from mpm_ref.rom.quadrature.stencil_overlap import stencil_overlap
from mpm_ref.rom.study.full_model import nsf_full_model
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.ldm.published_bodies import keep, read
from validation.nsf import integration_points

mpl.use("Agg")


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("degree", [1, 2, 3])
def test_integration_points_are_those_that_see_a_node_of_a_sample(d, degree, rng):
    dx, x = 0.1, rng.uniform(size=(300, d))
    nodes = set(map(tuple, integration_points.nodes_of(x[:3], dx, degree)))
    sees = [not nodes.isdisjoint(map(tuple, integration_points.nodes_of(one[None], dx, degree)))
            for one in x]
    assert 3 < sum(sees) < 300
    assert np.array_equal(stencil_overlap(x[:3], dx, degree).overlaps(x), sees)


def test_a_sample_sees_three_nodes_an_axis_of_quadratic_splines():
    found = integration_points.nodes_of(np.array([[0.26, 0.34]]), 0.1, 2)
    assert found.tolist() == [[i, j] for i in (2, 3, 4) for j in (2, 3, 4)]


def test_the_figure_shows_what_is_kept(tmp_path, rng):
    x = rng.uniform(size=(40, 3))
    parts = {"x": x, "integration": x[:20], "sample": x[:4]}
    kept = {f"{name}_{word}": a[:, :d] for name, d in (("block", 2), ("cake", 3))
            for word, a in parts.items()}
    run = SimpleNamespace(folder=tmp_path, experiment=SimpleNamespace(id="nsf.fig4"))
    keep(run, **kept, block_nodes=np.array([[0.125, 0.25], [0.375, 0.5]]))
    block, cake = fig04.draw(SimpleNamespace(folder=tmp_path)).axes[:2]
    assert [len(c.get_offsets()) for c in block.collections] == [40, 20, 4, 2]
    assert block.collections[3].get_offsets().tolist() == [[0.125, 0.25], [0.375, 0.5]]
    assert [len(c.get_offsets()) for c in cake.collections] == [40, 20, 4]
    assert np.allclose(cake.collections[0].get_offsets(), x[:, [0, 2]], atol=1e-4)


def test_all_samples_and_integration_points_are_kept_though_others_are_thinned(
        tmp_path, monkeypatch):
    monkeypatch.setattr(integration_points, "MOST", 100)
    monkeypatch.setattr(integration_points, "middle_state", half)
    failed = run_all([integration_points.sets.experiment], RunSetting("quick", tmp_path))
    assert failed == []
    found = {r.target: r.value for r in ProfileResults(tmp_path).records("nsf.fig4")}
    kept = read(tmp_path, "nsf.fig4")
    for name in ("block", "cake"):
        assert len(kept[f"{name}_sample"]) == found[f"nsf.fig4.{name}.samples"]
        assert len(kept[f"{name}_integration"]) == found[f"nsf.fig4.{name}.points"]
        assert len(kept[f"{name}_x"]) <= 100
    assert len(kept["block_nodes"]) == found["nsf.fig4.block.nodes"]
    assert "cake_nodes" not in kept


def half(study):
    """The run at its start, which needs no steps."""
    one = nsf_full_model(study.run(study.train[-1]))
    return one, one.X
