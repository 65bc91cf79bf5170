"""Laws learned from a run with faults: a time without frames, outliers, a wrong density."""

from ..common.registry import experiment
from ..nclaw.small_runs import COLUMNS, measured, seed_range
from ..nclaw.small_trainings import BASE, OF_FAULTS, SEEDS, small_nets

FAULTS = ("gap", "outliers")


@experiment("extremes.nclaw.observed", title="NCLaw: gaps, outliers and a wrong density",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 100})
def observed(run):
    """Beside trainings of other seeds on a run without faults. With a wrong density the stress is
    learned too large or too small by as much; the run is then made with the true one.
    """
    names = run.choose(quick=[BASE], standard=[*SEEDS, *OF_FAULTS])
    found = measured(run, names, full=False)
    least, most = seed_range(found, SEEDS)
    for row in found:
        run.record(f"extremes.nclaw.observed.{row.name}", row.training_run, unit="m^2",
                   comparator="info", scale="216 particles, 100 epochs", note="without faults "
                   f"{least:.3g} to {most:.3g} m^2 by seed; thrown otherwise {row.thrown:.3g} m^2")
    run.table("trainings", (*COLUMNS, *FAULTS, "density"), [
        (*row, *(getattr(small_nets()[row.name].observation, key) for key in FAULTS),
         small_nets()[row.name].density) for row in found])
