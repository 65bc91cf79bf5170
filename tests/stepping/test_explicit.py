from dataclasses import replace

import numpy as np
import pytest
from problems import DT, DX, FREE, JELLY, ball, moving, stepped, two_disks

from mpm_ref.core.boundary import BoxWalls, Collider, Conditions, Prescribed
from mpm_ref.core.motion import Motion, Steady
from mpm_ref.core.solids import half_space, sphere
from mpm_ref.energy import angular_momentum, energy, momentum
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.materials import NoFlow, make_law
from mpm_ref.oracle.kernel_stages import node_contacts
from mpm_ref.oracle.plain_twin import Twin
from mpm_ref.oracle.recording import copy_problem

STEPS = 10


def against_twin(problem, steps=STEPS):
    """Largest relative difference of x, v, F, tau from the plain twin in extended precision."""
    twin = Twin(problem)
    stepper = Stepper(problem.scheme, problem.dx, problem.dim, problem.gravity, problem.conditions)
    stepper.start(problem.bodies)
    touched = 0
    for k in range(steps):
        grid = stepper.step(problem.bodies, k * DT, DT)
        contacts = node_contacts(problem.conditions, grid, (k + 1) * DT, DT)
        touched += len(contacts)
        twin.step(DT, np.argwhere(grid.m > 0) + grid.origin, contacts)
    off = {}
    for body, matter in zip(problem.bodies, twin.bodies):
        for name in ("x", "v", "F", "tau"):
            a, b = getattr(body.particles, name), getattr(matter, name)
            off[body.name, name] = float(abs(a - b).max() / abs(b).max())
    return max(off.values()), touched


SCHEMES = {
    "mls": Scheme(),
    "regularised": Scheme(mass_eps=1e-3, gravity_on_empty=True),
    "rpic": Scheme(2, "mls", rpic=0.2),
    "relaxed mls": Scheme(2, "mls", relaxation=2.0 * DT),
    "relaxed apic": Scheme(3, "apic", relaxation=2.0 * DT),
    "f_bar": Scheme(f_bar=True),
    "f_bar apic": Scheme(3, "apic", f_bar=True),
    "gimp": Scheme(transfer="flip", gimp=2.0),
    "f_bar gimp": Scheme(transfer="pic", gimp=3.0, f_bar=True),
}


@pytest.mark.parametrize("name", SCHEMES)
def test_steps_equal_the_twin(name):
    """Elastic and hardening bodies, floor with friction and an oblique slip wall, ten steps.

    The stages in the order of NCLAW-alg1, by explicit Euler (NCLAW-eq11, LDM-sec2.2-Frate).
    """
    off, touched = against_twin(two_disks(SCHEMES[name]))
    assert touched > 5 * STEPS
    assert off < 2e-13


CONDITIONS = {
    "container": Conditions(colliders=(
        Collider(sphere((0.3, 0.25), 0.27), "separate", 0.2, inside=True),
        Collider(half_space((0.0, 0.04), (0.0, 1.0)), "noslip"))),
    "walls": Conditions(walls=BoxWalls((5, 2), (8, 10), "separate", 0.1)),
    "moving": Conditions(
        colliders=(Collider(half_space((0.0, 0.05), (0.3, 1.0)), "slip", 0.4,
                            Motion(translation=Steady((0.5, 0.3)), rotation=Steady(2.0))),
                   Collider(half_space((0.25, 0.0), (1.0, 0.0)), "sticky")),
        prescribed=(Prescribed(sphere((0.33, 0.36), 0.06), Motion(translation=Steady((0.2, 0.1)))),
                    )),
}


@pytest.mark.parametrize("name", CONDITIONS)
def test_conditions_equal_the_twin(name):
    off, touched = against_twin(two_disks(conditions=CONDITIONS[name]))
    assert touched > 8 * STEPS
    assert off < 2e-13


def test_a_fluid_with_averaged_volumes_equals_the_twin():
    """A body that carries J alone, splashing on an oblique wall."""
    problem = two_disks(Scheme(2, "flip", f_bar=True))
    disk = problem.bodies[0]
    n, law = len(disk.id), make_law("fluid", lam=6e4)
    q = disk.particles._replace(F=np.linspace(0.98, 1.01, n), tau=np.zeros(n))
    problem = replace(problem, bodies=(disk._replace(particles=q, law=law), problem.bodies[1]))
    off, _ = against_twin(problem)
    assert off < 2e-13


@pytest.mark.parametrize("name", ["mls", "relaxed mls", "relaxed apic", "f_bar"])
def test_momentum_is_conserved_without_conditions(name):
    """Two bodies collide: linear and angular momentum to round-off, energy never gained."""
    problem = two_disks(SCHEMES[name], conditions=FREE, gravity=(0.0, 0.0))
    bodies, D = problem.bodies, problem.inertia
    p, L = momentum(bodies), angular_momentum(bodies, D)
    E = energy(bodies, problem.gravity, D).sum
    size = sum(abs(b.particles.m[:, None] * b.particles.v).sum() for b in bodies)
    stepped(problem, 50)
    after = energy(bodies, problem.gravity, D)
    assert after.elastic > 0.01 * E             # they did collide
    assert abs(momentum(bodies) - p).max() <= 1e-14 * size
    assert abs(angular_momentum(bodies, D) - L).max() <= 1e-14 * size
    assert after.sum <= E * (1 + 1e-12)


def test_momentum_is_conserved_by_gimp():
    """The linear one to round-off; FLIP moves particles by other velocities than their own."""
    problem = two_disks(SCHEMES["gimp"], conditions=FREE, gravity=(0.0, 0.0))
    p, E = momentum(problem.bodies), energy(problem.bodies, problem.gravity, 0.0).sum
    size = sum(abs(b.particles.m[:, None] * b.particles.v).sum() for b in problem.bodies)
    stepped(problem, 50)
    assert energy(problem.bodies, problem.gravity, 0.0).elastic > 0.01 * E
    assert abs(momentum(problem.bodies) - p).max() <= 1e-14 * size


FALLS = {"pic": Scheme(1, "pic"), "flip": Scheme(3, "flip"), "apic": Scheme(2, "apic"),
         "mls": Scheme(2, "mls"), "gimp": Scheme(2, "flip", gimp=2.0)}


@pytest.mark.parametrize("transfer", FALLS)
def test_free_fall(transfer):
    """x = x_0 + v_0 t + g dt^2 n (n + 1)/2, to round-off, whatever the transfer."""
    scheme, d = FALLS[transfer], 3 if transfer == "mls" else 2
    body = ball("stone", (0.11, 0.22, 0.33)[:d], JELLY, NoFlow(), transfer=scheme.transfer,
                radius=1.3)
    g, v = np.array([0.5, -9.8, 1.0])[:d], np.array([1.0, 2.0, -3.0])[:d]
    q = moving(body, v).particles
    if transfer == "pic":                       # as a body force instead of gravity
        q = q._replace(b=np.tile(g, (len(q.x), 1)))
        body = body._replace(particles=q)
    x = q.x.copy()
    stepper = Stepper(scheme, DX, d, 0.0 * g if transfer == "pic" else g)
    stepper.start([body])
    for k in range(STEPS):
        stepper.step([body], k * DT, DT)
    t = STEPS * DT
    assert abs(q.v - (v + t * g)).max() <= 1e-13
    assert abs(q.x - (x + t * v + DT**2 * STEPS * (STEPS + 1) / 2 * g)).max() <= 1e-15
    assert abs(q.F - np.eye(d)).max() <= 1e-13


def test_sorting_changes_nothing_but_the_order():
    plain, sorted_ = stepped(two_disks(), 20), stepped(two_disks(), 20, sort_every=5)
    for a, b in zip(plain, sorted_):
        assert not np.array_equal(a.id, b.id)
        back = np.argsort(b.id)
        assert abs(a.particles.x - b.particles.x[back]).max() < 1e-14
        assert abs(a.particles.F - b.particles.F[back]).max() < 1e-12
        assert b.particles.L is b.particles.C


def test_the_first_stress_belongs_to_the_first_deformation():
    """`start` computes tau of F; without it a stretched body would feel no force in step one."""
    problem = two_disks(conditions=FREE, gravity=(0.0, 0.0))
    for body in problem.bodies:
        body.particles.F[:] *= 1.01
        body.particles.v[:] = 0.0
    off, _ = against_twin(problem, steps=1)
    assert off < 1e-13
    assert abs(problem.bodies[0].particles.v).max() > 0.0


def test_particles_do_not_move_with_copy_problem():
    """Copies share nothing with the problem, and keep L and C one array."""
    problem = two_disks()
    copy = copy_problem(problem, -1)
    for body, other in zip(problem.bodies, copy.bodies):
        assert other.particles.L is other.particles.C
        assert not any(np.shares_memory(a, b) for a, b in zip(body.particles, other.particles))
        assert np.array_equal(other.particles.x, body.particles.x[::-1])


@pytest.mark.parametrize(("wrong", "said"), [
    ({"transfer": "cpdi"}, "expected one of pic, flip, apic, mls"),
    ({"degree": 4}, "expected 1, 2 or 3"),
    ({"degree": 1}, "is singular"),
    ({"flip": 1.5}, r"flip = 1.5: expected a number in \[0, 1\]"),
    ({"rpic": -0.1}, "rpic"),
    ({"rpic": 0.1, "transfer": "pic"}, "damps the affine field"),
    ({"mass_eps": -1.0}, "mass >= 0"),
    ({"mass_eps": float("nan")}, "mass >= 0"),
    ({"mass_eps": 1e-7, "transfer": "flip"}, "pic, apic or mls"),
    ({"relaxation": -1.0}, "relaxation = -1.0: expected a time >= 0 in s"),
    ({"relaxation": float("inf")}, "expected a time >= 0 in s"),
    ({"relaxation": 1e-3, "transfer": "flip"}, "FLIP has its share"),
    ({"relaxation": 1e-3, "rpic": 0.1}, "with rpic = 0.1: these two have no common step"),
    ({"relaxation": 1e-3, "mass_eps": 1e-7}, "with mass_eps = 1e-07"),
    ({"gimp": 0.5, "transfer": "pic"}, "gimp = 0.5: expected the number of particles per cell"),
    ({"gimp": float("nan"), "transfer": "pic"}, "from 1 to 100, or 0"),
    ({"gimp": 2.0, "transfer": "pic", "degree": 1}, "with degree = 1: it averages linear splines"),
    ({"gimp": 2.0}, "gimp = 2.0 with transfer 'mls': the moment .* take the transfer 'pic' or"),
    ({"gimp": 2.0, "transfer": "apic"}, "varies with the place in a cell"),
])
def test_schemes_that_do_not_exist_are_refused(wrong, said):
    with pytest.raises(ValueError, match=said):
        Scheme(**wrong)
