"""Figure 15 over entire runs: steps lie over the run, all methods solve each, sizes are theirs."""

import numpy as np

from validation.common.scenes import catalogue_scene, with_
from validation.hot import overview, overview_runs


def poured(steps):
    """The first steps of a pour of few particles."""
    scene = catalogue_scene("hot_sauce", unstable="allow", dx=0.09, integrator="hot")
    body = scene.body[0]
    return with_(scene, end=steps * scene.longest,
                 body=(with_(body, sampling=with_(body.sampling, count=60)),))


def test_every_method_solves_steps_over_the_run(monkeypatch):
    monkeypatch.setattr(overview, "METHODS", ("hot", "pn-pcg"))
    monkeypatch.setattr(overview_runs, "scene", lambda name, size: poured(12))
    rows, (hot, pcg) = overview_runs.run_costs("sauce", 3)
    assert [(row.method, row.step) for row in rows] == [
        (method, k) for k in range(3) for method in ("hot", "pn-pcg")]
    assert np.all(np.diff([row.t for row in rows[::2]]) > 0.1)
    assert (hot.total, hot.steps, hot.particles) == (1.0, 3, 120)       # of the last of them
    assert pcg.total > 0.0
