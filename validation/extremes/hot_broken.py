"""Implicit steps from impossible deformation: inverted, collapsed, random, extremely stretched."""

import numpy as np
from scipy.linalg import eigvalsh

from ..common.registry import experiment
from .blocks import DX, FRAME, brick, elastic, gravity, message_of
from .hot_solve import (
    CONVERGED,
    METHODS,
    STOPPED,
    StepSetup,
    copy_bodies,
    record_solves,
    solve,
    solve_table,
    stepper_of,
)

CELLS = {2: (6, 6), 3: (4, 4, 4)}
TIMES = (1e-3, FRAME)               # [s]
EXTENTS = ("one", "all")            # of the particles are deformed
BROKEN = ("inverted", "point inverted", "line", "flat", "zero", "tiny", "vanishing", "random",
          "small random")
STRETCHED = (2.0, 3.0, 10.0)
PARTICLE = 31                       # the one
REBUILD = 5
LONG = 3000         # iterations; the methods' own limit is 10000
SCALE = "2D block of 6 x 6 cells, 144 particles (3D: 4 x 4 x 4, 512), one particle or all"


def gradients(name, rng, n, d):
    """Return n deformation gradients (n, d, d) of a kind in BROKEN, or of a stretch."""
    I = np.tile(np.eye(d), (n, 1, 1))
    if not isinstance(name, str):
        return name * I
    if "random" in name:
        return (0.01 if "small" in name else 1.0) * rng.normal(size=(n, d, d))
    axes = {"inverted": [-1.0] + [1.0] * (d - 1), "point inverted": [-1.0] * d,
            "line": [1.0] + [0.0] * (d - 1), "flat": [0.0] + [1.0] * (d - 1), "zero": [0.0] * d,
            "tiny": [1e-6] * d, "vanishing": [1e-160] * d}[name]
    return I * np.array(axes)[:, None]


def deformed_block(d, E, name, extent, rng):
    """Return a body at rest with one or all of its particles deformed."""
    body = brick(CELLS[d], elastic(E))
    indices = [PARTICLE] if extent == "one" else slice(None)
    body.particles.F[indices] = gradients(name, rng, len(body.id[indices]), d)
    return body


def deformed_cases(run, names, moduli):
    """Return {(d, E, name, extent, dt): `StepSetup`}."""
    blocks = {(d, E, name, extent): deformed_block(d, E, name, extent, run.rng)
              for d in run.choose(quick=(2,), standard=(2, 3))
              for E in moduli
              for name in names for extent in EXTENTS}
    return {(*key, dt): StepSetup((body,), DX, dt, gravity(key[0]))
            for key, body in blocks.items() for dt in TIMES}


def sweep(run, name, setups, note):
    """Solve all cases by all methods. Returns (`StepSetup`, `SolveEnd`) of those that stopped."""
    ends = {(case, method): solve(setup, method)
            for case, setup in run.progress(setups.items(), "cases") for method in METHODS}
    record_solves(run, name, list(ends.values()), SCALE, note)
    solve_table(run, ("d", "E", "F", "extent", "dt"), [(*case, e) for (case, _), e in ends.items()])
    return [(setups[case], e) for (case, _), e in ends.items() if e.kind == STOPPED]


@experiment("extremes.hot.broken", title="Inverted, collapsed and random deformation at the start",
            profiles=("quick", "standard"), budget={"quick": 7, "standard": 240})
def broken_start(run):
    """Solve with fixed corotated, whose energy is finite for every finite F."""
    moduli = run.choose(quick=(1e6,), standard=(1e4, 1e6, 1e9))
    stopped = sweep(run, "broken", deformed_cases(run, BROKEN, moduli), "Newton is slow by the "
                    "projection: see extremes.hot.broken.curvature")
    longer = [solve(setup, "hot-plus", max_iterations=LONG)
              for setup, e in stopped if e.method == "hot-plus"]
    run.record("extremes.hot.broken.hot-plus.longer", sum(e.kind != CONVERGED for e in longer),
               paper=0, comparator="=",
               scale=f"{len(longer)} solves that met the iteration limit above",
               note=f"of these, how many do not converge in {LONG} iterations either; the most "
                    f"that one takes: {max((e.iterations for e in longer), default=0)}")
    newton = [least_curvature(setup, e.method) for setup, e in stopped if e.method.startswith("pn")]
    run.record("extremes.hot.broken.curvature", min(newton, default=1.0), comparator="info",
               scale=f"{len(newton)} Newton solves that reached their cap",
               note="least x.H x / x.P x at the end, H the Hessian and P its projection: Newton's "
                    "step with P is so much too short along x; negative: it crosses a saddle")


def least_curvature(setup, method):
    """Return the least x.H x / x.P x of the Hessian H and its projection P where a solve ended."""
    with np.errstate(all="ignore"):
        stepper = stepper_of(setup._replace(bodies=copy_bodies(setup.bodies)), method)
        pose = stepper.problem(setup.bodies, 0.0, setup.dt)
        dv = stepper.solve(pose)
    H = pose.potential.tangent(dv, projected=False).matrix().toarray()
    P = pose.potential.tangent(dv).matrix().toarray()
    return float(eigvalsh(H, P, subset_by_index=(0, 0))[0])


@experiment("extremes.hot.stretched", title="Stretched two to ten times, and released",
            profiles=("quick", "standard"), budget={"quick": 4, "standard": 400})
def stretched(run):
    """Release stretched blocks: their energy grows with the 2 d-th power of the stretch."""
    moduli = run.choose(quick=(1e6,), standard=(1e4, 1e6))
    stopped = sweep(run, "stretched", deformed_cases(run, STRETCHED, moduli), "L-BFGS is slow by "
                    "the first inverse, far from where it was taken: see "
                    "extremes.hot.stretched.rebuilt")
    rebuilt = [solve(setup, "hot", rebuild_every=REBUILD)
               for setup, e in stopped if e.method == "hot"]
    run.record("extremes.hot.stretched.rebuilt", max((e.iterations for e in rebuilt), default=0),
               comparator="info", scale=f"{len(rebuilt)} solves in which HOT reached its cap",
               note=f"outer iterations, at most, if HOT takes a new Hessian every {REBUILD} of "
                    f"them; {sum(e.kind == CONVERGED for e in rebuilt)} converge")


@experiment("extremes.hot.hopeless", title="Deformation whose energy is not finite",
            profiles=("quick", "standard"), budget={"quick": 1, "standard": 1})
def hopeless(run):
    """Check that an overflow ends the solve at its first iterate, and NaN the run before it."""
    body = deformed_block(2, 1e6, 1e150, "one", run.rng)
    ends = [solve(StepSetup((body,), DX, FRAME, gravity(2)), method) for method in METHODS]
    stopped = sum(e.kind == STOPPED and e.iterations == 0 and "expected finite" in e.why
                  for e in ends)
    run.record("extremes.hot.hopeless.overflow", stopped / len(ends), paper=1.0, comparator="=",
               scale="2D, one particle with F = 1e150 I, all methods",
               note=f"share that stopped at once with a reason: {ends[0].why}")
    setup = StepSetup((deformed_block(2, 1e6, np.nan, "one", run.rng),), DX, FRAME, gravity(2))
    message = message_of(lambda: solve(setup, "hot"))
    run.record("extremes.hot.hopeless.nan", int(f"F of particle {PARTICLE}" in message), paper=1,
               comparator="=", scale="2D, one particle with F = NaN",
               note=f"the run must name the particle; message: {message}")
