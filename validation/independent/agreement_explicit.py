"""Explicit steps of the package and of second implementations, from the same particles.

Each function below runs a small problem by `mpm_ref.simulate` and by one file of this folder. It
returns the largest difference of a field of the particles at the end, over the change of that
field in the run, both in the maximum norm.
"""

import numpy as np

from mpm_ref.body import restore_order
from mpm_ref.constitutive import return_map
from mpm_ref.materials import make_flow, make_law
from mpm_ref.scene import problem_from_arrays
from mpm_ref.simulate import simulate

from ..common.registry import experiment
from . import contact_step, elastic_step, fluid_step, metal_step, sand_step
from .agreement import difference

DX, RHO = 0.1, 1000.0
STEPS = {"elastic": 50, "sand": 40, "fluid": 60, "metal": 60, "contact": 40}
# Difference that rounding may add in a step. Singular values and vectors of LAPACK err by up to
# 6e-15 of 1, and strains are as small as 0.05; the fluid needs none.
PER_STEP = {"elastic": 1e-13, "sand": 1e-13, "fluid": 1e-14, "metal": 1e-13, "contact": 1e-13}
BOUNDS = {name: PER_STEP[name] * STEPS[name] for name in STEPS}
PROJECTION = 1e-8       # of a strain that SLSQP finds; it stops where the distance stays to 1e-16
ANGLE = 35.0            # of the sand's friction [degrees]
SAND = {"E": 1e5, "nu": 0.2}


def cloud(lower, cells, velocity, seed):
    """Return arrays of jittered particles, two per cell and direction, that move and are strained.

    lower: corner of a block [cells]; cells: its size (d,); velocity: the mean one (d,) [m/s].
    """
    rng = np.random.default_rng(seed)
    d = len(cells)
    lattice = np.stack(np.meshgrid(*[np.arange(2 * n) for n in cells], indexing="ij"), -1)
    half_cells = lattice.reshape(-1, d) + rng.uniform(0.3, 0.7, (lattice[..., 0].size, d))
    V0 = (DX / 2)**d * rng.uniform(0.9, 1.1, len(half_cells))
    return {"x": DX * (np.array(lower) + half_cells / 2), "V0": V0, "m": RHO * V0,
            "v": np.array(velocity) + 0.1 * rng.normal(size=half_cells.shape),
            "C": rng.normal(size=(len(V0), d, d)),
            "F": np.eye(d) + 0.01 * rng.normal(size=(len(V0), d, d))}


def simulated(starts, materials, **keys):
    """Return {field: array} of each body after a run of the package, rows as at the start."""
    bodies = {f"body {k}": {"material": material, **start}
              for k, (start, material) in enumerate(zip(starts, materials, strict=True))}
    *_, last = simulate(problem_from_arrays(bodies, dx=DX, **keys))
    return [{name: restore_order(getattr(body.particles, "F" if name == "J" else name), body.id)
             for name in start} for start, body in zip(starts, last.state.bodies, strict=True)]


def largest_difference(expected, actual, start):
    """Return the largest difference of fields over their change since the start."""
    return max(difference(actual[name], expected[name], expected[name] - start[name])
               for name in expected)


def half_space(height, normal, **keys):
    """Return a collider with a flat face at a height [m] along the last axis."""
    point = [0.0] * (len(normal) - 1) + [height]
    return {"shape": {"type": "half_space", "point": point, "normal": normal}, **keys}


def elastic():
    """Return the difference of a block that hits a sticky floor in 2D."""
    start, dt, g, moduli = cloud((5.2, 2.8), (4, 4), (0.5, -1.5), 1), 0.004, (0.3, -9.8), (1e4, 0.3)
    [actual] = simulated(
        [start], [{"law": "fixed_corotated", "E": moduli[0], "nu": moduli[1]}], gravity=g, dt=dt,
        steps=STEPS["elastic"], collider=[half_space(2 * DX, (0.0, 1.0), kind="sticky")])
    problem = elastic_step.ElasticProblem(
        start["m"], start["V0"], *moduli, np.array(g), floor=2, dx=DX, dt=dt, shape=(16, 12))
    state = [start[name] for name in "xvCF"]
    for _ in range(STEPS["elastic"]):
        state = elastic_step.step(*state, problem)
    return largest_difference(dict(zip("xvCF", state, strict=True)), actual, start)


def sand():
    """Return the difference of a column of sand that falls apart on a rough floor in 3D."""
    start, dt, g, friction = cloud((2.5, 2.5, 1.3), (2, 2, 4), (0.2, 0, -0.4), 2), 0.002, -9.8, 0.4
    start["F"] = 0.99 * np.eye(3) + 0.2 * (start["F"] - np.eye(3))      # pressed: inside the cone
    start["v"][:, 2] += 2.0 * np.maximum(start["x"][:, 2] - 3 * DX, 0.0)        # torn at the top
    flow = {"type": "drucker_prager", "friction_angle": ANGLE}
    [actual] = simulated(
        [start], [{"law": "hencky", **SAND, "flow": flow}], dt=dt, gravity=(0.0, 0.0, g),
        steps=STEPS["sand"], scheme={"transfer": "apic", "degree": 3},
        collider=[half_space(DX, (0.0, 0.0, 1.0), kind="separate", friction=friction)])
    problem = sand_step.SandProblem(
        start["m"], start["V0"], elastic_step.lame(**SAND), np.radians(ANGLE),
        np.array([0.0, 0.0, g]), floor=1, friction=friction, dx=DX, dt=dt, shape=(8, 8, 9))
    state = [start[name] for name in "xvCF"]
    for _ in range(STEPS["sand"]):
        state = sand_step.step(*state, problem)
    return largest_difference(dict(zip("xvCF", state, strict=True)), actual, start)


def sand_returns():
    """Return the distances of the return map of trial strains to a minimiser, by regions.

    The return map is the package's, the minimiser `sand_step.nearest`, and distances are over
    the norm of the strain. {region: distances (N,)}: "on the cone", where matter is pressed and
    yields, of all strains of the cone with the same trace; "at the tip", where it is torn and the
    trial strain lies in the polar cone of the energy, of all strains of the cone in the norm of
    the energy. In that norm the paper's map is no projection for "pressed, any trace", the first
    region without the condition on the trace, and "between", where matter is torn but sheared
    more: there the map goes to the tip although another strain is nearer.
    """
    law = make_law("hencky", **SAND)
    mu, lam = elastic_step.lame(**SAND)
    k, weight = sand_step.cone_slope(np.radians(ANGLE), mu, lam), (lam + 2 * mu / 3) / (2 * mu)
    eps = 0.05 * np.random.default_rng(0).normal(size=(60, 3))
    F = return_map(np.exp(eps)[:, None] * np.eye(3), law,
                   make_flow("drucker_prager", law, 3, friction_angle=ANGLE)).F
    regions = {"on the cone": [], "at the tip": [], "pressed, any trace": [], "between": []}
    for trial, after in zip(eps, np.log(np.diagonal(F, axis1=1, axis2=2)), strict=True):
        tr = trial.sum()
        hat = np.linalg.norm(trial - tr / 3)
        if tr <= 0 and hat <= -k * tr:
            continue                                                # elastic
        of_trial = ("on the cone", "pressed, any trace") if tr <= 0 else (
            ("at the tip",) if hat <= weight * tr / k else ("between",))
        size = np.linalg.norm(trial)
        for region in of_trial:
            nearest = sand_step.nearest(trial / size, k, weight, region == "on the cone")
            regions[region].append(np.linalg.norm(after / size - nearest))
    return {region: np.array(distances) for region, distances in regions.items()}


def sand_projection():
    """Return the largest distance of `sand_returns` where the map is a projection."""
    distances = sand_returns()
    return float(max(distances["on the cone"].max(), distances["at the tip"].max()))


def fluid():
    """Return the difference of a fluid that sloshes in a slip box in 2D."""
    start, dt, g = cloud((3, 3), (4, 5), (0.5, -0.3), 3), 0.002, (0.3, -9.8)
    lam, flip, low, high = 2e4, 0.9, (3, 3), (9, 9)
    start = {name: start[name] for name in ("x", "v", "m", "V0")}
    start["J"] = np.random.default_rng(4).uniform(0.97, 1.02, len(start["x"]))
    [actual] = simulated(
        [start], [{"law": "fluid", "lam": lam}], gravity=g, dt=dt, steps=STEPS["fluid"],
        scheme={"transfer": "flip", "flip": flip},
        walls={"low": list(low), "high": list(high), "kind": "slip"})
    problem = fluid_step.FluidProblem(
        start["m"], start["V0"], lam, np.array(g), low, high, flip, DX, dt, count=13)
    state = [start[name] for name in "xvJ"]
    for _ in range(STEPS["fluid"]):
        state = fluid_step.step(*state, problem)
    return largest_difference(dict(zip("xvJ", state, strict=True)), actual, start)


def metal():
    """Return the difference of a block of metal under a press in 3D."""
    start, dt, floor, press = cloud((3, 3, 2.2), (2, 2, 3), (0, 0, 0), 5), 0.0015, 0.2, 0.5
    start["y"] = np.random.default_rng(6).uniform(1e3, 2e3, len(start["x"]))
    v_press, xi, moduli = np.array([0.4, 0.0, -1.0]), 0.1, {"E": 1e5, "nu": 0.3}
    flow = {"type": "von_mises_hardening", "tau_y": 1.5e3, "xi": xi}
    motion = {"translation": {"type": "steady", "rate": v_press.tolist()}}
    [actual] = simulated(
        [start], [{"law": "hencky", **moduli, "flow": flow}], dt=dt, steps=STEPS["metal"],
        scheme={"transfer": "apic"}, collider=[half_space(floor, (0.0, 0.0, 1.0)),
                                               half_space(press, (0.0, 0.0, -1.0), motion=motion)])
    problem = metal_step.MetalProblem(
        start["m"], start["V0"], *elastic_step.lame(**moduli), xi, floor, press, v_press, DX, dt,
        shape=(9, 9, 8))
    state = [start[name] for name in "xvCFy"]
    for k in range(STEPS["metal"]):
        height = press + v_press[2] * (k + 1) * dt
        state = metal_step.step(*state, problem._replace(press=height))
    return largest_difference(dict(zip("xvCFy", state, strict=True)), actual, start)


def contact():
    """Return the difference of a tilted block that falls and slides on another one in 2D."""
    starts, dt, g, friction = [cloud((4, 4), (5, 3), (0, 0), 6),
                               cloud((4.6, 7.1), (3, 3), (1, -1), 7)], 0.002, (0.3, -1.0), 0.3
    middle, turn = starts[1]["x"].mean(axis=0), np.array([[0.98, -0.2], [0.2, 0.98]])
    starts[1]["x"] = middle + (starts[1]["x"] - middle) @ turn.T
    moduli = [{"E": 1e5, "nu": 0.3}, {"E": 5e4, "nu": 0.2}]
    actual = simulated(
        starts, [{"law": "fixed_corotated", **both} for both in moduli], gravity=g, dt=dt,
        steps=STEPS["contact"], contact=[{"bodies": ["body 0", "body 1"], "friction": friction}])
    bodies = [{**start, **dict(zip(("mu", "lam"), elastic_step.lame(**both), strict=True))}
              for start, both in zip(starts, moduli, strict=True)]
    for _ in range(STEPS["contact"]):
        bodies = contact_step.step(bodies, friction=friction, g=np.array(g), dx=DX, dt=dt, count=14)
    return max(largest_difference({name: body[name] for name in "xvCF"}, fields, start)
               for body, fields, start in zip(bodies, actual, starts, strict=True))


@experiment("independent.explicit", title="Second implementations: explicit steps and return maps",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 20})
def explicit_steps(run):
    """Record the difference of each problem, and that of sand's return map to a projection."""
    problems = (
        (elastic, "2D, 64", "MLS-MPM, quadratic splines, fixed corotated, a sticky floor: x v C F"),
        (sand, "3D, 128", "APIC, cubic splines, Drucker-Prager, a floor with friction: x v C F"),
        (fluid, "2D, 80", "90 % FLIP, quadratic splines, a slip box: x v J"),
        (metal, "3D, 96", "APIC, quadratic splines, von Mises that hardens, a press: x v C F y"),
        (contact, "2D, 96", "MLS-MPM, two velocity fields, friction 0.3: x v C F of both bodies"))
    for problem, size, note in problems:
        name = problem.__name__
        run.record(f"independent.explicit.{name}", problem(), unit="1", comparator="<=",
                   bound=BOUNDS[name], scale=f"{size} particles, {STEPS[name]} steps",
                   note=f"{note}; largest difference to dense NumPy over the change in the run; "
                        f"{PER_STEP[name]:g} a step for rounding")
    run.record("independent.explicit.sand_projection", sand_projection(), unit="1",
               comparator="<=", bound=PROJECTION, scale="60 trial strains", scatter=1.0,
               note="Drucker-Prager's return map against SLSQP's nearest strain of the cone: of "
                    "the same trace if pressed, in the norm of the energy if torn and in the polar "
                    "cone; for torn and sheared strains between both cones, and for pressed ones "
                    "without the condition on the trace, the map is no projection")
