"""Reduced runs of LDM: maps of each kind, quadratures, projections and choices of samples."""

from functools import partial

from . import library_rom as rom
from .recording import Case

STEPS = 10
POINTS = 60
SCHEMES = [(quadrature, projection) for quadrature in ("lagrangian", "eulerian")
           for projection in ("linear", "nonlinear")]
WAYS = {            # of runs on a network
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
    """Return a `Case` of each kind of reduced run."""
    found = [Case("ldm pod data", rom.data_of_pod)]
    for quadrature, projection in SCHEMES:
        way = {"quadrature": quadrature, "projection": projection, "points": POINTS}
        found.append(Case(f"ldm pod {quadrature} {projection}", partial(on_pod, way)))
        found.append(Case(f"ldm network {quadrature} {projection}",
                          partial(on_network, "gravity-r4", way)))
    found.append(Case("ldm polynomial lagrangian nonlinear", on_polynomial))
    found += [Case(f"ldm network {name}", partial(on_network, "gravity-r4", way))
              for name, way in WAYS.items()]
    found += [Case(f"ldm network {net}", partial(on_network, net, {"points": POINTS}))
              for net in NETWORKS if net != "gravity-r4"]
    found += [Case("ldm network neighbours", neighbours), Case("ldm network nodes", nodes)]
    return found


def on_pod(way):
    """Return a run on POD modes."""
    return rom.ldm(rom.small_case(), *rom.pod(), way, STEPS)


def on_polynomial():
    """Return a run on a polynomial manifold over POD modes."""
    way = {"projection": "nonlinear", "points": POINTS}
    return rom.ldm(rom.small_case(), *rom.polynomial(2, 5, 2), way, STEPS)


def on_network(net, way):
    """Return a run on a stored network of the scene that it was trained for."""
    return rom.ldm(rom.case_of(NETWORKS[net]), *rom.network(net), way, STEPS)


def neighbours():
    """Return a run with samples chosen once and their neighbours."""
    return rom.ldm_by_neighbours(rom.case_of("ldm_gravity"), *rom.network("gravity-r4"), POINTS,
                                 STEPS)


def nodes():
    """Return a run with the node-centric quadrature."""
    return rom.ldm_by_nodes(rom.case_of("ldm_gravity"), *rom.network("gravity-r4"), 200, STEPS)
