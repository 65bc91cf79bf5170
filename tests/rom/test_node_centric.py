"""Sample nodes first, and neighbours found once: the two sets of the workshop paper."""

from itertools import product

import numpy as np
import pytest
from rom_toys import cloud

from mpm_ref.core.grid import OutOfRange
from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.latent import start_state
from mpm_ref.rom.quadrature.eulerian import Eulerian
from mpm_ref.rom.quadrature.lagrangian import neighbours
from mpm_ref.rom.quadrature.node_centric import full_stencils, node_centric, nodes_of
from mpm_ref.rom.quadrature.stencil_overlap import bases
from mpm_ref.rom.step import ldm_stepper
from tests.rom.test_step import (
    DT,
    DX,
    GRAVITY,
    LAW,
    RHO,
    ROUNDING,
    Stirred,
    distance,
    full,
    full_steps,
    largest_difference,
    quadrature,
    swinging,
    watched,
)


@pytest.fixture(params=(2, 3), ids=("quadratic", "cubic"))
def degree(request):
    """Of the splines."""
    return request.param


def eulerian(X, degree):
    """Quadrature of the unit box, points X in it."""
    return Eulerian(X, RHO, distance, X[::4], DX, degree)


def block(d, degree, low=1, more=2):
    """All nodes of a box of nodes, with room for `more` bases beyond the first on every axis."""
    return np.array(list(product(range(low, low + degree + 1 + more), repeat=d)))


# which points

def test_samples_are_the_points_of_which_all_nodes_are_sample_nodes(d, degree):
    map, latent = swinging(d)
    X = cloud(d, 400)
    nodes = np.concatenate([block(d, degree), [[40] * d, [-7] * d]])
    found = node_centric(eulerian(X, degree), nodes).samples(map, latent.xhat)
    known = set(rows(nodes))
    x = map.place(X, latent.xhat)
    expected = [p for p in range(400) if set(rows(nodes_of(x[p:p + 1], DX, degree))) <= known]
    assert 0 < len(expected) < 400
    assert found.tolist() == expected


def rows(nodes):
    """Rows of an array as tuples."""
    return [tuple(row) for row in nodes.tolist()]


def test_only_whole_stencils_count(d, degree):
    """One node less, and its block tells nothing."""
    nodes = block(d, degree, more=0)
    assert full_stencils(nodes, degree).tolist() == [[1] * d]
    assert len(full_stencils(nodes[:-1], degree)) == 0
    both = np.concatenate([nodes, nodes + degree + 1, nodes[:3]])
    assert full_stencils(both, degree).tolist() == [[1] * d, [degree + 2] * d]


def test_places_are_all_that_share_a_node_of_a_whole_stencil(d, degree):
    """Sub-cells are compared with sample nodes one by one."""
    nodes = block(d, degree, more=1)
    body = node_centric(eulerian(cloud(d, 9), degree), nodes)
    tried = (np.array(list(product(range(-12, 24), repeat=d))) + 0.5) * 0.5 * DX
    off = bases(tried, DX, degree)[:, None] - nodes
    share = np.any(np.all((off <= 0) & (off >= -degree), axis=2), axis=1)
    found = np.rint(4.0 * body.places(None) / DX).astype(int)
    assert len(found) == share.sum()
    assert set(rows(found)) == set(rows(np.rint(4.0 * tried[share] / DX).astype(int)))


# what they do

@pytest.mark.parametrize("projection", ["linear", "nonlinear"])
def test_on_an_exact_manifold_a_run_is_the_full_models(d, degree, projection):
    """The same nodes all the time, a part of those of the body, which moves through them."""
    X, map, steps = cloud(d, 300), Affine(d), 6
    conditions, gravity = Stirred(d), GRAVITY[:d]
    particles = full_steps(full(X, X, 0.0 * X), conditions, gravity, degree, steps)
    body = node_centric(eulerian(X, degree), block(d, degree))
    model = ldm_stepper(map, body, LAW, gravity, projection, conditions=conditions)
    latent, seen = start_state(map.rest), []
    for k in range(steps):
        samples = body.samples(map, latent.xhat)
        seen.append(tuple(samples))
        latent, report = model.step(latent, samples, k * DT, DT)
        assert report.rank == map.r
    assert len(set(seen)) > 1
    assert max(len(samples) for samples in seen) < 300
    assert largest_difference(map, latent, X, particles) < 1e-12


def trial(body, samples):
    """Trial velocities of samples after a step under stress and gravity, on a learned map."""
    d = body.X.shape[1]
    map, latent = swinging(d)
    model = watched(ldm_stepper(map, body, LAW, GRAVITY[:d]))
    model.step(latent, samples, 0.0, DT)
    return model.trial


def test_where_nodes_are_the_samples_own_it_is_the_eulerian_quadrature(d, degree):
    """More quadrature points, none of which reaches a node that is read."""
    map, latent = swinging(d)
    X = cloud(d, 400)
    inner = eulerian(X, degree)
    samples = np.argsort(np.linalg.norm(X - 0.4, axis=1))[:5]
    nodes = nodes_of(map.place(X[samples], latent.xhat), DX, degree)
    body = node_centric(inner, nodes)
    assert set(samples) <= set(body.samples(map, latent.xhat))
    np.testing.assert_allclose(trial(body, samples), trial(inner, samples), rtol=0.0, atol=ROUNDING)


def test_with_all_nodes_it_is_near_the_material_point_approach(d):
    """They differ by their quadrature alone: at most a few per cent of the velocities' change."""
    X, (map, latent) = cloud(d, 4000), swinging(d)
    samples = np.flatnonzero(np.abs(X - 0.5).max(axis=1) < 0.2)
    nodes = nodes_of(map.place(X, latent.xhat), DX, 2)
    body = node_centric(eulerian(X, 2), nodes)
    assert np.array_equal(body.samples(map, latent.xhat), np.arange(4000))
    even = quadrature("lagrangian", X, 2)
    even = even._replace(m=np.full(4000, RHO / 4000), V0=np.full(4000, 1.0 / 4000))
    ours, theirs = (trial(of, samples) for of in (body, even))
    before = map.velocity(X[samples], latent.xhat, latent.vhat)
    assert np.linalg.norm(theirs - before) > 0.05 * np.linalg.norm(before)
    assert np.linalg.norm(ours - theirs) < 0.1 * np.linalg.norm(theirs - before)


# neighbours found once

def states(d, count=4):
    """A learned map, and states of it."""
    map, latent = swinging(d)
    return map, latent.xhat + 0.2 * np.random.default_rng(9).uniform(-1.0, 1.0, (count, map.r))


def test_neighbours_of_all_states_are_enough_at_each(d, degree):
    """The same velocities as with those of the state, and no samples among them. A decoder rounds
    by the number of its points.
    """
    (map, latents), X = states(d), cloud(d, 400)
    inner = quadrature("lagrangian", X, degree)
    samples = np.sort(np.argsort(np.linalg.norm(X - 0.2, axis=1))[:4])
    kept = neighbours(inner, map, latents, samples)
    assert not set(kept.samples) & set(kept.around)
    for xhat in latents:
        latent = start_state(xhat, np.ones(map.r))
        support = inner.support(map, latent.xhat, samples)
        assert set(support) <= {*kept.samples, *kept.around}
        found = []
        for body in (kept, inner):
            model = watched(ldm_stepper(map, body, LAW, GRAVITY[:d]))
            model.step(latent, samples, 0.0, DT)
            found.append(model.trial)
        np.testing.assert_allclose(*found, rtol=0.0, atol=ROUNDING)
    fewest = min(len(inner.support(map, xhat, samples)) for xhat in latents)
    assert fewest < len(kept.samples) + len(kept.around)


# bad input

@pytest.mark.parametrize(("nodes", "said"), [
    (np.zeros((5, 1), dtype=int), r"shape \(5, 1\)"),
    (np.zeros(4, dtype=int), r"shape \(4,\)"),
    (np.zeros((4, 2)), "float64: expected .* integer"),
    (np.zeros((0, 2), dtype=int), "0 sample nodes without a block"),
    (block(2, 2)[::2], r"13 sample nodes without a block of 3\^2"),
], ids=["axes", "row", "floats", "none", "holes"])
def test_sample_nodes_that_serve_nothing_are_refused(nodes, said):
    with pytest.raises(ValueError, match=said):
        node_centric(eulerian(cloud(2, 20), 2), nodes)


def test_sample_nodes_away_from_the_body_are_said_to_be(d):
    map, latent = swinging(d)
    body = node_centric(eulerian(cloud(d, 50), 2), block(d, 2, low=60))
    with pytest.raises(ValueError, match="none of the 50 material points"):
        body.samples(map, latent.xhat)
    with pytest.raises(OutOfRange):
        body.samples(map, np.full(map.r, np.nan))


def test_neighbours_of_other_samples_or_of_no_state_are_refused(d):
    (map, latents), X = states(d), cloud(d, 60)
    inner = quadrature("lagrangian", X, 2)
    kept = neighbours(inner, map, latents, [3, 5])
    model = ldm_stepper(map, kept, LAW, GRAVITY[:d])
    with pytest.raises(ValueError, match="sample 4 is not among the 2"):
        model.step(start_state(latents[0]), np.array([3, 4]), 0.0, DT)
    with pytest.raises(ValueError, match="no latent coordinates"):
        neighbours(inner, map, latents[:0], [3, 5])
