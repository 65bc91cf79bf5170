"""The tower: what reduced runs of up to three million points cost (LDM-sec5.4, Figure 16).

The map is trained on one in sixteen of 34 thousand points on a grid three times as coarse.
"""

from mpm_ref.rom.study.run import PROJECTIONS, SCHEMES, RunOptions
from mpm_ref.scene import build

from ..common.registry import experiment
from .networks import trained
from .references import record_errors
from .studies import TOWER, refined
from .timing import COLUMNS, OPTIONS, race

NET = "tower"
SOUND = 1.5         # times the error of the paper's options, up to which faster ones count
GRIDS = {34: (1.44, 2), 385: (0.96, 3), 3076: (0.48, 3)}     # thousand points: dx [m], per axis
POINTS = (25, 50)
FEWEST = 10         # samples of the cheapest options
PAPER = RunOptions("eulerian", "linear")
FAST = PAPER._replace(velocity="transported", preimage_tolerance=1e-2, precision="single")
OWN = ("particles", *COLUMNS, "wall_full", "wall_fastest", "wall_per_second", "speed_up",
       "speed_up_same")


def scene_of(size, k=TOWER.test[0]):
    """Return the scene of run k of the study with about `size` thousand points."""
    return refined(TOWER.scene(*TOWER.mu[k]), *GRIDS[size])


def all_options(points):
    """Return `RunOptions` of the paper's schemes and of cheaper ones, for numbers of samples."""
    cheap = (FAST, RunOptions("resampled", "linear"), FAST._replace(quadrature="resampled"))
    chosen = [*(RunOptions(*scheme) for scheme in SCHEMES), *cheap]
    return [*(options._replace(points=n) for options in chosen for n in points),
            FAST._replace(points=FEWEST)]


@experiment("ldm.fig16", title="LDM: speed on the tower",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 900})
def speed(run):
    """Error and wall time of reduced runs of one test run, by size."""
    rows, model = [], trained(NET)
    for size in run.progress(run.choose(quick=(34,), standard=GRIDS), "sizes"):
        scene = scene_of(size)
        chosen = run.choose(quick=[PAPER._replace(points=25), FAST._replace(points=25)],
                            standard=all_options(POINTS))
        steps = run.choose(quick=6, standard=scene.steps)
        full, best, runs = race(scene, (model.field, model.rest), chosen, steps)
        count = len(build(scene).bodies[0].id)
        rows += [own_row(count, one, full, best, scene.dt) for one in runs]
        report(run, f"ldm.fig16.{size}", runs, (full, best, scene.dt),
               f"{count} particles, {steps} steps, one of {len(TOWER.test)} test runs")
    printed(run, [dict(zip(OWN, row, strict=True)) for row in rows])
    run.table("ways", OWN, rows)


def own_row(count, one, full, fastest, dt):
    """Return the row of OWN of a `TimedRun` of so many particles, with steps of dt [s]."""
    return (count, *one.row, full.wall, fastest.wall, one.spent.wall / dt,
            fastest.wall / one.spent.wall, full.wall / one.spent.wall)


def report(run, name, runs, times, scale):
    """Record speed-ups and errors of all `TimedRun`s of a size."""
    full, best, dt = times
    run.record(f"{name}.full", full.wall, unit="s", comparator="info", scale=scale,
               note=f"wall time of a step, median of the run; with the fastest transfer, a step in "
               f"turn with all others, {best.wall:.3g}")
    for one in runs:
        run.record(f"{name}.{one.label}.speed_up", best.wall / one.spent.wall, unit="x",
                   comparator="info", scale=scale,
                   note=f"over the full model with its fastest transfer; "
                   f"{full.wall / one.spent.wall:.3g} x over the transfer it was trained on; "
                   f"{one.spent.wall / dt:.3g} s a second; {one.points} quadrature points")
        record_errors(run, f"{name}.{one.label}.error", one.errors, scale, comparator="info")


def printed(run, rows):
    """Record the numbers that the paper prints, for the largest size."""
    if run.profile != "standard":
        return
    rows = [r for r in rows if r["particles"] == rows[-1]["particles"]
            and (r["quadrature"], r["projection"]) == ("eulerian", PROJECTIONS[1])]
    usual, most = (next(r for r in rows if r["points"] == points
                        and r["preimage_tolerance"] == PAPER.preimage_tolerance)
                   for points in POINTS)
    sound = [r for r in rows if r["points"] < 50 and r["origin"] <= SOUND * usual["origin"]]
    record_speed(run, usual, "")
    record_speed(run, min(sound, key=lambda r: r["wall"]), ".cheap")
    run.record("ldm.sec5_4.quadrature_points", most["quadrature_points"],
               scale=f"{most['particles']} particles, 50 samples")


def record_speed(run, row, word):
    """Record the printed speed-ups and time of a row; word: behind the ids, of other options."""
    scale = f"{row['particles']} particles"
    note = ", ".join(f"{name} {row[name]}" for name in OPTIONS)
    for target in ("ldm.fig16.speedup", "ldm.abstract.speedup"):
        run.record(f"{target}{word}", row["speed_up"], scale=scale,
                   note=f"over the full model with its fastest transfer; "
                   f"{row['speed_up_same']:.3g} x over the transfer it was trained on; {note}")
    run.record(f"ldm.fig16.realtime{word}", row["wall_per_second"], scale=scale, note=note)
