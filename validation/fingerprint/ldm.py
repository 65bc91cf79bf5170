"""Reduced runs of LDM: maps of each kind, quadratures, projections and choices of samples."""

from functools import partial

from . import library_rom as rom
from .recording import RunCase

STEPS = 10
POINTS = 60
SCHEMES = [(quadrature, projection) for quadrature in ("lagrangian", "eulerian")
           for projection in ("linear", "nonlinear")]
OPTIONS = {         # of runs on a network
    "all points": {},
    "resampled": {"quadrature": "resampled"},
    "kept": {"points": POINTS, "samples": "kept"},
    "pivoted": {"points": POINTS, "samples": "pivoted"},
    "latest": {"points": POINTS, "velocity": "latest"},
    "difference": {"points": POINTS, "velocity": "difference"},
    "transported": {"points": POINTS, "velocity": "transported"},
    "single": {"points": POINTS, "precision": "single"},
}
NETWORKS = {"gravity-r4": "ldm_gravity", "torsion-0": "ldm_torsion", "poke": "ldm_poke"}


def cases():
    """Return a `RunCase` of each kind of reduced run."""
    runs = [RunCase("ldm pod data", rom.data_of_pod)]
    for quadrature, projection in SCHEMES:
        options = {"quadrature": quadrature, "projection": projection, "points": POINTS}
        runs.append(RunCase(f"ldm pod {quadrature} {projection}", partial(on_pod, options)))
        runs.append(RunCase(f"ldm network {quadrature} {projection}",
                          partial(on_network, "gravity-r4", options)))
    runs.append(RunCase("ldm polynomial lagrangian nonlinear", on_polynomial))
    runs += [RunCase(f"ldm network {name}", partial(on_network, "gravity-r4", options))
              for name, options in OPTIONS.items()]
    runs += [RunCase(f"ldm network {net}", partial(on_network, net, {"points": POINTS}))
              for net in NETWORKS if net != "gravity-r4"]
    runs += [RunCase("ldm network neighbours", neighbours), RunCase("ldm network nodes", nodes)]
    return runs


def on_pod(options):
    """Return a run on POD modes."""
    return rom.ldm(rom.small_setup(), *rom.pod(), options, STEPS)


def on_polynomial():
    """Return a run on a polynomial manifold over POD modes."""
    options = {"projection": "nonlinear", "points": POINTS}
    return rom.ldm(rom.small_setup(), *rom.polynomial(2, 5, 2), options, STEPS)


def on_network(net, options):
    """Return a run on a stored network of the scene that it was trained for."""
    return rom.ldm(rom.setup_of(NETWORKS[net]), *rom.network(net), options, STEPS)


def neighbours():
    """Return a run with samples chosen once and the points near them."""
    return rom.ldm_by_neighbours(rom.setup_of("ldm_gravity"), *rom.network("gravity-r4"), POINTS,
                                 STEPS)


def nodes():
    """Return a run with the node-centric quadrature."""
    return rom.ldm_by_nodes(rom.setup_of("ldm_gravity"), *rom.network("gravity-r4"), 200, STEPS)
