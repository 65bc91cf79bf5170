"""Cases of `benchmarks.conformance`: the scene of each, and the problem that a backend is given.

Backends take their numbers from the golden file alone, as another code would.
"""

import json
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np

from mpm_ref import scene
from mpm_ref.scene.overrides import with_values

SCENES = Path(__file__).with_name("scenes")
NODES = 12                      # per axis, the first one at the origin
STEPS = 3
STATE = ("x", "v", "C", "F")
STRAIN = 0.2
BEGIN = 8
ELASTICITY = {"E": 1e5, "nu": 0.3}
MATERIALS = {
    "jelly": {"law": "fixed_corotated", **ELASTICITY},
    "sand": {"law": "hencky", **ELASTICITY,
             "flow": {"type": "drucker_prager", "friction_angle": 45.0}},
    "fluid": {"law": "fluid", **ELASTICITY},
}


class Case(NamedTuple):
    """A problem of which every backend makes some steps.

    state: "moving", after BEGIN steps, in which the body touches the floor, and sand flows and
    opens; "at rest", without velocity, at the start; "unstrained", moving, after one step, with
    most F near a rotation; "strained", moving, after one step from F = I + 0.2 Z, Z of independent
    normal numbers.
    """

    dim: int
    transfer: str           # "mls" or "apic"
    material: str           # of MATERIALS
    state: str = "moving"

    def __str__(self):
        name = f"{self.dim}D {self.transfer.upper()} {self.material}"
        return name if self.state == "moving" else f"{name}, {self.state}"


CASES = (
    *(Case(dim, transfer, material) for dim in (2, 3) for transfer in ("mls", "apic")
      for material in MATERIALS),
    *(Case(dim, "mls", material, "at rest") for dim in (2, 3) for material in MATERIALS),
    *(Case(dim, "mls", material, "strained") for dim in (2, 3) for material in ("jelly", "sand")),
)
ADJOINT_CASES = (
    *(Case(3, transfer, material) for transfer in ("mls", "apic")
      for material in ("jelly", "fluid")),
    Case(3, "mls", "jelly", "unstrained"), Case(3, "mls", "jelly", "strained"),
)


class Start(NamedTuple):
    """The state before the first step, and the constants of all steps."""

    material: str           # of MATERIALS
    transfer: str           # "mls" or "apic"
    x: np.ndarray           # (N, d) [m]
    v: np.ndarray           # (N, d) [m/s]
    C: np.ndarray           # (N, d, d) [1/s]
    F: np.ndarray           # (N, d, d), or (N,) of J in a fluid
    m: np.ndarray           # (N,) [kg]
    V0: np.ndarray          # (N,) [m^d]
    dx: float               # [m]
    dt: float               # [s]
    gravity: np.ndarray     # (d,) [m/s^2]
    mu: float               # [Pa], 0 in a fluid
    lam: float              # [Pa]
    alpha: float            # slope of the cone of sand, else 0
    normal: np.ndarray      # (d,) of the floor
    solid: np.ndarray       # (n, .., n) whether a node lies in the floor
    friction: float         # of the floor

    @property
    def dim(self):
        """Return the number of dimensions."""
        return self.x.shape[1]

    @property
    def n(self):
        """Return the number of nodes per axis."""
        return self.solid.shape[0]


def case_problem(case):
    """Return the `Problem` of a case, and the number of steps to make before the first one."""
    values = {"scheme.transfer": case.transfer, "body.body.material": MATERIALS[case.material]}
    if case.state == "at rest":
        values["body.body.velocity"] = {"linear": [0.0] * case.dim}
    base = scene.load(SCENES / f"conformance_{case.dim}d.toml")
    problem = scene.build(with_values(base, values))
    if case.state == "strained":
        F = problem.bodies[0].particles.F
        F += STRAIN * np.random.default_rng(0).standard_normal(F.shape)
    return problem, {"moving": BEGIN, "at rest": 0}.get(case.state, 1)


def read_start(golden):
    """Return the `Start` of a golden file."""
    with h5py.File(golden) as f:
        body = f["bodies/body"]
        state = {name: body[name][()] for name in ("x", "v", "C", "F", "m", "V0")}
        law, flow = (json.loads(body.attrs[f"{role}_parameters"]) for role in ("law", "flow"))
        material = {"FixedCorotated": "jelly", "Hencky": "sand", "Fluid": "fluid"}[
            body.attrs["law"]]
        scene_ = scene.loads(f.attrs["scene"])
        dx, dt = float(f.attrs["dx"]), float(f["steps/0"].attrs["dt"])
        gravity, transfer = f.attrs["gravity"], f.attrs["transfer"]
    floor, = scene_.collider
    normal = np.array(floor.shape.normal)
    x_i = dx * np.moveaxis(np.indices((NODES,) * len(gravity)), 0, -1)
    return Start(material, transfer, **state, dx=dx, dt=dt, gravity=gravity, mu=law.get("mu", 0.0),
                 lam=law["lam"], alpha=flow.get("alpha", 0.0), normal=normal,
                 solid=(x_i - floor.shape.point) @ normal <= 0.0, friction=floor.friction)


def read_seeds(golden):
    """Return lists of the `Start`s and the seeds {name: array} of the steps of a golden file with
    adjoints, each step from its golden state.
    """
    starts, seeds = [read_start(golden)], []
    with h5py.File(golden) as f:
        for k in range(len(f["steps"])):
            body = f[f"steps/{k}/body"]
            seeds.append({name: body[f"{name}_seed"][()] for name in STATE})
            starts.append(starts[-1]._replace(**{name: body[name][()] for name in STATE}))
    return starts[:-1], seeds


def double_svd(F):
    """Return U (N, d, d), s (N, d) and V (N, d, d) of F = U diag(s) V^T by NumPy in double
    precision, whatever the type of F (N, d, d) is.
    """
    U, s, Vt = np.linalg.svd(np.asarray(F, dtype=float))
    return U, s, Vt.swapaxes(1, 2)
