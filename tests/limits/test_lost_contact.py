"""A body whose lengths grow no longer reaches its floor in the same time: another scene."""

import msgspec
import numpy as np
import pytest

from mpm_ref.executor import open_executor
from mpm_ref.limits.cell import cell_of
from mpm_ref.limits.verdict import LOST, RIGHT, CellJudge
from mpm_ref.scene import build, digest, loads
from mpm_ref.sweep.observation import ObservedRun
from mpm_ref.sweep.probes import choose_probes
from mpm_ref.sweep.runs import SceneRuns
from mpm_ref.sweep.store import RunStore

DROP = """
dim = {dim}
dx = 0.1
end = 0.3
gravity = {gravity}
{more}
[[body]]
name = "ball"
density = 1000.0
shape = {{ type = "sphere", center = {center}, radius = 0.2 }}
material = {{ law = "fixed_corotated", E = 1e4, nu = 0.3 }}
velocity = {{ linear = {velocity} }}
[[collider]]
name = "floor"
shape = {{ type = "half_space", point = {zero}, normal = {up} }}
kind = "separate"
"""
IMPLICIT = 'integrator = "pn-pcg"\nlongest = 0.02\nscheme = { transfer = "apic" }'


def drop(dim, more):
    """Return the scene of a ball that meets the floor 0.5 m below, and its `ObservedRun`."""
    rest = [0.0] * (dim - 1)
    scene = loads(DROP.format(
        dim=dim, gravity=[*rest, -9.8], center=[*rest, 0.7], zero=[*rest, 0.0],
        velocity=[*rest, -2.0], up=[*rest, 1.0], more=more))
    probes = tuple((p.body, p.X) for p in choose_probes(build(scene).bodies))
    observed = ObservedRun(msgspec.json.encode(scene).decode(), digest(scene), ("positions",),
                           (0.0, 0.1, 0.2, 0.3), probes)
    return scene, observed


@pytest.mark.parametrize(("dim", "more"), [(2, ""), (3, ""), (2, IMPLICIT)])
def test_a_ball_that_grows_tenfold_does_not_reach_its_floor(dim, more):
    scene, observed = drop(dim, more)
    with open_executor(workers=1) as executor:
        runs = SceneRuns(observed, executor, RunStore(), np.inf)
        judge = CellJudge(scene, runs, observed.probes, ("positions",), 0.05)
        judge.start()
        grown, shifted = cell_of({"size": 10.0}), cell_of({"origin": 100.0})
        verdicts = judge.judge([grown, shifted])
    assert judge.base[1.0].contacts == ("body 'ball' with collider[0] 'floor'",)
    assert verdicts[grown].outcome == LOST
    assert "no contact of body 'ball' with collider[0] 'floor'" in verdicts[grown].message
    assert verdicts[shifted].outcome == RIGHT
