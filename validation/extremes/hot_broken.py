"""Deformation that no matter has: inverted, collapsed, random, stretched beyond reason."""

import numpy as np
from scipy.linalg import eigvalsh

from ..common.registry import experiment
from .hot_bodies import DX, FRAME, brick, elastic, gravity
from .hot_solve import (
    CONVERGED,
    METHODS,
    STOPPED,
    Setup,
    copied,
    record_ends,
    solve,
    stepper_of,
    table_of,
)

CELLS = {2: (6, 6), 3: (4, 4, 4)}
TIMES = (1e-3, FRAME)               # [s]
FOUND = ("one", "all")              # of the particles are broken
BROKEN = ("inverted", "point inverted", "line", "flat", "zero", "tiny", "vanishing", "random",
          "small random")
STRETCHED = (2.0, 3.0, 10.0)
PARTICLE = 31                       # the one
REBUILD = 5
SCALE = "2D block of 6 x 6 cells, 144 particles (3D: 4 x 4 x 4, 512), one particle or all"


def gradients(name, rng, n, d):
    """n deformation gradients (n, d, d) of a kind in BROKEN, or of a stretch."""
    I = np.tile(np.eye(d), (n, 1, 1))
    if not isinstance(name, str):
        return name * I
    if "random" in name:
        return (0.01 if "small" in name else 1.0) * rng.normal(size=(n, d, d))
    axes = {"inverted": [-1.0] + [1.0] * (d - 1), "point inverted": [-1.0] * d,
            "line": [1.0] + [0.0] * (d - 1), "flat": [0.0] + [1.0] * (d - 1), "zero": [0.0] * d,
            "tiny": [1e-6] * d, "vanishing": [1e-160] * d}[name]
    return I * np.array(axes)[:, None]


def broken(d, E, name, found, rng):
    """Body at rest, one or all of whose particles are deformed so."""
    made = brick(CELLS[d], elastic(E))
    at = [PARTICLE] if found == "one" else slice(None)
    made.particles.F[at] = gradients(name, rng, len(made.id[at]), d)
    return made


def cases(run, names, moduli):
    """(d, E, name, found, dt) and the `Setup` of each."""
    made = {(d, E, name, found): broken(d, E, name, found, run.rng)
            for d in run.choose(quick=(2,), standard=(2, 3))
            for E in moduli
            for name in names for found in FOUND}
    return {(*key, dt): Setup((body,), DX, dt, gravity(key[0]))
            for key, body in made.items() for dt in TIMES}


def sweep(run, name, setups, note):
    """Solve all cases by all methods; returns (`Setup`, `End`) of those that did not converge."""
    ends = {(case, method): solve(setup, method)
            for case, setup in run.progress(setups.items(), "cases") for method in METHODS}
    record_ends(run, name, list(ends.values()), SCALE, note)
    table_of(run, ("d", "E", "F", "found", "dt"), [(*case, e) for (case, _), e in ends.items()])
    return [(setups[case], e) for (case, _), e in ends.items() if e.kind == STOPPED]


@experiment("extremes.hot.broken", title="Inverted, collapsed and random deformation at the start",
            profiles=("quick", "standard"), budget={"quick": 7, "standard": 240})
def broken_start(run):
    """Fixed corotated, whose energy is finite for every finite F."""
    moduli = run.choose(quick=(1e6,), standard=(1e4, 1e6, 1e9))
    stopped = sweep(run, "broken", cases(run, BROKEN, moduli), "Newton is slow by the projection: "
                    "see extremes.hot.broken.curvature")
    newton = [softest(setup, e.method) for setup, e in stopped if e.method.startswith("pn")]
    run.record("extremes.hot.broken.curvature", min(newton, default=1.0), comparator="info",
               scale=f"{len(newton)} Newton solves that reached their cap",
               note="least x.H x / x.P x at the end, H the Hessian and P its projection: Newton's "
                    "step with P is so much too short along x; negative: it crosses a saddle")


def softest(setup, method):
    """Least x.H x / x.P x of the Hessian H and its projection P where a solve ended."""
    with np.errstate(all="ignore"):
        stepper = stepper_of(setup._replace(bodies=copied(setup.bodies)), method)
        pose = stepper.problem(setup.bodies, 0.0, setup.dt)
        dv = stepper.solve(pose)
    H = pose.potential.tangent(dv, projected=False).matrix().toarray()
    P = pose.potential.tangent(dv).matrix().toarray()
    return float(eigvalsh(H, P, subset_by_index=(0, 0))[0])


@experiment("extremes.hot.stretched", title="Stretched two to ten times, and let go",
            profiles=("quick", "standard"), budget={"quick": 4, "standard": 400})
def stretched(run):
    """The energy grows with the 2 d-th power of the stretch, and is far from convex."""
    moduli = run.choose(quick=(1e6,), standard=(1e4, 1e6))
    stopped = sweep(run, "stretched", cases(run, STRETCHED, moduli), "L-BFGS is slow by the first "
                    "inverse, far from where it was taken: see extremes.hot.stretched.rebuilt")
    again = [solve(setup, "hot", rebuild_every=REBUILD)
             for setup, e in stopped if e.method == "hot"]
    run.record("extremes.hot.stretched.rebuilt", max((e.iterations for e in again), default=0),
               comparator="info", scale=f"{len(again)} solves in which HOT reached its cap",
               note=f"outer iterations, at most, if HOT takes a new Hessian every {REBUILD} of "
                    f"them; {sum(e.kind == CONVERGED for e in again)} converge")


@experiment("extremes.hot.hopeless", title="Deformation whose energy is no number",
            profiles=("quick", "standard"), budget={"quick": 1, "standard": 1})
def hopeless(run):
    """An energy that overflows must end the solve at its first iterate; NaN, the run before it."""
    made = broken(2, 1e6, 1e150, "one", run.rng)
    ends = [solve(Setup((made,), DX, FRAME, gravity(2)), method) for method in METHODS]
    said = sum(e.kind == STOPPED and e.iterations == 0 and "expected finite" in e.why for e in ends)
    run.record("extremes.hot.hopeless.overflow", said / len(ends), paper=1.0, comparator="=",
               scale="2D, one particle with F = 1e150 I, all methods",
               note=f"share that stopped at once and said why: {ends[0].why}")
    said = refusal(Setup((broken(2, 1e6, np.nan, "one", run.rng),), DX, FRAME, gravity(2)))
    run.record("extremes.hot.hopeless.nan", int(f"F of particle {PARTICLE}" in said), paper=1,
               comparator="=", scale="2D, one particle with F = NaN",
               note=f"the run must name the particle; it said: {said}")


def refusal(setup):
    """What a solve says that refuses its setup."""
    try:
        solve(setup, "hot")
    except ValueError as error:
        return " ".join(str(error).split())
    return ""
