"""Time steps up to 1/24 s, and matter that crosses many cells in one of them."""

from ..common.registry import experiment
from .hot_bodies import DX, FRAME, brick, elastic, gravity, shaken
from .hot_solve import Setup, record_ends, table_of
from .hot_steps import Scene, all_of

STEPS = 5
TIMES = (1e-6, 1e-3, FRAME)       # [s]
CROSSED = (1.0, 3.0, 10.0)         # cells, by the swiftest particle in a step
CELLS = {2: (16, 8), 3: (8, 4, 4)}
NOTES = {"time_step": "", "cfl": "what takes long starts with J from -15 to 17, neighbours having "
                                 "crossed 10 cells, and keeps the first inverse of that state"}


def thrown(d, E, dt, speed):
    """`Setup` of a box in uneven motion of a speed [m/s]."""
    return Setup(shaken((brick(CELLS[d], elastic(E)),), speed=speed), DX, dt, gravity(d))


@experiment("extremes.hot.time_step", title="Steps of 1/24 s, and past the CFL bound",
            profiles=("quick", "standard"), budget={"quick": 5, "standard": 70})
def time_step(run):
    """Runs of fixed dt; the explicit bound of the stiffest is 4e-6 s."""
    scenes = []
    for d in run.choose(quick=(2,), standard=(2, 3)):
        for E in run.choose(quick=(1e4, 1e9), standard=(1e4, 1e6, 1e9)):
            scenes += [Scene(f"{d}d, E = {E:.0e}, dt = {dt:.2g}", thrown(d, E, dt, 0.5), STEPS)
                       for dt in TIMES]
            scenes += [Scene(f"{d}d, E = {E:.0e}, CFL = {cells:g}",
                             thrown(d, E, FRAME, cells * DX / FRAME), STEPS) for cells in CROSSED]
    rows = all_of(run.progress(scenes, "runs"))
    for name, word in (("time_step", "dt = "), ("cfl", "CFL = ")):
        record_ends(run, name, [end for case, end in rows if word in case],
                    f"box of 512 particles (3D: 1024), {STEPS} steps", NOTES[name])
    table_of(run, ("run",), rows)
