"""Two elastic rings collide: which share of the energy each transfer keeps.

The setting is that of a public code (Tesserae.jl, tutorial on transfer schemes), whose tests hold
energies for the end, from randomly placed particles: rings of radii 3 and 4 m fly at each other
with 30 m/s, E 100 MPa, nu 0.2, 1000 kg/m^3, log neo-Hookean, dx 0.1 m, 0.6 s. Ours are on a
lattice.
"""

from itertools import pairwise

from mpm_ref.scene import Body, Material, Regular, Scene, Scheme, Torus, Velocity

from ..common.registry import experiment
from .collision import TRANSFERS, collision_history, thinned

PUBLISHED = {"pic": 8.004e6, "apic": 1.347e7, "flip": 1.365e7}      # [J/m] at 0.6 s; no MLS there
SHOWN = 100


def rings(dx, transfer):
    """The two rings, with 2 x 2 particles per cell."""
    bodies = tuple(ring(name, x, v) for name, x, v in (("left", -5.0, 30.0), ("right", 5.0, -30.0)))
    return Scene(dim=2, dx=dx, cfl=0.5, end=0.6, body=bodies, scheme=Scheme(transfer=transfer))


def ring(name, x, v):
    """One ring about (x, 0) that moves along x."""
    return Body(name=name, density=1000.0, sampling=Regular(per_cell=2),
                shape=Torus(center=(x, 0.0), major=3.5, minor=0.5),
                velocity=Velocity(linear=(v, 0.0)),
                material=Material(law="log_neo_hookean", E=1e8, nu=0.2))


@experiment("verification.rings", title="Colliding rings: energy kept by each transfer",
            profiles=("quick", "standard"), budget={"quick": 6, "standard": 200})
def ring_collision(run):
    """Energy at 0.6 s for each transfer, and their order."""
    dx = run.choose(quick=0.4, standard=0.1)
    rows, kept = [], {}
    for transfer in run.progress(TRANSFERS, "transfers"):
        c = collision_history(rings(dx, transfer))
        kept[transfer] = float(c.total[-1] / c.total[0])
        run.record(f"verification.rings.{transfer}.energy", float(c.total[-1]), unit="J/m",
                   paper=PUBLISHED.get(transfer), comparator="info",
                   scale=f"dx = {dx} m, theirs 0.1 m, {c.particles} particles, {c.steps} steps",
                   note=f"of {c.total[0]:.4g} J/m at the start; the other number is what the "
                   "tests of Tesserae.jl hold for randomly placed particles")
        rows += thinned(transfer, c, SHOWN)
    run.table("energy", ("transfer", "t", "kinetic", "elastic"), rows)
    record_ranking(run, kept, dx)


def record_ranking(run, kept, dx):
    """How many of the neighbours in the public code's order PIC < APIC < FLIP are so here."""
    ours = sorted(kept, key=kept.get)
    published = sorted(PUBLISHED, key=PUBLISHED.get)
    pairs = list(pairwise(published))
    agree = sum(kept[a] < kept[b] for a, b in pairs)
    run.record("verification.rings.ranking", agree, paper=len(pairs), comparator="info",
               scale=f"dx = {dx} m, theirs 0.1 m",
               note=f"pairs of neighbours in the order {' < '.join(published)} of that code that "
               f"hold here; ours: {' < '.join(ours)}")
