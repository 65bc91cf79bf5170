"""The layout of golden files: the stages of a step, in order, and the arrays of each stage.

A step in a file is a group of arrays. Each array lies on nodes, on particles, on pairs of both, or
belongs to a body or to the step; `Array` says which, and in which unit and after which stage.
docs/reference/golden-files.md explains every array.
"""

from typing import NamedTuple

FORMAT = "mpm_ref golden 1"         # attribute `format` of a golden file
LEVELS = 8                          # the most multigrid levels that are recorded


class Array(NamedTuple):
    """An array of a golden file that other codes are compared with."""

    name: str
    stage: str
    location: str   # "nodes", "particles", "pairs" of both, "body", its "parameters", or "step"
    unit: str
    level: int = 0  # of multigrid, whose nodes the array lies on; 0 is the finest


ARRAYS = (
    Array("weights", "weights", "pairs", "1"),
    Array("mass", "p2g", "nodes", "kg"),
    Array("momentum", "p2g", "nodes", "kg m/s"),
    Array("force", "p2g", "nodes", "N"),
    Array("velocity", "velocity", "nodes", "m/s"),
    Array("velocity_bc", "boundaries", "nodes", "m/s"),
    Array("v", "g2p", "particles", "m/s"),
    Array("x", "g2p", "particles", "m"),
    Array("C", "g2p", "particles", "1/s"),
    Array("L", "g2p", "particles", "1/s"),
    Array("F_trial", "F trial", "particles", "1"),
    Array("F", "return map", "particles", "1"),
    Array("y", "return map", "particles", "Pa"),
    Array("tau", "stress", "particles", "Pa"),
    Array("energy", "energies", "body", "J"),
)
MULTIGRID = tuple(array for k in range(1, LEVELS) for array in (
    Array(f"prolonged{k}", "prolongation", "nodes", "m/s", k - 1),
    Array(f"coarse{k}", "coarse matrix", "nodes", "kg m/s", k),
))
SOLVE_ARRAYS = (
    Array("velocity_old", "velocity", "nodes", "m/s"),
    Array("projector", "conditions", "nodes", "1"),
    Array("start", "conditions", "nodes", "m/s"),
    Array("kappa", "norms", "nodes", "kg m/s"),
    Array("E_start", "potential", "step", "J"),
    Array("gradient_start", "potential", "nodes", "kg m/s"),
    Array("E_trial", "potential", "step", "J"),
    Array("gradient_trial", "potential", "nodes", "kg m/s"),
    Array("product_start", "Hessian", "nodes", "kg m/s"),
    Array("product_trial", "Hessian", "nodes", "kg m/s"),
    *MULTIGRID,
    Array("cycle", "V-cycle", "nodes", "m/s"),
    Array("direction", "direction", "nodes", "m/s"),
    Array("dv", "accepted step", "nodes", "m/s"),
)
IMPLICIT = (*ARRAYS[:3], *SOLVE_ARRAYS, *ARRAYS[6:])
# Stages backwards: the gradients by these fields of a loss [m/s] of the state after the step.
ADJOINT = (
    Array("F_trial_grad", "return map adjoint", "particles", "m/s"),
    Array("y_grad", "return map adjoint", "particles", "m/(s Pa)"),
    Array("F_strain_grad", "F trial adjoint", "particles", "m/s"),
    Array("L_grad", "F trial adjoint", "particles", "m"),
    Array("velocity_bc_grad", "g2p adjoint", "nodes", "1"),
    Array("velocity_old_grad", "g2p adjoint", "nodes", "1"),
    Array("x_g2p_grad", "g2p adjoint", "particles", "1/s"),
    Array("velocity_grad", "boundaries adjoint", "nodes", "1"),
    Array("mass_grad", "velocity adjoint", "nodes", "m/(s kg)"),
    Array("momentum_grad", "velocity adjoint", "nodes", "1/kg"),
    Array("force_grad", "velocity adjoint", "nodes", "s/kg"),
    Array("gravity_grad", "velocity adjoint", "step", "s"),
    Array("x_grad", "p2g adjoint", "particles", "1/s"),
    Array("v_grad", "p2g adjoint", "particles", "1"),
    Array("C_grad", "p2g adjoint", "particles", "m"),
    Array("tau_grad", "p2g adjoint", "particles", "m/(s Pa)"),
    Array("m_grad", "p2g adjoint", "particles", "m/(s kg)"),
    Array("V0_grad", "p2g adjoint", "particles", "m/(s m^d)"),
    Array("b_grad", "p2g adjoint", "particles", "s"),
    Array("F_grad", "stress adjoint", "particles", "m/s"),
    Array("law_grad", "stress adjoint", "parameters", "m/s over that of the parameter"),
    Array("flow_grad", "stress adjoint", "parameters", "m/s over that of the parameter"),
)
ALL_ARRAYS = (*ARRAYS, *SOLVE_ARRAYS, *ADJOINT)
LOCATION = {array.name: array.location for array in ALL_ARRAYS}
# Sums over particles, which are 0 at a node that is not listed.
SUMS = ("mass", "momentum", "force", "gradient_start", "gradient_trial", "product_start",
        "product_trial", *(array.name for array in MULTIGRID), "velocity_bc_grad",
        "velocity_old_grad", "velocity_grad")
ENERGIES = ("kinetic", "elastic", "gravity")    # the entries of `energy`

# Arrays that no check compares: indices, the vectors that operators are applied to, and seeds.
NODES = ("nodes", *(f"nodes{k}" for k in range(1, LEVELS)))
PROBES = ("trial", "probe", "load", *(f"probe{k}" for k in range(1, LEVELS)))
SEEDS = tuple(f"{name}_seed" for name in ("x", "v", "C", "F", "y"))     # of bodies
INTEGERS = (*NODES, "base", "id")
AUXILIARY = (*INTEGERS, *PROBES, *SEEDS)


def reserved_names(integrator):
    """Return the names in a step of an integrator that no body may have: those of other members."""
    on_nodes = {a.name for a in stage_arrays(integrator) if a.location in ("nodes", "step")}
    if integrator == "implicit":
        return {*on_nodes, *NODES, *PROBES, "scale", "bar", "report"}
    return {*on_nodes, "nodes", "scale"}


def key(array, body=None):
    """Return an array's name within a step: `mass` on nodes, `ball/x` for particles of a body."""
    return array.name if array.location in ("nodes", "step") else f"{body}/{array.name}"


def stage_arrays(integrator):
    """Return the arrays of a step in the order of its stages.

    integrator is "implicit"; anything else means explicit.
    """
    return IMPLICIT if integrator == "implicit" else (*ARRAYS, *ADJOINT)
