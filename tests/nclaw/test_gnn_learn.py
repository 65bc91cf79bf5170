"""The graph network as it is trained: the same answers, gradients, noise, what is shown. Needs
PyTorch.
"""

import gnn_toys as toys
import numpy as np
import pytest
from gnn_toys import DT, RADIUS

torch = pytest.importorskip("torch")

from mpm_ref.nclaw.gnn.features import (  # noqa: E402  # noqa: E402
    HISTORY,
    Graph,
    edge_features,
    neighbour_graph,
    point_features,
    straight_flight,
)
from mpm_ref.nclaw.gnn.network import answers  # noqa: E402
from mpm_ref.nclaw.gnn.train.examples import example, random_walk, scales_of, training_run  # noqa: E402
from mpm_ref.nclaw.gnn.train.network import GraphNetwork, export_weights  # noqa: E402

pytestmark = pytest.mark.usefixtures("one_torch_thread")

NOISE = 3e-4


def network(d=3, seed=0):
    """A `GraphNetwork` of doubles whose biases and gains are random too."""
    torch.manual_seed(seed)
    net = GraphNetwork(d, toys.WIDTH, toys.BLOCKS).double()
    with torch.no_grad():
        for a in net.parameters():
            a += 0.2 * torch.randn_like(a)
    return net


def told(d=3, n=40):
    """What points and edges are told, and the graph, of `gnn_toys.frames`."""
    frames = toys.frames(d, n)
    graph = neighbour_graph(frames[-1], RADIUS)
    return (point_features(frames, toys.box(d), toys.reading(d)),
            edge_features(frames[-1], graph, RADIUS), graph)


def tensors(points, edges, graph):
    return (*map(torch.from_numpy, (points, edges)), Graph(*map(torch.from_numpy, graph)))


# the network

def test_the_network_without_pytorch_answers_alike(d):
    net = network(d)
    with torch.no_grad():
        found = net(*tensors(*told(d))).numpy()
    assert answers(export_weights(net), *told(d)) == pytest.approx(found, rel=1e-11, abs=1e-12)


def test_gradients_are_those_of_differences():
    """Of a sum of answers by all weights, against the network without PyTorch."""
    net, given = network(), told(n=15)
    G = np.random.default_rng(1).normal(size=(15, 3))
    loss = (torch.from_numpy(G) * net(*tensors(*given))).sum()
    slopes = torch.autograd.grad(loss, list(net.parameters()))
    way = [torch.randn_like(a) for a in slopes]
    slope = float(sum((a * b).sum() for a, b in zip(slopes, way, strict=True)))

    def moved(h):
        with torch.no_grad():
            for a, b in zip(net.parameters(), way, strict=True):
                a += h * b
        value = (G * answers(export_weights(net), *given)).sum()
        with torch.no_grad():
            for a, b in zip(net.parameters(), way, strict=True):
                a -= h * b
        return value

    h = 1e-6
    assert (moved(h) - moved(-h)) / (2 * h) == pytest.approx(slope, rel=1e-6)


def test_the_network_of_the_paper_has_its_layers():
    """10 blocks 128 wide: 1.6 million numbers; drawn from one seed alike."""
    nets = []
    for seed in (0, 0, 1):
        torch.manual_seed(seed)
        nets.append(GraphNetwork(3))
    w = 128
    layers = [(21, w), (4, w), *10 * [(3 * w, w), (2 * w, w)], (w, 3)]
    count = sum(n * w + w + w * w + w + w * m + m + (2 * m if m == w else 0) for n, m in layers)
    assert sum(a.numel() for a in nets[0].parameters()) == count == 1_590_787
    one, same, other = (net.blocks[3].edges.layers[1].weight for net in nets)
    assert torch.equal(one, same)
    assert not torch.equal(one, other)


def test_weights_begin_within_two_deviations():
    torch.manual_seed(0)
    layer = GraphNetwork(3).blocks[0].edges.layers[0]
    scaled = layer.weight.detach() * (3 * 128) ** 0.5
    assert 1.95 < float(scaled.abs().max()) <= 2.0
    assert float(scaled.std()) == pytest.approx(0.88, abs=0.01)     # of a normal one cut at 2
    assert not layer.bias.any()


# noise

def test_noise_is_a_walk_of_velocities():
    """The deviation of velocity k is noise (k/5)^(1/2), positions are their sum from zero on."""
    found = random_walk(np.random.default_rng(0), (20_000, 3), NOISE)
    assert found.shape == (HISTORY + 1, 20_000, 3)
    assert not found[0].any()
    u = np.diff(found, axis=0)
    assert u.mean(axis=(1, 2)) == pytest.approx(np.zeros(HISTORY), abs=5e-6)
    assert u.std(axis=(1, 2)) == pytest.approx(NOISE * np.sqrt(np.arange(1, 6) / 5), rel=0.01)
    steps = np.diff(u, axis=0)
    assert np.corrcoef(steps[0].ravel(), steps[1].ravel())[0, 1] == pytest.approx(0.0, abs=0.02)
    assert np.corrcoef(u[0, :, 0], u[0, :, 1])[0, 1] == pytest.approx(0.0, abs=0.03)


# what is shown

def a_run(d=3, k=7, n=40, seed=0):
    """Positions (k + 1, n, d) of a flight under gravity, and velocities at the start."""
    x, v = toys.flight(d, n, seed)
    t = DT * np.arange(k + 1)[:, None, None]
    return x + t * v - 4.9 * t**2 * (np.arange(d) == 1), v


def test_a_run_is_shown_from_its_first_frame_to_the_one_before_its_last():
    x, v = a_run()
    run = training_run(x, v, DT, toys.box())
    assert run.count == 7
    np.testing.assert_array_equal(run.frames[HISTORY:], x)
    np.testing.assert_array_equal(run.frames[:HISTORY + 1], straight_flight(x[0], v, DT))


def test_without_noise_the_true_acceleration_is_expected():
    """-g dt^2 in each frame but the first, to which flight was straight: half of it there."""
    x, v = a_run()
    run, reading, none = training_run(x, v, DT, toys.box()), toys.reading(), np.zeros((6, 40, 3))
    for k, share in ((0, 0.5), (1, 1.0), (6, 1.0)):
        found = example(run, k, reading, none).answer.numpy()
        a = -9.8 * share * DT**2 * np.array((0.0, 1.0, 0.0))
        scaled = (a - reading.scales.a_mean) / reading.scales.a_std
        assert found == pytest.approx(np.broadcast_to(scaled, (40, 3)), abs=1e-4)


def test_noise_is_told_and_the_true_next_velocity_expected():
    x, v = a_run()
    run, reading = training_run(x, v, DT, toys.box()), toys.reading()
    noise = random_walk(np.random.default_rng(0), (40, 3), NOISE)
    noisy, clean = (example(run, 3, reading, e) for e in (noise, 0.0 * noise))
    graph = neighbour_graph(x[3] + noise[-1], RADIUS)
    assert [a.tolist() for a in noisy.graph] == [a.tolist() for a in graph]
    off = (noisy.points - clean.points)[:, :15].numpy().reshape(40, HISTORY, 3)
    assert off == pytest.approx(np.diff(noise, axis=0).swapaxes(0, 1) / reading.scales.v_std,
                                abs=1e-5)
    taken_back = (noisy.answer - clean.answer).numpy()
    assert taken_back == pytest.approx((noise[-2] - noise[-1]) / reading.scales.a_std, abs=1e-5)


def test_scales_are_of_what_is_expected_and_of_noise():
    runs = [training_run(*a_run(seed=seed), DT, toys.box()) for seed in (0, 5)]
    found = scales_of(runs, NOISE)
    u = np.concatenate([np.diff(run.frames[HISTORY - 1:], axis=0).reshape(-1, 3) for run in runs])
    assert found.v_mean == pytest.approx(u.mean(axis=0))
    assert found.v_std == pytest.approx(np.hypot(u.std(axis=0), NOISE))
    g = 9.8 * DT**2
    assert found.a_mean == pytest.approx([0.0, -g * 6.5 / 7, 0.0], abs=1e-15)
    assert found.a_std == pytest.approx([NOISE, np.hypot(NOISE, g * np.sqrt(6) / 14), NOISE])
    assert scales_of(runs, 0.0).a_std[0] < 1e-12


@pytest.mark.parametrize(("change", "said"), [
    (lambda x, v: (x[:1], v), "a run of 1 frames: expected at least two"),
    (lambda x, v: (x, v * np.inf), "not finite numbers: learn from another one")])
def test_runs_that_teach_nothing_are_refused(change, said):
    with pytest.raises(ValueError, match=said):
        training_run(*change(*a_run()), DT, toys.box())
