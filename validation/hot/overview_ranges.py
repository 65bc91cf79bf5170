"""The ranges of Figure 15's speed-ups over entire runs, from the totals that `overview_runs` has
measured: verdicts on the ranges that section 7.2 prints, without a run.
"""

from ..common.input_files import declare
from ..common.registry import experiment
from ..common.results import RESULTS, ProfileResults
from .overview import ABLATION, smallest

TOTALS = "hot.fig15-runs"
TABLE = "speedups"


def recorded_totals(results):
    """Return ({method: {scene: CPU time over HOT's}}, {scene: particles}) of recorded totals."""
    table = results.table(TOTALS, TABLE)
    totals = {}
    for method, scene, total in zip(table["method"], table["scene"], table["total"], strict=True):
        totals.setdefault(str(method), {})[str(scene)] = float(total)
    return totals, dict(zip(table["scene"], table["particles"], strict=True))


@experiment("hot.fig15-ranges", title="Ranges of the speed-ups over entire runs",
            profiles=("standard",), budget={"standard": 5})
def ranges(run):
    """Record the smallest and largest total over each method of the ablation, of scenes that are
    smaller than printed. The smallest leaves out the scenes that the text does.
    """
    declare(f"results/standard/{TOTALS}.{TABLE}.csv")
    totals, particles = recorded_totals(ProfileResults(RESULTS / "standard"))
    scale = (f"{len(particles)} scenes of {int(min(particles.values()))} to "
             f"{int(max(particles.values()))} particles, recorded by `{TOTALS}`")
    for method in ABLATION:
        name = "hot.sec7_2.speedup." + method.replace("-", "_")
        listed = ", ".join(f"{scene} {total:.2f}" for scene, total in totals[method].items())
        run.record(f"{name}.min.small", smallest(totals[method]), scale=scale,
                   note=f"{listed}; without Sauce and the soft ArmaCat, as in the text")
        run.record(f"{name}.max.small", max(totals[method].values()), scale=scale, note=listed)
