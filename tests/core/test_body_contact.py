"""Contact of two bodies at nodes that both reach."""

import numpy as np
import pytest
from grids import DX, over, positions
from threads import by_threads

from mpm_ref.body import particles_at
from mpm_ref.core.body_contact import (
    LEAST_SLOPE,
    BodyPoints,
    ContactTerms,
    Side,
    apply_contact,
    glue,
    normal_and_gap,
    shared_nodes,
    shares_near,
)
from mpm_ref.core.gimp import gimp_stencil
from mpm_ref.core.grid import Storage, update
from mpm_ref.core.jit import item_count
from mpm_ref.core.order import slabs_of
from mpm_ref.core.spline import STENCILS
from mpm_ref.core.transfer import p2g
from mpm_ref.plain.body_contact import touching_velocities, volume_share
from mpm_ref.plain.spline import pairs
from mpm_ref.plain.transfer import box_of

DT, MU = 0.01, 0.3
DEGREES = (2, 3)


def box_of_points(lower, upper, per=2):
    """Centres of the parts of cells between two corners [cells], `per` in each direction."""
    axes = [np.arange(low, high, 1.0 / per) + 0.5 / per
            for low, high in zip(lower, upper, strict=True)]
    return DX * np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def matter(rng, x, per=2, noise=0.0):
    """Particles at x with random velocities and strains."""
    d, n = x.shape[1], len(x)
    V = np.full(n, (DX / per) ** d)
    q = particles_at(x + noise * DX * rng.uniform(-0.5, 0.5, x.shape), rng.normal(size=x.shape),
                     rng.uniform(0.5, 2.0) * V, V, "apic")
    q.F[:] += noise * rng.uniform(-0.3, 0.3, q.F.shape)
    q.C[:] = rng.normal(size=q.C.shape)
    return q


def grid_of_field(q, stencil=STENCILS[2]):
    """The grid of one field, with velocities."""
    grid = Storage(DX, stencil, q.x.shape[1]).cover([q.x])
    p2g(q, grid, stencil, DT, slabs_of(q.x, grid, stencil), False)
    update(grid, np.zeros(q.x.shape[1]), DT)
    return grid


def pressed(rng, d, noise=0.4):
    """Two blocks that close on each other, off a corner, with particles in some disorder."""
    lower = box_of_points(d * [0.2], [3.2] * (d - 1) + [2.2])
    upper = box_of_points([1.2] + [0.2] * (d - 2) + [1.2], [4.2] + [3.2] * (d - 2) + [3.2])
    fields = matter(rng, lower, noise=noise), matter(rng, upper, noise=noise)
    fields[1].v[:, -1] -= 0.5
    return fields


def cloud(q):
    return BodyPoints(q.x, q.V0, q.F)


def touched(fields, mu=MU, stencil=STENCILS[2]):
    """The grids of two fields before and after contact, and their common nodes."""
    before, after = ([grid_of_field(q, stencil) for q in fields] for _ in range(2))
    nodes = shared_nodes(*after)
    sides = [(grid, shares_near(at, cloud(q), grid, stencil))
             for grid, q, at in zip(after, fields, nodes, strict=True)]
    apply_contact(*sides, nodes, ContactTerms(mu, DT, DX))
    return before, after, nodes


def geometry(fields, degree=2):
    """Normals (K, d) and gaps (K,) [cells] at the common nodes, and their positions (K, d)."""
    grids, d = [grid_of_field(q, STENCILS[degree]) for q in fields], fields[0].x.shape[1]
    nodes = shared_nodes(*grids)
    one, two = (shares_near(at, cloud(q), grid, STENCILS[degree])
                for grid, q, at in zip(grids, fields, nodes, strict=True))
    rows = [normal_and_gap(tuple(one.G[k]), tuple(two.G[k]), 1.0 - one.phi[k] - two.phi[k], DX)
            for k in range(len(nodes.first))]
    x = positions(grids[0]).reshape(-1, d)[nodes.first]
    return np.array([n for n, _ in rows]), np.array([gap for _, gap in rows]) / DX, x


def sums(grids):
    """Momentum, its moment about the origin, and kinetic energy of grids."""
    d = grids[0].m.ndim
    p = sum((g.m[..., None] * g.v).reshape(-1, d).sum(axis=0) for g in grids)
    moment = sum(np.einsum("ka,kb->ab", positions(g).reshape(-1, d),
                           (g.m[..., None] * g.v).reshape(-1, d)) for g in grids)
    energy = sum(0.5 * (g.m * (g.v**2).sum(axis=-1)).sum() for g in grids)
    return p, moment - moment.T, energy


# against the plain twin

@pytest.mark.parametrize(("degree", "gimp"), [(2, 0.0), (3, 0.0), (2, 2.0)])
@pytest.mark.parametrize("mu", [0.0, MU, 10.0])
def test_velocities_are_those_of_the_plain_twin(d, degree, gimp, mu, rng):
    fields = pressed(rng, d)
    before, after, _ = touched(fields, mu, gimp_stencil(gimp) if gimp else STENCILS[degree])
    ips = [pairs(q.x, DX, degree, gimp) for q in fields]
    box = box_of(*ips)
    shares = [volume_share(q.V0 * np.abs(np.linalg.det(q.F)), ip, box, DX)
              for q, ip in zip(fields, ips, strict=True)]
    m, v = ([over(grid, getattr(grid, name), box) for grid in before] for name in ("m", "v"))
    expected = touching_velocities(m, v, shares, {(0, 1): mu}, (DT, DX))
    changed = sum((a != b).any(axis=-1).sum() for a, b in zip(v, expected, strict=True))
    assert changed > 4
    for grid, u in zip(after, expected, strict=True):
        assert over(grid, grid.v, box) == pytest.approx(u, abs=1e-9)


# conservation

@pytest.mark.parametrize("mu", [0.0, MU])
def test_momentum_and_its_moment_are_kept_and_energy_does_not_grow(d, mu, rng):
    for _ in range(5):
        before, after, _ = touched(pressed(rng, d), mu)
        old, new = sums(before), sums(after)
        assert new[0] == pytest.approx(old[0], abs=1e-12 * np.abs(old[0]).max())
        assert new[1] == pytest.approx(old[1], abs=1e-12 * np.abs(old[1]).max())
        assert new[2] < old[2]


def test_bodies_do_not_approach_faster_than_the_gap_closes(d, rng):
    """They may leave, and friction is at most mu times the load: Signorini's and Coulomb's laws."""
    fields = pressed(rng, d)
    before, after, nodes = touched(fields)
    n, gap, _ = geometry(fields)
    v, u = ([g.v.reshape(-1, d)[at] for g, at in zip(grids, nodes, strict=True)]
            for grids in (before, after))
    m = after[0].m.reshape(-1)[nodes.first]
    l = m[:, None] * (v[0] - u[0])
    load, left = (l * n).sum(axis=1), ((u[0] - u[1]) * n).sum(axis=1)
    free = np.maximum(gap, 0.0) * DX / DT
    assert (left <= np.maximum(free, 0.0) + 1e-9).all()
    assert load.min() > -1e-12
    active = load > 1e-12
    assert 0 < active.sum() < len(active)
    assert left[active] == pytest.approx(free[active], abs=1e-8)
    t = np.linalg.norm(l - load[:, None] * n, axis=1)
    assert (t <= MU * load + 1e-12).all()
    assert (t[active] > 0.99 * MU * load[active]).any()


# the gap and the normal

@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize("shift", [0.0, 0.21, 0.5])
def test_flat_bodies_that_touch_have_no_gap(d, degree, shift, rng):
    """At all nodes, wherever these lie, away from the sides of the bodies."""
    fields = stacked(rng, d, shift, 0.0)
    n, gap, x = geometry(fields, degree)
    inner = (np.abs(x[:, :-1] / DX - 4.0) < 1.6).all(axis=1)
    assert inner.sum() > 1
    assert gap[inner] == pytest.approx(0.0, abs=1e-9)
    assert n[inner] == pytest.approx(np.tile(np.eye(d)[-1], (inner.sum(), 1)), abs=1e-9)


@pytest.mark.parametrize("width", [0.3, 0.1, -0.1])
def test_a_gap_is_measured_at_the_nodes_beside_it(width, rng):
    fields = stacked(rng, 2, 0.21, width)
    _, gap, x = geometry(fields)
    near = (np.abs(x[:, 0] / DX - 4.0) < 1.6) & (np.abs(x[:, 1] / DX - 4.21) < 0.6)
    assert near.sum() > 1
    assert gap[near] == pytest.approx(width, abs=0.05)


@pytest.mark.parametrize(("height", "expected"), [(2.0, 0.0), (1.0, 1 / 44), (0.5, 5 / 16)])
def test_a_thin_body_seems_farther_away(height, expected, rng):
    """Flush on a block: space behind it counts as gap, as seen from a node on the face."""
    fields = stacked(rng, 2, 0.0, 0.0, height)
    _, gap, x = geometry(fields)
    face = (np.abs(x[:, 0] / DX - 4.0) < 1.6) & (np.abs(x[:, 1] / DX - 4.0) < 0.1)
    assert face.sum() > 1
    assert gap[face] == pytest.approx(expected, abs=1e-9)


def test_space_of_a_collider_counts_as_gap(rng):
    """Two blocks side by side on a floor: from a node on the floor they seem 4/3 cells apart, and
    one cell above they touch up to a fiftieth.
    """
    fields = tuple(q._replace(x=np.ascontiguousarray(q.x[:, ::-1]))
                   for q in stacked(rng, 2, 0.0, 0.0))
    _, gap, x = geometry(fields)
    floor, above = (gap[(np.abs(x[:, 0] / DX - 4.0) < 0.1) & (np.abs(x[:, 1] / DX - y) < 0.1)]
                    for y in (0.0, 1.0))
    assert floor == pytest.approx(4 / 3, abs=1e-9)
    assert above == pytest.approx(4 / 189, abs=1e-9)


def stacked(rng, d, shift, width, height=4.0):
    """Two blocks of the same size whose faces are `width` cells apart, or an upper one of another
    height.
    """
    sides = [0.0] * (d - 1), [8.0] * (d - 1)
    lower = box_of_points([*sides[0], 0.0], [*sides[1], 4.0])
    upper = box_of_points([*sides[0], 4.0], [*sides[1], 4.0 + height])
    lower[:, -1] += shift * DX
    upper[:, -1] += (shift + width) * DX
    return matter(rng, lower), matter(rng, upper)


def test_volumes_are_those_of_the_deformed_bodies(rng):
    """Of a fluid J itself; half the volume leaves half of the space free."""
    fields = stacked(rng, 2, 0.0, 0.0)
    fields[0].F[:] *= np.sqrt(0.5)
    _, gap, x = geometry(fields)
    middle = (np.abs(x[:, 0] / DX - 4.0) < 1.6) & (np.abs(x[:, 1] / DX - 4.0) < 0.1)
    assert gap[middle] == pytest.approx(2.0 * 0.25 / (0.75 + 0.375), rel=1e-6)
    fluid = fields[0]._replace(F=np.full(len(fields[0].x), 0.5))
    _, same, _ = geometry((fluid, fields[1]))
    assert same == pytest.approx(gap, abs=1e-12)


def test_bodies_that_lie_in_each_other_have_no_normal(rng):
    """Their shares are equal up to round-off, and nothing acts; beside them it does."""
    x = box_of_points([0.0, 0.0], [8.0, 8.0])
    fields = matter(rng, x), matter(rng, x + 1e-6 * DX)
    n, gap, places = geometry(fields)
    inner = (np.abs(places / DX - 4.0) < 2.1).all(axis=1)
    assert (n[inner] == 0.0).all()
    assert (gap[inner] == 0.0).all()
    before, after, nodes = touched(fields)
    for old, new, at in zip(before, after, nodes, strict=True):
        v, u = (g.v.reshape(-1, 2)[at][inner] for g in (old, new))
        assert (v == u).all()
    fields[1].x[:, 0] += 6.0 * DX
    assert np.linalg.norm(geometry(fields)[0], axis=1).max() == pytest.approx(1.0)


def test_the_least_slope_is_one_of_a_cell():
    up, flat = (0.0, 1.01 * LEAST_SLOPE / DX), (0.0, 0.99 * LEAST_SLOPE / DX)
    n, gap = normal_and_gap((0.0, 0.0), up, 0.1, DX)
    assert n == pytest.approx((0.0, 1.0))
    assert gap == pytest.approx(0.2 / up[1])
    assert normal_and_gap((0.0, 0.0), flat, 0.1, DX) == ((0.0, 0.0), 0.0)


# nodes, glue, bits

def test_loops_count_the_nodes_that_are_shared():
    """Not those of the grid: threads start where there are many of the former."""
    side = Side(m=np.ones(10000), v=np.ones((10000, 2)), node=np.zeros(3, np.int64),
                phi=np.zeros(3), G=np.zeros((3, 2)))
    assert item_count(side) == 3

@pytest.mark.parametrize("cells", [9.0, -9.0, 40.0])
def test_bodies_far_apart_share_no_node(d, cells, rng):
    a, b = pressed(rng, d)
    b.x[:] += cells * DX
    nodes = shared_nodes(grid_of_field(a), grid_of_field(b))
    assert len(nodes.first) == len(nodes.second) == 0


def test_shared_nodes_are_those_with_both_masses(d, rng):
    grids = [grid_of_field(q) for q in pressed(rng, d)]
    nodes = shared_nodes(*grids)
    places = [set(map(tuple, (positions(g) / DX).round().reshape(-1, d)[g.m.reshape(-1) > 0]))
              for g in grids]
    common = [(positions(g) / DX).round().reshape(-1, d)[at]
              for g, at in zip(grids, nodes, strict=True)]
    assert (common[0] == common[1]).all()
    assert set(map(tuple, common[0])) == places[0] & places[1]


def test_glued_fields_have_the_velocity_of_one_field(d, rng):
    fields, stencil = pressed(rng, d), STENCILS[2]
    grids = [grid_of_field(q) for q in fields]
    glue(*grids, shared_nodes(*grids))
    one = Storage(DX, stencil, d).cover([q.x for q in fields])
    for q in fields:
        p2g(q, one, stencil, DT, slabs_of(q.x, one, stencil), False)
    update(one, np.zeros(d), DT)
    for grid in grids:
        cut = tuple(slice(a, a + n) for a, n in
                    zip(grid.origin - one.origin, grid.m.shape, strict=True))
        full = grid.m > 0
        assert grid.v[full] == pytest.approx(one.v[cut][full], abs=1e-10)


def test_one_and_two_threads_give_the_same_bits(rng):
    fields = pressed(rng, 3)
    one, two = by_threads(lambda: [g.v.tobytes() for g in touched(fields)[1]])
    assert one == two
