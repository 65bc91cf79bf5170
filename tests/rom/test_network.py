"""The perceptron and the deformation map made of it: values, derivatives, torch, threads."""

import hashlib
from contextlib import contextmanager

import numba
import numpy as np
import pytest
import rom_toys
import threadpoolctl
from problems import run_python
from variants import slow_but

from mpm_ref.rom.fields.network import Decoder, DecoderUnits
from mpm_ref.rom.fields.perceptron import ROWS, for_batches, layers_of, network
from validation.nsf import pointwise_networks

R = 3
HIDDEN = {"none": (), "one": (7,), "uneven": (12, 5, 9), "four of 30": (30,) * 4,
          "five of 30": (30,) * 5}
ROUND_OFF = 1e-14       # of the largest entry; seen: 1.3e-15
STEP = 1e-30            # of a derivative in the complex plane: no difference is formed
UNITS = DecoderUnits(np.array([-0.3, 2.0, 0.1]), np.array([1.4, 0.5, 0.8]),
              np.array([0.2, -0.1, 0.05]), np.array([0.3, 0.07, 0.2]))

DIGEST = """
import json, numba
from tests.rom.test_network import digest
print(json.dumps([digest(), numba.get_num_threads()]))
"""


@pytest.fixture(params=HIDDEN.values(), ids=HIDDEN.keys())
def hidden(request):
    return request.param


def case(d, hidden, n=100, seed=0):
    """A map in units of its own, points of its box at rest, xhat and vhat."""
    units = DecoderUnits(*(a[:d] for a in UNITS))
    layers = rom_toys.layers((d + R, *hidden, d), seed)
    X = units.low + units.span * rom_toys.cloud(d, n, seed)
    xhat, vhat = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, R))
    return Decoder(network(layers), units), layers, X, xhat, vhat


def plain(units, layers, X, xhat):
    """g(X; xhat) of the module's docstring; X and xhat may be complex."""
    a = np.hstack([(X - units.low) / units.span, np.tile(xhat, (len(X), 1))])
    for W, b in layers[:-1]:
        z = a @ W + b
        a = np.where(z.real > 0.0, z, np.expm1(z))
    W, b = layers[-1]
    return X + units.mean + units.std * (a @ W + b)


def plain_derivatives(units, layers, X, xhat):
    """F and dg/dxhat from steps in the complex plane."""
    F = [plain(units, layers, X + 1j * STEP * e, xhat).imag / STEP for e in np.eye(X.shape[1])]
    G = [plain(units, layers, X, xhat + 1j * STEP * e).imag / STEP for e in np.eye(len(xhat))]
    return np.stack(F, axis=-1), np.stack(G, axis=-1)


def close(a, b, tol=ROUND_OFF, scale=None):
    return abs(a - b).max() <= tol * (abs(b).max() if scale is None else scale)


def test_positions_equal_the_twin(d, hidden):
    map, layers, X, xhat, _ = case(d, hidden)
    assert close(map.place(X, xhat), plain(map.units, layers, X, xhat))


def test_derivatives_equal_the_twin(d, hidden):
    """LDM-eq15, LDM-eq16, with the scaling of LDM-appB."""
    map, layers, X, xhat, _ = case(d, hidden)
    x, F, G = map.derivatives(X, xhat)
    F_plain, G_plain = plain_derivatives(map.units, layers, X, xhat)
    assert np.array_equal(x, map.place(X, xhat))
    assert close(F, F_plain)
    assert close(G, G_plain)


@pytest.mark.parametrize("of", ["X", "xhat"])
def test_derivatives_are_the_first_order_of_a_taylor_series(d, of):
    """What they leave over falls by four when the step is halved."""
    map, _, X, xhat, along = case(d, (30,) * 4)
    x, F, G = map.derivatives(X, xhat)
    rng, left = np.random.default_rng(1), []
    dX, dxhat = (rng.normal(size=X.shape), 0.0) if of == "X" else (np.zeros_like(X), along)
    slope = np.einsum("nij,nj->ni", F, dX) + (G @ along if of == "xhat" else 0.0)
    for h in 1e-3 * 0.5 ** np.arange(5):
        left.append(np.linalg.norm(map.place(X + h * dX, xhat + h * dxhat) - x - h * slope))
    rates = np.log2(np.array(left[:-1]) / left[1:])
    assert rates == pytest.approx(2.0, abs=0.02)


def test_velocity_is_the_derivative_times_the_rates(d, hidden):
    map, _, X, xhat, vhat = case(d, hidden)
    G = map.derivatives(X, xhat)[2]
    assert close(map.velocity(X, xhat, vhat), G @ vhat, scale=abs(G).max())


def answers(map, X, xhat, vhat):
    """All that a map says of points."""
    return map.place(X, xhat), *map.derivatives(X, xhat), map.velocity(X, xhat, vhat)


def pointwise_answers(map, X, xhat, vhat):
    """The same, point by point."""
    return (pointwise_networks.places(map, X, xhat), *pointwise_networks.derivatives(map, X, xhat),
            pointwise_networks.velocities(map, X, xhat, vhat))


def test_batches_equal_points(d, hidden):
    """More points than a batch holds, and not a whole number of batches."""
    map, _, X, xhat, vhat = case(d, hidden, n=2 * ROWS + 77)
    both = zip(answers(map, X, xhat, vhat), pointwise_answers(map, X, xhat, vhat), strict=True)
    assert all(close(a, b) for a, b in both)


@pytest.mark.parametrize("form", [answers, pointwise_answers])
def test_points_do_not_know_each_other(d, form):
    """Also where there are fewer of them than chunks, or none. A product of matrices may round
    differently with other rows beside it, a point by itself may not.
    """
    map, _, X, xhat, vhat = case(d, (12, 5, 9))
    whole = form(map, X, xhat, vhat)
    for part in (slice(90, 97), slice(5, 6), slice(0, 0)):
        for a, b in zip(whole, form(map, X[part], xhat, vhat), strict=True):
            assert a[part].shape == b.shape
            if form is pointwise_answers or not b.size:
                assert np.array_equal(a[part], b)
            else:
                assert close(b, a[part])


def test_sizes_of_a_map(d):
    map = case(d, (12, 5, 9))[0]
    assert (map.dim, map.r) == (d, R)
    assert map.net.sizes.tolist() == [d + R, 12, 5, 9, d]


def digest():
    """sha256 of all that a map answers, in batches and point by point, for 5000 points."""
    sha = hashlib.sha256()
    for d in (2, 3):
        map, _, X, xhat, vhat = case(d, (30,) * 4, n=5000)
        for a in (*answers(map, X, xhat, vhat), *pointwise_answers(map, X, xhat, vhat)):
            sha.update(a.tobytes())
    return sha.hexdigest()


@pytest.mark.parametrize("threads", slow_but([1, 2], 2))
def test_any_number_of_threads_gives_the_same_bits(threads):
    count = str(threads)
    found = run_python(DIGEST, NUMBA_NUM_THREADS=count, OPENBLAS_NUM_THREADS=count)
    assert found == [digest(), threads]


def test_single_precision_is_near_double(d):
    map, _, X, xhat, vhat = case(d, (30,) * 4, n=3000)
    for a, b in zip(answers(map.single(), X, xhat, vhat), answers(map, X, xhat, vhat), strict=True):
        assert a.dtype == np.float64
        assert 0.0 < abs(a - b).max() < 1e-5 * abs(b).max()


# Weights in and out.

def test_layers_are_kept(hidden):
    layers = rom_toys.layers((5, *hidden, 2))
    for (W, b), (W_kept, b_kept) in zip(layers, layers_of(network(layers)), strict=True):
        assert np.array_equal(W, W_kept)
        assert np.array_equal(b, b_kept)


NAN, INF = np.full((4, 2), np.nan), np.full(2, np.inf)


@pytest.mark.parametrize(("W", "b", "said"), [
    (np.ones((3, 2)), np.ones(2), r"layer 1: weights \(3, 2\) and biases \(2,\) after 4 values"),
    (np.ones((4, 2)), np.ones(3), r"layer 1: weights \(4, 2\) and biases \(3,\) after 4 values"),
    (np.ones((4, 2)), np.ones((2, 1)), r"layer 1: .* biases \(2, 1\) after 4 values"),
    (np.ones(4), np.ones(()), r"layer 1: weights \(4,\) and biases \(\) after 4 values"),
    (NAN, np.ones(2), "layer 1: a weight or bias is not finite"),
    (np.ones((4, 2)), INF, "layer 1: a weight or bias is not finite"),
], ids=["rows", "biases", "biases in a column", "vector", "NaN", "infinite"])
def test_layers_that_do_not_fit_are_refused(W, b, said):
    first = np.ones((5, 4)), np.ones(4)
    with pytest.raises(ValueError, match=said) as refusal:
        network([first, (W, b)])
    assert "\n" not in str(refusal.value)


# PyTorch as a second opinion.

@contextmanager
def doubles(torch):
    """Networks are made of double-precision numbers."""
    torch.set_default_dtype(torch.float64)
    try:
        yield
    finally:
        torch.set_default_dtype(torch.float32)


def test_derivatives_equal_torch(d, hidden):
    torch = pytest.importorskip("torch")
    from mpm_ref.rom.train.networks import perceptron_of, with_derivatives
    map, _, X, xhat, _ = case(d, hidden)
    low, span, mean, std = map.units
    inputs = torch.from_numpy((X - low) / span), torch.from_numpy(xhat).repeat(len(X), 1)
    with doubles(torch):
        y, dX, dxhat = (a.detach().numpy() for a in with_derivatives(perceptron_of(map), *inputs))
    x, F, G = map.derivatives(X, xhat)
    assert close(x, X + mean + std * y)
    assert close(F, np.eye(d) + std[:, None] * dX / span)
    assert close(G, std[:, None] * dxhat)


def test_weights_survive_the_way_to_torch_and_back(d, hidden):
    torch = pytest.importorskip("torch")
    from mpm_ref.rom.train.networks import decoder_of, perceptron_of
    map = case(d, hidden)[0]
    with doubles(torch):
        back = decoder_of(perceptron_of(map), map.units)
    assert all(np.array_equal(a, b) for a, b in zip(map.net, back.net, strict=True))
    assert all(np.array_equal(a, b) for a, b in zip(map.units, back.units, strict=True))


def test_a_perceptron_of_torch_is_exported(d):
    """In double precision to round-off, in its own single precision to that one's."""
    torch = pytest.importorskip("torch")
    from mpm_ref.rom.train.networks import FieldPerceptron, decoder_of
    torch.manual_seed(0)
    f = FieldPerceptron(d, R)
    units = case(d, ())[0].units
    X, xhat = rom_toys.cloud(d, 50), np.array([0.3, -0.8, 0.1])
    map = decoder_of(f, units)
    y = (map.place(units.low + units.span * X, xhat) - units.low - units.span * X
         - units.mean) / units.std
    inputs = torch.from_numpy(X), torch.from_numpy(xhat).repeat(50, 1)
    single = f(*(a.float() for a in inputs)).detach().numpy()
    double = f.double()(*inputs).detach().numpy()
    assert close(y, double, 1e-13)
    assert close(y, single, 1e-5)
    assert map.net.sizes.tolist() == [d + R, 30, 30, 30, 30, d]


# threads

def blas_threads():
    """Of all BLAS libraries that are loaded."""
    return {pool["num_threads"] for pool in threadpoolctl.threadpool_info()
            if pool["user_api"] == "blas"}


def test_batches_are_worked_on_with_one_thread_of_blas_each():
    seen = []
    with threadpoolctl.threadpool_limits(2):
        for_batches(5, lambda rows: seen.append(blas_threads()))
        assert blas_threads() == {2}
    assert seen == [{1}]


def test_results_are_the_same_bits_for_any_number_of_threads():
    """Of BLAS, and of the pool that shares batches; enough points for it to be used."""
    map, X = rom_toys.decoder(3, 4), rom_toys.cloud(3, 6 * ROWS)
    xhat, found, before = np.linspace(-0.5, 0.5, 4), [], numba.get_num_threads()
    for threads in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
        numba.set_num_threads(threads)
        with threadpoolctl.threadpool_limits(threads):
            found.append((map.place(X, xhat), map.velocity(X, xhat, xhat),
                          *map.derivatives(X, xhat)))
    numba.set_num_threads(before)
    assert all(np.array_equal(a, b) for a, b in zip(*found, strict=True))
