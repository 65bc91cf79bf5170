"""The stages of one explicit step, in order, and the arrays of each that a backend can compare."""

from typing import NamedTuple

FORMAT = "mpm_ref golden 1"


class Array(NamedTuple):
    """One array of a golden file. docs/oracle.md explains each."""

    name: str
    stage: str
    where: str      # "nodes", "particles", "pairs" of both, or "body"
    unit: str


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
SUMS = ("mass", "momentum", "force")            # zero at a node that is not listed
ENERGIES = ("kinetic", "elastic", "gravity")    # the entries of `energy`

# Carried beside them, to find one's way: no numbers to compare.
BESIDE = ("nodes", "base", "id")


def key(array, body=None):
    """Name of an array within a step: `mass` on nodes, `ball/x` for the particles of a body."""
    return array.name if array.where == "nodes" else f"{body}/{array.name}"
