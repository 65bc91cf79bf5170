"""Steps in single precision: near those in double, of half the memory, with the same invariants."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numba import types
from problems import DT, DX, JELLY, METAL, ball, digest, moving, run_python, stepped, two_disks
from threads import by_threads
from variants import slow_but

from mpm_ref.adjoint import StepAdjoint
from mpm_ref.body import Body, in_precision, particles_at
from mpm_ref.body_contact import BodyContact, check_contacts
from mpm_ref.core.boundary import Collider, Conditions
from mpm_ref.core.grid import OutOfRange
from mpm_ref.core.jit import kernel
from mpm_ref.core.solids import half_space
from mpm_ref.core.surface import SurfaceConditions
from mpm_ref.energy import angular_momentum, momentum
from mpm_ref.explicit import Scheme, Stepper
from mpm_ref.hot.step import ImplicitStepper
from mpm_ref.materials import NoFlow, make_flow
from mpm_ref.monitor import account
from mpm_ref.problem import Clock, Problem
from mpm_ref.simulate import simulate
from mpm_ref.store.checkpoint import digest as digest_of_state
from mpm_ref.store.running import Options, run
from mpm_ref.timestep import stable_dt

EPS = float(np.finfo(np.float32).eps)
STEPS = 20
FLOOR = Collider(half_space((0.0, 0.04), (0.0, 1.0)), "separate", 0.3)

SCHEMES = {
    "mls": Scheme(),
    "mls cubic": Scheme(3),
    "rpic": Scheme(2, "mls", rpic=0.2),
    "relaxed mls": Scheme(2, "mls", relaxation=2.0 * DT),
    "relaxed apic": Scheme(3, "apic", relaxation=2.0 * DT),
    "apic": Scheme(2, "apic"),
    "flip": Scheme(2, "flip", flip=0.95),
    "linear": Scheme(1, "flip", flip=0.95),
    "pic": Scheme(3, "pic"),
    "gimp": Scheme(2, "flip", flip=0.95, gimp=2.0),
    "f_bar": Scheme(f_bar=True),
}


def single(problem):
    """The problem in single precision."""
    bodies = tuple(body._replace(particles=in_precision(body.particles, np.float32))
                   for body in problem.bodies)
    return replace(problem, bodies=bodies, scheme=replace(problem.scheme, precision="single"))


def two_balls(scheme, d, *materials):
    """Two bodies of d dimensions, of (law, flow) each, that meet above a floor."""
    up = (0.0,) * (d - 2)
    low = ball("low", (0.31, 0.16, *up), *materials[0], transfer=scheme.transfer)
    high = ball("high", (0.33, 0.4, *up), *materials[-1], transfer=scheme.transfer)
    normal = (0.0, 1.0, *up)
    floor = Collider(half_space((0.0, 0.04, *up), normal), "separate", 0.3)
    bodies = moving(low, (0.1, -1.0, *up), 3.0), moving(high, (0.2, -3.0, *up))
    return Problem(bodies, DX, Clock(dt=DT, steps=STEPS), np.array((0.0, -9.8, *up)), scheme,
                   Conditions((floor,)))


def differences(problem):
    """Largest differences of x [dx], v and F between steps in single and in double precision."""
    exact = stepped(replace(problem, bodies=copied(problem.bodies)), STEPS, sort_every=8)
    rounded = stepped(single(problem), STEPS, sort_every=8)
    largest = {}
    for name, unit in (("x", DX), ("v", 3.0), ("F", 1.0)):
        pairs = [(getattr(a.particles, name)[np.argsort(a.id)],
                  getattr(b.particles, name)[np.argsort(b.id)]) for a, b in zip(exact, rounded)]
        assert all(b.dtype == np.float32 for _, b in pairs)
        largest[name] = max(float(abs(a - b).max()) for a, b in pairs) / unit
    return largest


def copied(bodies):
    """Bodies with arrays of their own."""
    copies = []
    for body in bodies:
        q = body.particles
        shared, q = q.L is q.C, type(q)(*(a.copy() for a in q))
        copies.append(body._replace(particles=q._replace(L=q.C) if shared else q,
                                    id=body.id.copy()))
    return tuple(copies)


# near double

@pytest.mark.parametrize("name", slow_but(SCHEMES, "mls", "relaxed apic", "flip"))
def test_steps_in_single_are_near_those_in_double(name):
    """Within 100 roundings a step: sums over a stencil have up to 16 terms in 2D, x is 8 dx wide.
    Not within one, as steps in double would be.
    """
    off = differences(two_disks(SCHEMES[name]))
    assert max(off.values()) < 100 * STEPS * EPS
    assert min(off.values()) > EPS


TENTH = 0.1


@kernel
def shifted(x):
    return TENTH * x[0] + (0.5, x[1])[0]


def test_constants_have_the_precision_of_the_arguments():
    """Literals, constants and items of tuples; where one argument is double, all is double."""
    one, other = np.float32(3.0), np.float32(4.0)
    for x, real in (((one, other), types.float32), ((3.0, 4.0), types.float64),
                    ((one, 4.0), types.float64)):
        shifted(x)
        assert shifted._entry.nopython_signatures[-1].return_type == real
    assert shifted((one, other)) == np.float32(TENTH) * one + np.float32(0.5)


MATERIALS = {
    "elastic": ((JELLY, NoFlow()),),
    "hencky": ((METAL, NoFlow()),),
    "sand": ((METAL, make_flow("drucker_prager", METAL, 3, friction_angle=30.0)),),
    "metal": ((METAL, make_flow("von_mises", METAL, 3, tau_y=50.0)),),
}


@pytest.mark.parametrize("transfer", slow_but(["mls", "apic"], "mls"))
@pytest.mark.parametrize("name", MATERIALS)
def test_steps_in_single_are_near_those_in_double_in_3d(name, transfer):
    off = differences(two_balls(Scheme(2, transfer), 3, *MATERIALS[name]))
    assert max(off.values()) < 100 * STEPS * EPS


def test_surface_conditions_in_single_are_near_those_in_double():
    problem = two_disks(conditions=SurfaceConditions((FLOOR,)))
    assert max(differences(problem).values()) < 100 * STEPS * EPS


# memory

def test_particles_and_nodes_take_half_the_memory():
    sizes = []
    for problem in (two_disks(), single(two_disks())):
        stepper = Stepper(problem.scheme, DX, 2, problem.gravity)
        stepper.start(problem.bodies)
        grid = stepper.step(problem.bodies, 0.0, DT)
        sizes.append((sum(a.nbytes for b in problem.bodies for a in b.particles),
                      grid.m.nbytes + grid.v.nbytes))
    assert sizes[0] == tuple(2 * size for size in sizes[1])


# invariants

@pytest.mark.parametrize("d", [2, 3])
def test_momenta_are_conserved_to_rounding(d):
    scheme = Scheme(2, "apic")
    problem = replace(single(two_balls(scheme, d, (JELLY, NoFlow()))),
                      gravity=np.zeros(d), conditions=None)
    inertia, m = problem.inertia, sum(float(b.particles.m.sum()) for b in problem.bodies)
    before = momentum(problem.bodies), angular_momentum(problem.bodies, inertia)
    bodies = stepped(problem, STEPS)
    assert abs(momentum(bodies) - before[0]).max() < 10 * STEPS * EPS * m * 3.0
    assert abs(angular_momentum(bodies, inertia) - before[1]).max() < 10 * STEPS * EPS * m * 3.0


def test_one_and_two_threads_give_the_same_bits():
    def run():
        return digest(stepped(single(two_disks()), STEPS, sort_every=8))
    here = run()
    assert by_threads(run) == [here, here]


def test_a_resumed_run_has_the_bits_of_the_run(tmp_path):
    def problem():
        return replace(single(two_disks()), clock=Clock(dt=DT, steps=60, every=20))
    *_, last = simulate(problem())
    for steps in (17, None):
        end = run(problem(), tmp_path / "run.h5", Options(steps=steps, resume=True))
    assert digest_of_state(end.state) == digest_of_state(last.state)
    assert all(a.dtype != np.float64 for body in end.state.bodies for a in body.particles)


def test_at_rest_far_away_rounded_heights_are_no_gain_of_energy():
    """m g . x is rounded to single, by more than what the run's account otherwise allows."""
    problem = single(two_disks(gravity=(0.0, -9.8)))
    for body in problem.bodies:
        body.particles.x[:, 1] += 2.0**16 * DX
        body.particles.v[:] = 0.0
    problem = replace(problem, conditions=Conditions())
    double = replace(problem, scheme=Scheme())
    heights = sum(float((b.particles.m * 9.8 * b.particles.x[:, 1]).sum()) for b in problem.bodies)
    noise = [account(one, problem.bodies).noise for one in (problem, double)]
    assert noise[0] - noise[1] == pytest.approx(EPS * heights, rel=1e-3)


COMPILED = """
import gc, json
from numba import types
from mpm_ref.core.jit import Kernel
from mpm_ref.core.precision import is_single, scalars
from tests.stepping.test_precision import SCHEMES, single, stepped, two_disks
stepped(single(two_disks(SCHEMES["{name}"])), 2)
doubles = set()
for one in gc.get_objects():
    if isinstance(one, Kernel):
        for overload in one.linked.overloads.values():
            kinds = overload.type_annotation.typemap.values()
            if is_single(overload.signature.args) and any(
                    kind == types.float64 for k in kinds for kind in scalars(k)):
                doubles.add(one.py_func.__module__ + "." + one.py_func.__name__)
print(json.dumps(sorted(doubles)))
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mls", "relaxed apic", "flip", "gimp"])
def test_kernels_of_single_arguments_have_no_double(name, tmp_path):
    """But for base nodes and singular values."""
    found = run_python(COMPILED.format(name=name), NUMBA_CACHE_DIR=str(tmp_path))
    assert found == ["mpm_ref.core.spectral.svd", "mpm_ref.core.spline.base_of",
                     "mpm_ref.core.tensor.doubles"]


def test_the_stencil_of_gimp_has_the_precision_of_the_scheme():
    stencil = Scheme(transfer="pic", gimp=1.5, precision="single").stencil
    assert {type(f) for f in stencil} == {np.float32}


# what does not fit

def test_far_from_the_origin_single_precision_is_refused():
    """Beyond 2^21 cells, where a coordinate is no more exact than a quarter of one."""
    for cells, far in ((2.0**20, False), (2.0**22, True)):
        problem = two_disks(Scheme(), conditions=Conditions())
        for body in problem.bodies:
            body.particles.x[:] += cells * DX
        stepped(problem, 1)
        if far:
            with pytest.raises(OutOfRange, match="at most 2e\\+06 times dx"):
                stepped(single(problem), 1)
        else:
            stepped(single(problem), 1)


@pytest.mark.parametrize(("name", "value"), [("m", 1e-50), ("V0", 1e-46), ("v", 1e39)])
def test_numbers_out_of_the_range_of_single_precision_are_refused(name, value):
    particles = two_disks().bodies[0].particles
    getattr(particles, name)[3] = value
    with pytest.raises(ValueError, match=re.escape(f"number {value:.3g} in the array {name} ")):
        in_precision(particles, np.float32)


def test_contact_of_bodies_refuses_single_precision():
    with pytest.raises(ValueError, match="'single': expected 'double', which the gap"):
        check_contacts((BodyContact(("a", "b")),), ["a", "b"], Scheme(precision="single"))


def test_single_particle_bounds_are_those_of_double():
    """Also with linear splines, whose bound reads the masses of nodes."""
    for scheme in (Scheme(1, "flip"), Scheme(2, "apic")):
        problem = two_disks(scheme)
        bounds = []
        for one in (problem, single(problem)):
            stepper = Stepper(one.scheme, DX, 2, one.gravity)
            stepper.start(one.bodies)
            bounds.append(stable_dt(one.bodies, stepper))
        assert bounds[1] == pytest.approx(bounds[0], rel=1e-4)


def test_single_particle_bounds_read_the_nodes_of_the_rounded_spacing():
    """A particle at a node of dx in single, and just before that of dx in double. Linear splines: S
    is (1/w_0 + 1/w_1)/dx^2 = 4/dx^2 between two nodes that the particle has to itself.
    """
    dx, scheme = np.float32(DX), Scheme(1, "pic", precision="single")
    x = next(x for k in range(8, 4000)
             if (x := np.float32(k * DX)) / dx >= k > float(x) / DX)
    q = particles_at(np.array([[x, 5.5 * DX]]), np.zeros((1, 2)), np.ones(1), np.ones(1), "pic")
    body = Body("one", in_precision(q, np.float32), JELLY, NoFlow(), np.arange(1))
    stepper = Stepper(scheme, DX, 2, np.zeros(2))
    stepper.start([body])
    S = 4.0 / DX**2
    K = 2.0 * JELLY.mu + 2.0 * JELLY.lam
    bound = stable_dt([body], stepper).single_particle
    assert bound == pytest.approx((2.0 / (K * S))**0.5, rel=1e-3)


def test_arrays_of_the_other_precision_are_refused():
    problem = two_disks(Scheme(precision="single"))
    with pytest.raises(ValueError, match="x is of type float64, expected float32 with precision"):
        stepped(problem, 1)
    problem = single(two_disks())
    with pytest.raises(ValueError, match="x is of type float32, expected float64"):
        stepped(replace(problem, scheme=Scheme()), 1)


def test_an_unknown_precision_is_refused():
    with pytest.raises(ValueError, match="precision = 'half': expected one of double, single"):
        Scheme(precision="half")


def test_implicit_steps_and_adjoints_refuse_single_precision():
    scheme = Scheme(2, "apic", precision="single")
    with pytest.raises(ValueError, match="'single' with an implicit integrator: expected 'double'"):
        ImplicitStepper(scheme, DX, 2, np.zeros(2))
    with pytest.raises(ValueError, match="the adjoint computes in double alone"):
        StepAdjoint(Stepper(replace(scheme, transfer="mls"), DX, 2, np.zeros(2)))
