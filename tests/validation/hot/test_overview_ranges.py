"""Ranges over entire runs: what is read from the recorded table, and which scenes count."""

from validation.hot import overview_ranges as module


class Results:
    """Recorded totals of two methods on three scenes."""

    def table(self, experiment, name):
        assert (experiment, name) == ("hot.fig15-runs", "speedups")
        return {"scene": ["twist", "sauce", "wheel"] * 4,
                "method": [method for method in module.ABLATION for _ in range(3)],
                "total": [2.0, 0.5, 3.0] * 4, "particles": [30, 10, 20] * 4}


class Run:
    def __init__(self):
        self.found = {}

    def record(self, target, value, scale, note):
        self.found[target] = value, scale, note


def test_totals_are_those_of_each_method_and_scene():
    totals, particles = module.recorded_totals(Results())
    assert set(totals) == set(module.ABLATION)
    assert totals["pn-pcg"] == {"twist": 2.0, "sauce": 0.5, "wheel": 3.0}
    assert particles == {"twist": 30, "sauce": 10, "wheel": 20}


def test_the_smallest_leaves_out_sauce(monkeypatch):
    monkeypatch.setattr(module, "ProfileResults", lambda folder: Results())
    run = Run()
    module.ranges(run)
    value, scale, note = run.found["hot.sec7_2.speedup.pn_pcg_mf.min.small"]
    assert value == 2.0
    assert scale == "3 scenes of 10 to 30 particles, recorded by `hot.fig15-runs`"
    assert note.startswith("twist 2.00, sauce 0.50, wheel 3.00; without Sauce")
    assert run.found["hot.sec7_2.speedup.lbfgs_h.max.small"][0] == 3.0
    assert len(run.found) == 8
