"""NSF: what networks cost and give by their width; which networks there are for it."""

from types import SimpleNamespace

import numpy as np
import pytest
from field_toys import R, networks

from mpm_ref.rom.fields.network import Networks
from mpm_ref.rom.fields.pod_fields import Sizes
from mpm_ref.rom.model_file import Model
from mpm_ref.rom.study.errors import PositionErrors
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.weights_needed import Untrained
from validation.nsf import reduced_runs
from validation.nsf.networks import FieldsNet, NetworkPlan, fields_of, narrow, net_of, nets
from validation.nsf.studies import jelly
from validation.trade import nsf_sizes as nsf_widths

STUDY = jelly(4)._replace(train=(0.3, 0.5), sizes=Sizes(r=R), samples=20)
NARROW, WIDE = (FieldsNet(STUDY, *(NetworkPlan(width, 2, 0.1) for _ in range(3)), octaves=octaves)
                for width, octaves in ((4, 3), (6, 0)))
NETS = {"small": NARROW, "jelly-waves": WIDE}
FULL, REDUCED = 10.0, 4.0       # CPU seconds


class Ready(reduced_runs.FittedStudy):
    """`FittedStudy` with given errors: of few samples, of each draw others; of all particles."""

    def errors(self, value, count, draw, dt_factor, weighted):
        """Errors that tell their draw."""
        assert (dt_factor, weighted) == (1.0, False)
        error = 0.01 * (draw + 1) if count == STUDY.samples else 0.005
        return reduced_runs.RunErrors(PositionErrors(error, 0.02, 0.03), 0.2, float(count), count,
                                      np.nan)


@pytest.fixture
def recorded(tmp_path, monkeypatch):
    """{id without its start: `Record`} and the table of the experiment on two nets, of which
    `lacking` has no weights.
    """
    def trained(name):
        if name in recorded.lacking:
            raise Untrained(f"no weights {name}.npz")
        return Model(Networks(*networks(3)), np.zeros((2, 31, R)), np.zeros(R), {})

    def ready(model, study):
        fields = fields_of(model, study)
        test = type("History", (), {"X": fields.X, "x": np.zeros((1, 31, 1, 3))})
        return Ready(study, fields, model.xhat, None, {0.45: test})

    def recorded(*lacking):
        recorded.lacking = lacking
        setting = RunSetting("standard", tmp_path)
        assert run_all([nsf_widths.widths_experiment.experiment], setting) == []
        found = ProfileResults(tmp_path)
        start = "trade.nsf.widths."
        return ({r.target.removeprefix(start): r for r in found.records(start[:-1])},
                found.table(start[:-1], "widths"))

    monkeypatch.setattr(nsf_widths, "narrow", lambda: {"small": NARROW})
    monkeypatch.setattr(nsf_widths, "net_of", NETS.__getitem__)
    monkeypatch.setattr(nsf_widths, "trained", trained)
    monkeypatch.setattr(nsf_widths, "fit_to_networks", ready)
    monkeypatch.setattr(nsf_widths, "full_cpu", lambda one: FULL)
    monkeypatch.setattr(nsf_widths, "reduced_cpu", lambda one, count, weighed, repeats: REDUCED)
    return recorded


def test_errors_stand_beside_time_and_memory(recorded):
    found, table = recorded()
    weights = {4: (6 * 4 + 4 * 16 + 4 * 3) + sum((24 * 4 + 4 * 16 + 4 * out) for out in (6, 9)),
               6: sum(6 * 6 + 4 * 36 + 6 * out for out in (3, 6, 9))}
    for width in (4, 6):
        assert found[f"{width}"].value == pytest.approx(2.0)            # mean of 1, 2, 3 %
        assert found[f"{width}.all"].value == pytest.approx(0.5)
        note = found[f"{width}"].note
        assert f"4 CPU s beside 10 of the full-order run, {8e-3 * weights[width]:.3g} kB" in note
        assert "of the stress 20 %" in note
    assert table["width"].tolist() == 4 * [4] + 4 * [6]
    assert table["bytes"].tolist() == 4 * [8 * weights[4]] + 4 * [8 * weights[6]]
    assert table["origin"].tolist() == 2 * [0.01, 0.02, 0.03, 0.005]
    assert set(table["cpu"]) == {REDUCED}
    assert "untrained" not in found
    assert found["falls"].value == pytest.approx(1.0)       # of the samples drawn alone


def test_wider_networks_are_compared_with_the_next_narrower_ones_on_the_samples_drawn():
    found = {}
    run = SimpleNamespace(record=lambda target, value, **rule: found.update({target: value}))
    columns = nsf_widths.WIDTH_COLUMNS
    rows = [tuple({"width": w, "samples": n, "origin": e}.get(c, 0.0) for c in columns)
            for w, n, e in ((16, 50, 4.0), (16, 50, 2.0), (16, 900, 9.0), (32, 50, 1.0),
                            (32, 900, 9.0), (64, 50, 0.8), (64, 900, 0.1))]
    nsf_widths.record_gain(run, rows)
    assert found == {"trade.nsf.widths.falls": pytest.approx(0.8)}


def test_widths_without_weights_are_told(recorded):
    found, table = recorded("small")
    assert found["untrained"].value == 1
    assert set(table["width"]) == {6}
    assert "falls" not in found


def test_narrow_nets_differ_in_their_widths_alone():
    usual = nets()["jelly-waves"]
    assert [net.g.width for net in narrow().values()] == [16, 32]
    for name, net in narrow().items():
        assert net_of(name) == net
        assert net._replace(**{own: getattr(usual, own) for own in "ghl"}) == usual
        for own in "ghl":
            part = getattr(net, own)
            assert part == getattr(usual, own)._replace(width=net.g.width)
    assert net_of("metal") == nets()["metal"]
    with pytest.raises(KeyError):
        net_of("jelly-waves-7")
