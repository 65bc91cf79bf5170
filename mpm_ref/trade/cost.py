"""The cost of finer grids of the reference, in numbers and in words."""

from math import ceil, isfinite, log10

from ..sweep.observation import STOPPED
from ..sweep.setting import setting
from .search import PATIENCE, REFERENCE_SHARE

OUT_OF_REACH = 1000.0   # times the budget
DURATIONS = {"s": 1.0, "min": 60.0, "hours": 3600.0, "days": 86400.0, "years": 365.25 * 86400.0}
BUDGETS = {"s": 1.0, "min": 60.0, "h": 3600.0}      # units of --budget
START = 1.1             # times the time of runs, for what a command takes beside them


def next_grid_facts(search):
    """Return the spacing [m] of the next grid of the reference and the least that is ever run, its
    expected CPU and wall time [s], by which factor both grow from there to the next one, and why a
    larger budget does not run it; None where no grid finished.
    """
    if not search.levels:
        return None
    chosen = setting(dx=search.levels[-1] / 2.0)
    growth = 2.0 ** (search.scene.dim + 1)
    finest = search.observations[setting(dx=search.levels[-1])]
    return {"dx": search.scene.dx * chosen.get("dx"), "least_dx": search.scene.dx * search.finest,
            "cpu": finest.cost.cpu * growth,
            "wall": finest.cost.wall * growth, "growth": growth,
            "obstacle": obstacle(search, chosen)}


def obstacle(search, chosen):
    """Return why a larger budget does not run the next grid, in words; "" where it does."""
    run = search.observations.get(chosen)
    if run is not None and run.outcome != STOPPED:
        return ": ".join(filter(None, run.ending))
    if chosen.get("dx") < search.finest:
        return "this command runs none so fine"
    if search.idle > PATIENCE:
        return f"not run, since {search.idle} grids in turn made no difference"
    return ""


def next_grid_text(facts):
    """Return what the next grid would take, or why it is not run."""
    grid = facts["next_grid"]
    name = f"the next grid, dx = {grid['dx']:.3g} m"
    if grid["obstacle"]:
        return f"{name}: {grid['obstacle']}"
    cpu, price = grid["cpu"], price_text(facts, 1)
    if cpu is None or not isfinite(cpu) or is_out_of_reach(facts, cpu):
        return f"{name}, would take {price}"
    return (f"{name}, would take {price}: the same command with --budget "
            f"{budget_text(START * cpu / REFERENCE_SHARE)} runs it")


def price_text(facts, halvings):
    """Return the CPU time of so many more grids, each with half the spacing of the one before."""
    grid = facts["next_grid"]
    if grid["cpu"] is None or not isfinite(grid["cpu"]):
        return "an unknown time"
    cpu = sum(grid["cpu"] * grid["growth"]**k for k in range(halvings))
    remark = ""
    if is_out_of_reach(facts, cpu):
        remark = f", which is out of reach (over {OUT_OF_REACH:g} times the budget)"
    elif grid["dx"] / 2.0 ** (halvings - 1) < grid["least_dx"] * (1.0 - 1e-9):
        remark = f", but this command runs no grid below dx = {grid['least_dx']:.3g} m"
    return f"about {duration(cpu)} of CPU time{remark}"


def is_out_of_reach(facts, cpu):
    """Return whether a CPU time [s] is far beyond the budget."""
    return facts["budget"] is not None and cpu > OUT_OF_REACH * facts["budget"]


def duration(seconds):
    """Return a time [s] in words, with two digits."""
    unit = max((name for name in DURATIONS if seconds >= 2.0 * DURATIONS[name]),
               key=DURATIONS.get, default="s")
    return f"{float(f'{seconds / DURATIONS[unit]:.2g}'):g} {unit}"


def budget_text(seconds):
    """Return a time [s], rounded up to two digits, as `--budget` reads it."""
    unit = max((name for name in BUDGETS if seconds >= 2.0 * BUDGETS[name]), key=BUDGETS.get,
               default="s")
    return f"{rounded_up(max(seconds, 1.0) / BUDGETS[unit]):g}{unit}"


def rounded_up(value):
    """Return a positive number rounded up to two digits."""
    digit = 10.0 ** (ceil(log10(value) + 1e-9) - 2)
    return float(f"{ceil(value / digit - 1e-6) * digit:.6g}")
