"""Sub-cells that the body's surface cuts: how much of one counts, and where."""

from math import pi

import numpy as np
import pytest
from rom_toys import affine, cloud, decoder

from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.kinematics import evaluate
from mpm_ref.rom.quadrature.cut_cells import LATTICE, parts_inside
from mpm_ref.rom.quadrature.eulerian import CUT, WHOLE, Eulerian
from mpm_ref.rom.quadrature.node_centric import node_centric, nodes_of
from mpm_ref.rom.study.full_model import ldm_full_model, signed_distance
from mpm_ref.rom.study.run import RunOptions, ldm_model
from mpm_ref.scene import Box, Cylinder, Difference, Intersection, Sphere, Union
from validation.common.scenes import with_
from validation.ldm.studies import GRAVITY

DX, RHO, SIDE = 0.125, 700.0, 0.25
CYLINDER = Cylinder(start=(0.5, 0.5, 0.1), end=(0.5, 0.5, 0.9), radius=0.3)
VOLUME = pi * 0.3**2 * 0.8


def wall(X):
    """Signed distance from the half-space below X_0 = 0.5 [m]."""
    return X[:, 0] - 0.5


def parts_at_rest(X, distance=wall):
    """`parts_inside` of sub-cells around points X (n, d) [m], undeformed."""
    map = Affine(X.shape[1])
    return parts_inside(map, map.rest, evaluate(map, X, map.rest), SIDE, distance)


def cylinder(boundary_cells, per_cell=2):
    """Quadrature of the cylinder."""
    X = cloud(3, 1500)
    distances = signed_distance(X, CYLINDER)
    X = X[distances <= 0.0]
    return Eulerian(X, RHO, lambda X: signed_distance(X, CYLINDER), X[:40], DX, 2, per_cell,
                    boundary_cells=boundary_cells)


def carried(quadrature, map, xhat):
    """`cloud` with all material points as samples."""
    return quadrature.cloud(map, xhat, np.arange(len(quadrature.X)))


def states():
    """Maps of the cylinder and latent coordinates: affine ones and learned ones."""
    for k in range(3):
        yield affine(3, k)
        yield decoder(3, 3), np.random.default_rng(k).uniform(-1.0, 1.0, 3)


# shares

def test_a_share_is_that_of_the_volume(d):
    """Exact for a wall across an axis, wherever it is."""
    for share in (0.0, 0.03, 0.2, 0.25, 0.61, 0.9, 1.0):
        X = np.full((1, d), 0.5)
        X[0, 0] += SIDE * (0.5 - share)
        assert parts_at_rest(X).share == pytest.approx(share, abs=1e-12)


def test_a_point_is_in_the_middle_of_its_part(d):
    """Exact for a wall along the lattice: a quarter, a half and three quarters within."""
    for quarters in range(1, LATTICE):
        X = np.full((1, d), 0.5)
        X[0, 0] += SIDE * (0.5 - quarters / LATTICE)
        parts = parts_at_rest(X)
        expected = X.copy()
        expected[0, 0] = 0.5 - 0.5 * SIDE * quarters / LATTICE
        np.testing.assert_allclose(parts.points.points, expected, atol=1e-14)
        np.testing.assert_allclose(parts.points.x, expected, atol=1e-14)


def test_sub_cells_within_and_outside_count_as_before(d):
    X = np.full((2, d), 0.5)
    X[:, 0] += (-0.5 * SIDE, 0.5 * SIDE)
    parts = parts_at_rest(X)
    np.testing.assert_array_equal(parts.share, [1.0, 0.0])
    np.testing.assert_array_equal(parts.points.points, X)


def test_the_lattice_lies_as_the_map_has_turned_and_stretched_it(d):
    """A wall that is deformed with the body: shares are those of its image."""
    map, xhat = affine(d)
    xhat = map.rest + 2.0 * (xhat - map.rest)
    X = 0.5 + 0.4 * (cloud(d, 300) - 0.5)
    at = evaluate(map, X, xhat)
    parts = parts_inside(map, xhat, at, SIDE, wall)
    A = at.F[0]
    level = np.linalg.solve(A.T, np.eye(d)[0])          # of X_0 along x
    fine = np.stack(np.meshgrid(*d * [(np.arange(24) + 0.5) / 24 - 0.5], indexing="ij"), axis=-1)
    off = (at.points[:, 0] - 0.5)[:, None] + SIDE * fine.reshape(-1, d) @ level
    np.testing.assert_allclose(parts.share, np.mean(off <= 0.0, axis=1), atol=0.03)
    assert ((0.0 < parts.share) & (parts.share < 1.0)).sum() > 50


def test_what_is_known_of_a_moved_point_is_of_its_new_place(d):
    map, xhat = decoder(d, 3), np.full(3, 0.4)
    before = evaluate(map, cloud(d, 200), xhat)
    copy = [a.copy() for a in before]
    parts = parts_inside(map, xhat, before, SIDE, wall)
    moved = (parts.points.points != before.points).any(axis=1)
    np.testing.assert_array_equal(moved, (0.0 < parts.share) & (parts.share < 1.0))
    assert moved.sum() > 20
    for known, again in zip(parts.points, evaluate(map, parts.points.points, xhat), strict=True):
        np.testing.assert_allclose(known, again, atol=1e-13)
    for old, now in zip(copy, before, strict=True):
        np.testing.assert_array_equal(old, now)


# the body

def moment_errors(boundary_cells, per_cell):
    """Relative errors of the cylinder's mass, and of its centre of mass [m], over `states`; the
    exact centre is that of a fine lattice of the body at rest.
    """
    fine = (np.stack(np.meshgrid(*3 * [np.arange(60)], indexing="ij"), axis=-1) + 0.5) / 60.0
    fine = fine.reshape(-1, 3)
    fine = fine[signed_distance(fine, CYLINDER) <= 0.0]
    masses, centres = [], []
    for map, xhat in states():
        at, m, *_ = carried(cylinder(boundary_cells, per_cell), map, xhat)
        masses.append(m.sum() / (RHO * VOLUME) - 1.0)
        centres.append(m @ at.x / m.sum() - map.place(fine, xhat).mean(axis=0))
    return np.sqrt(np.mean(np.square(masses))), np.sqrt(np.mean(np.square(centres)))


def test_mass_and_centre_of_a_cylinder_are_nearer_than_by_midpoints():
    """With as many sub-cells; and nearer than with four times as many per axis by midpoints. Both
    fall with the square of a sub-cell's size, or faster.
    """
    whole = {per_cell: moment_errors(WHOLE, per_cell) for per_cell in (1, 2, 4)}
    cut = {per_cell: moment_errors(CUT, per_cell) for per_cell in (1, 2)}
    for per_cell, errors in cut.items():
        assert errors[0] < 0.1 * whole[per_cell][0]
        assert errors[1] < 0.1 * whole[per_cell][1]
    assert cut[1][0] < 0.5 * whole[4][0]
    assert cut[1][1] < 0.5 * whole[4][1]
    assert cut[2][0] < 0.25 * cut[1][0]
    assert cut[2][1] < 0.25 * cut[1][1]


def test_points_of_cut_cells_lie_in_the_body_and_are_counted():
    map, xhat = decoder(3, 3), np.full(3, -0.5)
    quadrature = cylinder(CUT)
    at, m, V0, _, said, _ = carried(quadrature, map, xhat)
    assert signed_distance(at.points, CYLINDER).max() < 0.5 * DX / 2 / LATTICE
    assert m == pytest.approx(RHO * V0)
    J = np.linalg.det(map.derivatives(at.points, xhat)[1])
    share = V0 * J / (DX / 2) ** 3
    assert 0.0 < share.min() < 0.1
    assert share.max() == pytest.approx(1.0)
    places = quadrature.places(map.place(quadrature.X, xhat))
    assert sum(said[name] for name in ("points", "far", "outside", "lost")) == len(places)
    assert said["points"] == len(m) > carried(cylinder(WHOLE), map, xhat).report["points"]


def test_cells_around_nodes_are_cut_as_well():
    map, xhat = affine(3)
    masses = []
    for boundary_cells in (WHOLE, CUT):
        quadrature = cylinder(boundary_cells)
        nodes = nodes_of(map.place(quadrature.X, xhat), DX, 2)
        around = node_centric(quadrature, nodes)
        cloud_of_nodes = around.cloud(map, xhat, around.samples(map, xhat))
        masses.append((cloud_of_nodes.m.sum(), carried(quadrature, map, xhat).m.sum()))
    assert masses[1][0] == pytest.approx(masses[1][1], rel=1e-12)
    assert masses[1][0] != pytest.approx(masses[0][0], rel=1e-4)


# the option

@pytest.fixture(scope="module")
def full():
    """The cylinder under gravity, one step."""
    return ldm_full_model(with_(GRAVITY.scene(5.0), steps=1))


def test_cells_are_cut_where_a_run_asks_for_it(full):
    for options, expected in ((RunOptions("eulerian"), WHOLE),
                              (RunOptions("eulerian", boundary_cells="cut"), CUT)):
        assert ldm_model(full, Affine(3), options).quadrature.boundary_cells == expected


@pytest.mark.parametrize(("options", "said"), [
    (RunOptions("eulerian", boundary_cells="half"), "boundary_cells = 'half': expected one of "
     "whole, cut"),
    (RunOptions(boundary_cells="cut"), "boundary_cells = 'cut' with quadrature = 'lagrangian': "
     "expected 'whole', since the points of 'eulerian' alone are cells'"),
    (RunOptions("resampled", boundary_cells="cut"), "'cut' with quadrature = 'resampled'"),
])
def test_cells_that_cannot_be_cut_are_refused(full, options, said):
    with pytest.raises(ValueError, match=said):
        ldm_model(full, Affine(3), options)


@pytest.mark.parametrize(("shape", "joined"), [
    (Box(lower=(0.0,) * 3, upper=(1.0,) * 3), False),
    (Union(shapes=(Box(lower=(0.0,) * 3, upper=(1.0,) * 3),)), True),
    (Difference(shape=Box(lower=(0.0,) * 3, upper=(1.0,) * 3),
                minus=(Sphere(center=(0.5,) * 3, radius=0.2),)), False),
    (Intersection(shapes=(Union(shapes=(Sphere(center=(0.5,) * 3, radius=0.2),)),)), True)])
def test_shapes_with_seams_are_not_cut(full, shape, joined):
    """At the seam of two parts the distance is 0 inside the body."""
    options = RunOptions("eulerian", boundary_cells="cut")
    one = full._replace(shape=shape)
    if not joined:
        ldm_model(one, Affine(3), options)
        return
    with pytest.raises(ValueError, match="of a body made by a union: expected 'whole'"):
        ldm_model(one, Affine(3), options)
