"""Transfer kernels against their plain twins, and what they must conserve and reproduce."""

from types import SimpleNamespace

import numpy as np
import pytest
from clouds import AFFINE, COVER, DX, SHARE, Case, cloud, deep, over, plain_grid, scattered

from mpm_ref.core.grid import update
from mpm_ref.core.transfer import g2p, rpic
from mpm_ref.energy import angular_momentum, momentum
from mpm_ref.plain import transfer as plain
from mpm_ref.plain.step import grid_to_particles

DT = 0.03
ROUND_OFF = 5e-15       # relative to the largest entry; sums of a few hundred terms


@pytest.fixture(params=COVER, ids=lambda case: case.name, scope="module")
def trip(request):
    """One scatter, grid update and gather of random particles: by the kernels and by the twin."""
    case = request.param
    q = cloud(case, np.random.default_rng(1))
    g = np.arange(1.0, 1.0 + case.d)
    matter, ip, nodes = plain_grid(case, q, DT, g)
    grid = scattered(case, q, DT)
    before = SimpleNamespace(q=deep(q), m=grid.m.copy(), mv=grid.v.copy(), f=grid.f.copy())
    update(grid, g, DT)
    after = deep(q)
    gather(case, after, grid)
    return SimpleNamespace(case=case, before=before, grid=grid, after=after, nodes=nodes,
                           motion=grid_to_particles(matter, ip, nodes, case.method, DT))


def gather(case, q, grid, flip=SHARE):
    g2p(q, grid, case.stencil, DT, flip, case.transfer == "mls")


def close(a, b, tol=ROUND_OFF):
    return abs(a - b).max() <= tol * abs(b).max()


def test_scatter_equals_its_twin(trip):
    """NSF-alg-mpm with NSF-eq6 (apic), LDM-alg1 and NCLAW-alg3 (pic), NCLAW-mls (mls)."""
    nodes, before = trip.nodes, trip.before
    assert close(before.m, over(trip.grid, nodes.m, nodes.box))
    if trip.case.separate:
        assert close(before.mv, over(trip.grid, nodes.mv, nodes.box))
        assert close(before.f, over(trip.grid, nodes.f, nodes.box))
    else:
        assert close(before.mv, over(trip.grid, nodes.mv + DT * nodes.f, nodes.box))


def test_grid_update_equals_its_twin(trip):
    v, m = over(trip.grid, trip.nodes.v, trip.nodes.box), trip.grid.m[..., None]
    assert close(m * trip.grid.v, m * v)


def test_gather_equals_its_twin(trip):
    assert close(trip.after.v, trip.motion.v)
    assert close(trip.after.x, trip.motion.x)
    assert close(trip.after.L, trip.motion.L)
    if trip.case.transfer in AFFINE:
        assert close(trip.after.C, trip.motion.C)


def body(q):
    return SimpleNamespace(particles=q)


def test_scatter_conserves_mass_and_momentum(trip):
    """The lumped masses add up (LDM-eq8, LDM-eq10)."""
    q, before = trip.before.q, trip.before
    assert before.m.sum() == pytest.approx(q.m.sum(), rel=1e-14)
    mv = before.mv.reshape(-1, trip.case.d).sum(axis=0)
    expected = momentum([body(q)])
    if trip.case.body_force and not trip.case.separate:            # forces are separate there
        expected += DT * q.m @ q.b
    assert mv == pytest.approx(expected, abs=1e-13 * (q.m @ abs(q.v)).max())


def test_forces_add_up_to_the_body_forces(trip):
    """The internal ones add up to nothing, since the dw_ip do (NCLAW-eq10)."""
    case, q, f = trip.case, trip.before.q, trip.before.f
    if case.separate:
        expected = q.m @ q.b if case.body_force else 0.0
        assert abs(f.reshape(-1, case.d).sum(axis=0) - expected).max() <= 1e-13 * abs(f).sum()


def about_origin(pairs, r, q):
    return np.array([(r[..., a] * q[..., b] - r[..., b] * q[..., a]).sum() for a, b in pairs])


def on_grid(grid, mv):
    """Angular momentum of momenta mv on the nodes."""
    d = mv.shape[-1]
    r = DX * (np.moveaxis(np.indices(grid.m.shape), 0, -1) + grid.origin)
    return about_origin([(0, 1)] if d == 2 else [(1, 2), (2, 0), (0, 1)], r, mv)


@pytest.fixture
def spin(trip):
    """Angular momentum before P2G, on the grid, and after G2P at the old positions, without forces.

    The positions must be the old ones: the grid hands momentum over where the particles were.
    """
    case, q = trip.case, deep(trip.before.q)
    q.tau[:] = 0.0
    if case.body_force:
        q.b[:] = 0.0
    D = case.moment if case.transfer in AFFINE else 0.0
    first = angular_momentum([body(q)], D)
    grid = scattered(case, q, DT)
    middle = on_grid(grid, grid.v)
    update(grid, np.zeros(case.d), DT)
    x = q.x.copy()
    gather(case, q, grid, flip=0.0)
    q.x[:] = x
    scale = (q.m * np.linalg.norm(q.v, axis=1) * np.linalg.norm(q.x, axis=1)).sum()
    return case, scale, first, middle, angular_momentum([body(q)], D)


def test_affine_transfers_conserve_angular_momentum(spin):
    case, scale, first, middle, last = spin
    if case.transfer in AFFINE:
        assert abs(middle - first).max() <= 1e-13 * scale
        assert abs(last - middle).max() <= 1e-13 * scale


def test_pic_loses_angular_momentum(spin):
    """The negative control of the test above."""
    case, scale, first, middle, last = spin
    if case.transfer not in AFFINE:
        assert abs(middle - first).max() <= 1e-13 * scale
        assert abs(last - middle).max() > 1e-3 * scale


RELAXED = [case for case in COVER if case.relaxed]


@pytest.fixture(params=RELAXED, ids=lambda case: case.name)
def free(request):
    """A relaxed case, its particles without forces, and the grid that they are on."""
    case = request.param
    q = cloud(case, np.random.default_rng(5))
    q.tau[:] = 0.0
    if case.body_force:
        q.b[:] = 0.0
    grid = scattered(case, q, DT)
    update(grid, np.zeros(case.d), DT)
    return case, q, grid


@pytest.mark.parametrize("share", [0.0, SHARE, 1.0])
def test_relaxation_conserves_momenta_while_particles_move(free, share):
    """Linear and angular momentum at the new positions, of particles whose velocities differ from
    those that move them."""
    case, q, grid = free
    before = momentum([body(q)]), angular_momentum([body(q)], case.moment)
    size = (q.m * np.linalg.norm(q.v, axis=1)).sum()
    gather(case, q, grid, flip=share)
    after = momentum([body(q)]), angular_momentum([body(q)], case.moment)
    assert abs(after[0] - before[0]).max() <= 1e-14 * size
    assert abs(after[1] - before[1]).max() <= 1e-13 * size * 5.0 * DX


def test_the_shift_alone_changes_the_angular_momentum(free):
    """The negative control of the test above: without the spin that makes up for it."""
    case, q, grid = free
    before, x = angular_momentum([body(q)], case.moment), q.x.copy()
    gather(case, q, grid)
    shift = q.x - x
    q.C[:] += plain.shift_spin(shift, q.v - shift / DT) / case.moment
    size = (q.m * np.linalg.norm(q.v, axis=1)).sum() * 5.0 * DX
    assert abs(angular_momentum([body(q)], case.moment) - before).max() > 1e-6 * size


def test_full_memory_changes_nothing_without_forces(free):
    """Share 1: v stays, whatever the grid cannot show; share 0 is the transfer without memory."""
    case, q, grid = free
    keeps = deep(q)
    gather(case, keeps, grid, flip=1.0)
    assert close(keeps.v, q.v, 1e-13)
    strain = keeps.C + np.swapaxes(keeps.C, 1, 2)
    assert close(strain, q.C + np.swapaxes(q.C, 1, 2), 1e-13)
    assert np.linalg.norm(keeps.L - q.C) > 0.1 * np.linalg.norm(q.C)


def test_no_memory_is_the_transfer_without_relaxation(free):
    case, q, grid = free
    plainly = case._replace(relaxed=False)
    first, second = deep(q), deep(q)
    gather(case, first, grid, flip=0.0)
    if case.transfer == "mls":
        second = second._replace(L=second.C)
    without = grid._replace(f=np.empty(0), v_old=np.empty(0))
    gather(plainly, second, without, flip=0.0)
    for name in ("x", "v", "C", "L"):
        assert close(getattr(first, name), getattr(second, name), 1e-13)


def affine_field(d, x):
    rng = np.random.default_rng(2)
    A, c = rng.normal(size=(d, d)) / DX, rng.normal(size=d)
    return A, x @ A.T + c


def test_gather_reproduces_an_affine_field(trip):
    """Any degree, any position: v_p = A x_p + c and L_p = C_p = A from v_i = A x_i + c."""
    case, q = trip.case, deep(trip.before.q)
    nodes = DX * (np.moveaxis(np.indices(trip.grid.m.shape), 0, -1) + trip.grid.origin)
    A, v_i = affine_field(case.d, nodes)
    expected = affine_field(case.d, q.x)[1]
    v_old = v_i.copy() if case.separate else trip.grid.v_old
    q.v[:] = expected
    if case.relaxed:
        q.C[:] = A
    gather(case, q, trip.grid._replace(v=v_i, v_old=v_old))
    assert close(q.v, expected, 1e-12)
    assert abs(q.L - A).max() <= 1e-12 * abs(A).max()
    if case.transfer in AFFINE:
        assert abs(q.C - A).max() <= 1e-12 * abs(A).max()


def test_affine_field_survives_the_round_trip(trip):
    """G2P(P2G) gives back v and C of an affine field; PIC, which keeps no C, does not."""
    case, q = trip.case, deep(trip.before.q)
    A, q.v[:] = affine_field(case.d, q.x)
    q.tau[:] = 0.0
    if case.transfer in AFFINE:
        q.C[:] = A
    if case.body_force:
        q.b[:] = 0.0
    expected = q.v.copy()
    grid = scattered(case, q, DT)
    update(grid, np.zeros(case.d), DT)
    gather(case, q, grid, flip=0.0)
    if case.transfer in AFFINE:
        assert close(q.v, expected, 1e-12)
        assert abs(q.C - A).max() <= 1e-11 * abs(A).max()
    else:
        assert not close(q.v, expected, 1e-3)


def test_stretched_bar_contracts(trip):
    """tau_11 > 0 pulls the ends together: the sign of the force."""
    case, q = trip.case, deep(trip.before.q)
    q.v[:] = 0.0
    q.tau[:] = 0.0
    if case.transfer in AFFINE:
        q.C[:] = 0.0
    if case.body_force:
        q.b[:] = 0.0
    if case.fluid:
        q.tau[:] = 1.0
    else:
        q.tau[:, 0, 0] = 1.0
    x = q.x[:, 0].copy()
    grid = scattered(case, q, DT)
    update(grid, np.zeros(case.d), DT)
    gather(case, q, grid, flip=1.0)
    middle, width = 0.5 * (x.min() + x.max()), x.max() - x.min()
    assert q.v[x < middle - 0.3 * width, 0].mean() > 0.0 > q.v[x > middle + 0.3 * width, 0].mean()
    assert (q.m * q.v[:, 0] * (x - middle)).sum() < 0.0


def test_flip_keeps_what_the_grid_does_not_change():
    """Share 1 and no force: velocities stay as they are, checkerboards included; share 0 is PIC."""
    case = Case("flip", 3, 2, body_force=True)
    q = cloud(case, np.random.default_rng(3))
    q.tau[:], q.b[:] = 0.0, 0.0
    grid = scattered(case, q, DT)
    update(grid, np.zeros(2), DT)
    keeps, forgets = deep(q), deep(q)
    gather(case, keeps, grid, flip=1.0)
    gather(case, forgets, grid, flip=0.0)
    assert close(keeps.v, q.v)
    assert np.linalg.norm(forgets.v) < 0.5 * np.linalg.norm(q.v)
    assert np.array_equal(keeps.x, forgets.x)


@pytest.mark.parametrize("damping", [0.0, 0.3, 1.0])
def test_rpic_damps_strain_and_keeps_rotation(d, damping, rng):
    """NSF-rpic."""
    C = rng.normal(size=(100, d, d))
    out = C.copy()
    rpic(out, damping)
    T = np.swapaxes(out, 1, 2)
    assert close(out, plain.rpic(C, damping))
    assert close(out - T, C - np.swapaxes(C, 1, 2))
    assert abs(out + T - (1 - damping) * (C + np.swapaxes(C, 1, 2))).max() < 1e-14
