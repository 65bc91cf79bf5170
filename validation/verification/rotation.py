"""A free elastic body spins: which transfers keep angular momentum, and that none gains energy."""

from math import pi
from typing import NamedTuple

import numpy as np

from mpm_ref.energy import angular_momentum, energy
from mpm_ref.scene import Body, Box, Material, Regular, Scene, Scheme, Sphere, Velocity, build
from mpm_ref.scene.crossing import crossing_time
from mpm_ref.simulate import simulate

from ..common.registry import experiment
from ..common.scenes import evenly, threads_for, with_
from .symplectic import allowed_gain

RADIUS, DX, SPIN = 0.5, 0.1, 1.0        # [m], [m], [rad/s]
ROUND_OFF = 1e-12                       # of L in a step: sums of some 1e3 terms of 1e-16 each
SHOWN = 100                             # rows of a table per transfer
AXIS = np.array([1.0, 2.0, 2.0]) / 3.0  # of the cube: along no edge or diagonal of the grid
MATERIAL = Material(law="fixed_corotated", E=1e4, nu=0.3)


class SpinHistory(NamedTuple):
    """Measurements after each of S steps."""

    t: np.ndarray           # (S,)     [s]
    L: np.ndarray           # (S, ..)  angular momentum, spin of the affine field included
    kinetic: np.ndarray     # (S,)     [J], affine motion included
    elastic: np.ndarray     # (S,)     [J]


def disk(transfer, revolutions):
    """Return the scene of a 2D disk of 3 x 3 particles per cell, anywhere in the grid."""
    body = Body(name="disk", density=1000.0, material=MATERIAL, sampling=Regular(per_cell=3),
                shape=Sphere(center=(0.03, 0.02), radius=RADIUS), velocity=Velocity(angular=SPIN))
    return spinning(body, 2, transfer, revolutions)


def cube(transfer, revolutions):
    """Return the scene of a cube of 2 x 2 x 2 particles per cell with an oblique axis of spin."""
    low, high = (0.03 - RADIUS,) * 3, (0.03 + RADIUS,) * 3
    body = Body(name="cube", density=1000.0, material=MATERIAL, sampling=Regular(per_cell=2),
                shape=Box(lower=low, upper=high), velocity=Velocity(angular=tuple(SPIN * AXIS)))
    return spinning(body, 3, transfer, revolutions)


def spinning(body, dim, transfer, revolutions):
    """Return the scene of one body in free space."""
    return Scene(dim=dim, dx=DX, cfl=0.4, end=revolutions * 2.0 * pi / SPIN, every=1, body=(body,),
                 scheme=Scheme(transfer=transfer))


def spin_matrix(dim):
    """Return W with W x = angular velocity cross x."""
    if dim == 2:
        return SPIN * np.array([[0.0, -1.0], [1.0, 0.0]])
    x, y, z = SPIN * AXIS
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def spin_history(scene, crossings=0.0):
    """Return the `SpinHistory` of a scene; an affine field starts as that of the rotation.

    crossings: relaxation of the transfer, in times in which a wave crosses a cell.
    """
    scheme = with_(scene.scheme, relaxation=crossings * crossing_time(scene))
    problem, rows = build(with_(scene, scheme=scheme)), []
    if problem.scheme.affine:
        problem.bodies[0].particles.C[:] = spin_matrix(scene.dim)
    with threads_for(problem.bodies):
        for frame in simulate(problem):
            L = angular_momentum(frame.state.bodies, problem.inertia)
            E = energy(frame.state.bodies, problem.gravity, problem.inertia)
            rows.append((frame.t, L, E.kinetic, E.elastic))
    return SpinHistory(*map(np.array, zip(*rows, strict=True)))


def loss_per_step(L):
    """Return the largest change of angular momentum in a step over its size at the start."""
    return float(np.max(np.linalg.norm(np.diff(L, axis=0), axis=1)) / np.linalg.norm(L[0]))


def pic_loss():
    """Return the share of L that PIC drops in its first step.

    It is 2 D m spin of m R^2/2 spin, D = dx^2/4.
    """
    return DX**2 / RADIUS**2


@experiment("verification.rotation", title="A free body spins: angular momentum and energy",
            profiles=("quick", "standard"), budget={"quick": 8, "standard": 120})
def rotation(run):
    """Record L per step and the energy of a disk (and a cube) with each transfer.

    The energy may grow no more than symplectic Euler allows.
    """
    revolutions = run.choose(quick=1, standard=10)
    bodies = run.choose(quick=(disk,), standard=(disk, cube))
    rows = []
    for make in bodies:
        for transfer in run.progress(("mls", "apic", "flip", "pic"), make.__name__):
            turns = revolutions if make is disk else 1
            h = spin_history(make(transfer, turns))
            record_spin(run, make.__name__, transfer, h)
            rows += history_rows(make.__name__, transfer, h)
    run.table("history", ("body", "transfer", "turns", "L", "energy"), rows)


def record_spin(run, body, transfer, h):
    """Record the numbers of one body and transfer."""
    name, total = f"verification.rotation.{body}.{transfer}", h.kinetic + h.elastic
    scale = f"{len(h.t) - 1} steps, {h.t[-1] * SPIN / (2.0 * pi):.3g} revolutions, dx = R/5"
    lost = loss_per_step(h.L)
    if transfer in ("mls", "apic"):
        run.record(f"{name}.angular_momentum_per_step", lost, comparator="<=", bound=ROUND_OFF,
                   paper=0.0, scale=scale, note="exact but for round-off [Jiang2017]")
    elif transfer == "pic" and body == "disk":
        run.record(f"{name}.angular_momentum_per_step", lost, comparator="~", paper=pic_loss(),
                   factor=1.5, scale=scale, note="negative control: PIC drops the spin of each "
                   "particle's surroundings, dx^2/R^2 of L per step for quadratic splines; two "
                   "fifths of the particles are less than a cell from the rim, where it is less")
    else:
        run.record(f"{name}.angular_momentum_per_step", lost, comparator="info", scale=scale)
    run.record(f"{name}.energy_gain", float(np.max(total) / total[0] - 1.0), comparator="<=",
               bound=allowed_gain(h.elastic) / total[0] + ROUND_OFF, scale=scale,
               note="bound: half the largest change of elastic energy in a step, by which "
               "symplectic Euler's energy swings")
    run.record(f"{name}.energy_kept", float(total[-1] / total[0]), comparator="info", scale=scale)


def history_rows(body, transfer, h):
    """Return SHOWN rows of the history."""
    total, size = h.kinetic + h.elastic, np.linalg.norm(h.L, axis=1)
    return [(body, transfer, h.t[k] * SPIN / (2.0 * pi), size[k] / size[0], total[k] / total[0])
            for k in evenly(len(h.t), SHOWN)]
