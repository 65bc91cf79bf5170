"""A tower of 12.6 million points: how much faster than the full model reduced runs are where
`ldm.fig16`, whose largest tower has 3.08 million, extrapolates 20 times (LDM-sec5.4, Figure 16).
"""

from mpm_ref.scene import build

from ..common import targets
from ..common.registry import experiment
from ..common.scenes import with_
from .networks import trained
from .references import record_errors
from .studies import TOWER, refined
from .timing import race
from .tower import FAST, FEWEST, NET, OWN, PAPER, own_row

DX, PER_AXIS = 0.3, 3       # spacing of the grid [m], points of a cell per axis
SHORTER = 2                 # steps in one of `ldm.fig16`: this grid needs shorter ones
PRINTED = "ldm.fig16.speedup"


def larger(scene, dx=DX):
    """Return a tower's scene with more points, on a finer grid and with shorter steps."""
    return with_(refined(scene, dx, PER_AXIS), dt=scene.dt / SHORTER, steps=SHORTER * scene.steps)


@experiment("ldm.fig16-larger", title="LDM: speed on a tower of 12.6 million points",
            profiles=("standard",), budget={"standard": 1200})
def larger_tower(run):
    """Error and wall time of reduced runs of one test run; those of cheap options are judged by the
    printed speed-up.
    """
    scene, model = larger(TOWER.scene(*TOWER.mu[TOWER.test[0]])), trained(NET)
    options = [PAPER._replace(points=25), FAST._replace(points=25), FAST._replace(points=FEWEST)]
    full, fastest, runs = race(scene, (model.field, model.rest), options, scene.steps)
    count = len(build(scene).bodies[0].id)
    scale = f"{count} particles, {scene.steps} steps, one of {len(TOWER.test)} test runs"
    printed = targets.load()[PRINTED].value
    for one in runs:
        name = f"ldm.fig16-larger.{one.label}"
        rule = ({"comparator": "info"} if one is runs[0] else
                {"comparator": ">=", "bound": printed})
        run.record(f"{name}.speed_up", fastest.wall / one.spent.wall, unit="x", scale=scale,
                   note=f"wall time of a step over that of the full model with its fastest "
                   f"transfer, {1e3 * fastest.wall:.3g} ms; {full.wall / one.spent.wall:.3g} x "
                   f"over the transfer it was trained on; {one.spent.wall / scene.dt:.3g} s a "
                   f"second; {one.points} quadrature points", **rule)
        record_errors(run, f"{name}.error", one.errors, scale, comparator="info")
    run.table("ways", OWN, [own_row(count, one, full, fastest, scene.dt) for one in runs])
