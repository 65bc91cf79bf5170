"""The graph network of NCLaw's baseline, without PyTorch: graph, history, network, free runs."""

from itertools import islice, product

import gnn_toys as toys
import numpy as np
import pytest
from gnn_toys import DT, RADIUS

from mpm_ref.core.boundary import BoxWalls, nclaw_walls
from mpm_ref.nclaw.gnn import features
from mpm_ref.nclaw.gnn.features import (
    HISTORY,
    Graph,
    SimulatorFailure,
    WallBox,
    box_of,
    edge_features,
    neighbour_graph,
    next_positions,
    point_features,
    straight_flight,
    target_answer,
)
from mpm_ref.nclaw.gnn.network import answers, normalised, outputs
from mpm_ref.nclaw.gnn.simulator import free_run


def answer(frames, box, reading, net):
    """Answers of a network to frames."""
    graph = neighbour_graph(frames[-1], reading.radius)
    return answers(net, point_features(frames, box, reading),
                   edge_features(frames[-1], graph, reading.radius), graph)


# the graph

def test_neighbours_are_those_within_the_radius_and_oneself(d):
    x = toys.frames(d)[-1]
    found = neighbour_graph(x, RADIUS)
    everyone = [(i, j) for i, j in product(range(len(x)), repeat=2)
                if np.linalg.norm(x[i] - x[j]) <= RADIUS]
    assert list(zip(found.receivers.tolist(), found.senders.tolist(), strict=True)) == everyone
    assert 2 * len(x) < len(everyone) < len(x) ** 2


def test_the_first_edge_of_each_receiver():
    graph = Graph(np.array([0, 2, 1, 0, 2]), np.array([0, 0, 1, 2, 2]))
    assert graph.first.tolist() == [0, 2, 3]
    assert neighbour_graph(toys.frames()[-1], 1e-9).first.tolist() == list(range(40))


def test_cubes_of_the_paper_have_15_neighbours_on_average():
    """At rest, of which one is the point itself: 6 across faces and 12 across edges, fewer at the
    surface.
    """
    x = 0.25 + 0.5 / 9 * np.indices((10, 10, 10)).reshape(3, -1).T
    k = len(neighbour_graph(x, 0.085).senders)
    assert k == 1000 + 6 * 9 * 10 * 10 + 12 * 9 * 9 * 10


def test_a_crowd_is_refused(monkeypatch):
    monkeypatch.setattr(features, "MAX_EDGES", 99)
    assert len(neighbour_graph(np.zeros((9, 3)), 0.1).senders) == 81
    with pytest.raises(SimulatorFailure, match=r"^10 points with 100 edges within 0\.1 m: "
                       r"expected at most 99; take fewer points, or a simulator of "):
        neighbour_graph(np.zeros((10, 3)), 0.1)


# what is told

def test_walls_of_the_paper_stand_where_matter_stops():
    box = box_of(nclaw_walls(20, 3), 0.05)
    assert (box.low.tolist(), box.high.tolist()) == (pytest.approx(3 * [0.1]),
                                                     pytest.approx(3 * [0.9]))
    open_box = box_of(BoxWalls((None, 3), (4, None)), 0.5)
    assert (open_box.low.tolist(), open_box.high.tolist()) == ([-np.inf, 1.0], [2.5, np.inf])


def test_before_the_start_flight_is_straight(d):
    x, v = toys.flight(d)
    found = straight_flight(x, v, DT)
    assert found.shape == (HISTORY + 1, *x.shape) == (6, *x.shape)
    np.testing.assert_array_equal(found[-1], x)
    assert np.diff(found, axis=0) == pytest.approx(np.broadcast_to(DT * v, (HISTORY, *x.shape)))


def test_points_are_told_velocities_and_walls():
    """By hand, of one point in 2D, at a third of the radius from one wall and past another."""
    reading = toys.reading(2)
    frames = np.array([(0.0, 0.0), (0.0, 1.0), (0.0, 1.0), (2.0, 1.0), (2.0, 1.0),
                       (RADIUS / 3, 1.0 + 0.1 * RADIUS)])[:, None]
    u = np.array([(0, 1), (0, 0), (2, 0), (0, 0), (RADIUS / 3 - 2, 0.1 * RADIUS)])
    told = (u - reading.scales.v_mean) / reading.scales.v_std
    found, = point_features(frames, toys.box(2), reading)
    assert found == pytest.approx([*told.ravel(), 1 / 3, 1.0, 1.0, -0.1])


def test_edges_are_told_where_the_sender_is():
    x = np.array([(0.0, 0.0), (0.03, 0.04)])
    found = edge_features(x, neighbour_graph(x, 0.1), 0.1)
    assert found == pytest.approx(np.array([(0.0, 0.0, 0.0), (0.3, 0.4, 0.5), (-0.3, -0.4, 0.5),
                                            (0.0, 0.0, 0.0)]))


def test_an_answer_is_an_acceleration(d):
    """Zero of it leaves the mean one; `target_answer` is `next_positions` backwards."""
    frames, scales = toys.frames(d), toys.reading(d).scales
    at_zero = next_positions(frames, np.zeros_like(frames[0]), scales)
    assert at_zero - 2.0 * frames[-1] + frames[-2] == pytest.approx(
        np.broadcast_to(scales.a_mean, frames[0].shape), abs=1e-15)
    y = np.random.default_rng(3).normal(size=frames[0].shape)
    after = next_positions(frames, y, scales)
    assert after - at_zero == pytest.approx(scales.a_std * y, abs=1e-15)
    assert target_answer(frames, after, scales) == pytest.approx(y, abs=1e-9)


# the network

def plain(net, points, edges, graph):
    """Point by point, edge by edge: formulas of the module."""
    v, e = [outputs(net.points, a[None])[0] for a in points], outputs(net.edges, edges)
    for of_edges_k, of_points_k in net.blocks:
        m = [outputs(of_edges_k, np.concatenate([e[k], v[j], v[i]])[None])[0]
             for k, (j, i) in enumerate(zip(*graph, strict=True))]
        sums = [sum(m[k] for k in np.flatnonzero(graph.receivers == i)) for i in range(len(v))]
        v = [a + outputs(of_points_k, np.concatenate([a, b])[None])[0]
             for a, b in zip(v, sums, strict=True)]
        e = e + np.array(m)
    return np.array([outputs(net.answer, a[None])[0] for a in v])


def test_messages_pass_as_the_formulas_say(d):
    frames, net, reading = toys.frames(d, n=12), toys.network(d), toys.reading(d)
    graph = neighbour_graph(frames[-1], reading.radius)
    told = (point_features(frames, toys.box(d), reading),
            edge_features(frames[-1], graph, reading.radius))
    assert answers(net, *told, graph) == pytest.approx(plain(net, *told, graph), rel=1e-10,
                                                       abs=1e-12)


def test_outputs_are_normalised(rng):
    found = normalised(3.0 + 100.0 * rng.normal(size=(5, 8)), np.ones(8), np.zeros(8))
    assert found.mean(axis=1) == pytest.approx(np.zeros(5), abs=1e-12)
    assert found.std(axis=1) == pytest.approx(np.ones(5), rel=1e-6)
    assert normalised(found, np.full(8, 2.0), np.ones(8)) == pytest.approx(1.0 + 2.0 * found,
                                                                           rel=1e-4)


def test_points_have_no_order(d, rng):
    frames, net, reading = toys.frames(d), toys.network(d), toys.reading(d)
    order = rng.permutation(frames.shape[1])
    whole = answer(frames, toys.box(d), reading, net)
    found = answer(frames[:, order], toys.box(d), reading, net)
    assert found == pytest.approx(whole[order], rel=1e-10, abs=1e-12)
    assert abs(whole[order] - whole).max() > 0.1


def test_places_do_not_count_where_walls_move_along(d):
    """Nor anywhere far from walls; near them they do."""
    frames, net, reading = toys.frames(d), toys.network(d), toys.reading(d)
    box, shift = toys.box(d), np.linspace(0.1, 0.3, d)
    whole = answer(frames, box, reading, net)
    moved = answer(frames + shift, WallBox(box.low + shift, box.high + shift), reading, net)
    assert moved == pytest.approx(whole, rel=1e-7, abs=1e-8)
    assert abs(answer(frames + shift, box, reading, net) - whole).max() > 0.1
    far = WallBox(box.low - 1.0, box.high + 1.0)
    assert answer(frames + shift, far, reading, net) == pytest.approx(
        answer(frames, far, reading, net), rel=1e-7, abs=1e-8)


def test_a_point_feels_its_neighbours_as_far_as_messages_go():
    """A row of points a radius apart: BLOCKS edges along and no further."""
    x = np.zeros((9, 2)) + 0.99 * RADIUS * np.arange(9)[:, None] * (1.0, 0.0)
    frames = straight_flight(x, np.zeros_like(x), DT)
    far = WallBox(np.full(2, -9.0), np.full(2, 9.0))
    faster = straight_flight(x, (np.arange(9) == 0)[:, None] * np.ones(2), DT)
    off = abs(answer(faster, far, toys.reading(2), toys.network(2))
              - answer(frames, far, toys.reading(2), toys.network(2))).max(axis=1)
    assert (off[:toys.BLOCKS + 1] > 0.0).all()
    assert (off[toys.BLOCKS + 1:] == 0.0).all()


# free runs

def test_a_free_run_goes_on_from_its_own_frames(d):
    (x, v), sim = toys.flight(d), toys.simulator(d)
    found = list(islice(sim.run(x, v, toys.box(d)), 4))
    frames = straight_flight(x, v, DT)
    for shown in found:
        np.testing.assert_array_equal(shown, frames[-1])
        y = answer(frames, toys.box(d), sim.reading, sim.network)
        frames = np.array([*frames[1:], next_positions(frames, y, sim.reading.scales)])


def test_a_point_that_is_lost_is_told():
    frames, y = toys.frames(), np.zeros((40, 3))
    y[7, 1] = np.inf
    run = free_run(lambda *told: y, toys.reading(), frames, toys.box())
    np.testing.assert_array_equal(next(run), frames[-1])
    with pytest.raises(SimulatorFailure, match=r"^point 7 is at \[.* inf .*\]: expected a finite "
                       r"place; did the simulator learn too little, or "):
        next(run)
