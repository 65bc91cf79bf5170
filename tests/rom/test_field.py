"""Learned fields: values, units, sizes; the pass point by point beside the one in batches."""

import tomllib
from pathlib import Path

import field_toys
import numba
import numpy as np
import pytest
import rom_toys
from field_toys import MU, Q, latents, networks, plain

from mpm_ref.rom.fields.architecture import hidden, nsf_lengths, row_per_axis
from mpm_ref.rom.fields.perceptron import ROWS, layers_of
from mpm_ref.rom.snapshots import field_units
from mpm_ref.rom.symmetric import tensor, values
from validation.nsf.pointwise_networks import infer

ROUND_OFF = 1e-13       # of the largest entry; seen: 2.2e-15
TARGETS = Path(__file__).parents[3] / "shared" / "papers" / "targets-nsf.toml"
GIVEN = pytest.mark.parametrize("q", [0, Q], ids=["without mu", "with mu"])


def close(a, b, tol=ROUND_OFF):
    return a.shape == b.shape and abs(a - b).max() <= tol * abs(b).max()


def of(field, X, xhat, mu):
    """The values of the module's docstring."""
    low, span, mean, std, mu_mean, mu_std = field.units
    y = np.concatenate([xhat, (mu - mu_mean) / mu_std])
    A = np.hstack([(X - low) / span, np.tile(y, (len(X), 1))])
    return mean + std * plain(layers_of(field.net), A)


# Values.

@GIVEN
def test_values_are_those_of_the_formula(d, q):
    field, X, xhat = field_toys.field(d, 6, q), rom_toys.cloud(d, 50), latents()
    assert close(field.values(X, xhat, MU[:q]), of(field, X, xhat, MU[:q]))
    assert (field.dim, field.r, field.parameters, field.outputs) == (d, field_toys.R, q, 6)


def test_parameters_are_normalised_and_make_a_difference(d):
    field, X, xhat = field_toys.field(d, 6, Q), rom_toys.cloud(d, 50), latents()
    moved = field._replace(units=field.units._replace(mu_mean=field.units.mu_mean + 1.0))
    assert close(moved.values(X, xhat, MU + 1.0), field.values(X, xhat, MU))
    assert not close(field.values(X, xhat, MU + 1.0), field.values(X, xhat, MU), 1e-3)


@pytest.mark.parametrize(("xhat", "mu", "said"), [
    (np.zeros(3), (), r"mu of shape \(0,\): expected \(3,\) and \(2,\)"),
    (np.zeros(3), (1.0,), r"mu of shape \(1,\): expected \(3,\) and \(2,\)"),
    (np.zeros(1), MU, r"xhat of shape \(1,\) .*: expected \(3,\) and \(2,\)"),
])
def test_other_numbers_of_coordinates_are_refused(xhat, mu, said):
    with pytest.raises(ValueError, match=said):
        field_toys.field(2, 3, Q).values(rom_toys.cloud(2, 5), xhat, mu)


# The pass point by point.

def batches(g, h, l, X, xhat, mu):
    """The same as `infer`, layer by layer."""
    x, _, G = g.derivatives(X, xhat)
    d = X.shape[1]
    return (x, G, tensor(h.values(X, xhat, h.needed_parameters(mu)), d),
            l.values(X, xhat, l.needed_parameters(mu)).reshape(-1, d, d))


@GIVEN
def test_one_pass_equals_batches(d, q):
    """More points than a batch holds, fewer than chunks, and none."""
    X, xhat, mu = rom_toys.cloud(d, ROWS + 77), latents(), MU[:q]
    for n in (len(X), 5):
        both = zip(infer(*networks(d, q), X[:n], xhat, mu),
                   batches(*networks(d, q), X[:n], xhat, mu), strict=True)
        assert all(close(a, b) for a, b in both)
    assert [len(a) for a in infer(*networks(d, q), X[:0], xhat, mu)] == [0] * 4


def test_the_affine_field_may_depend_on_parameters_and_the_stress_not(d):
    g, h, _ = networks(d)
    nets, X = (g, h, field_toys.field(d, d * d, Q)), rom_toys.cloud(d, 50)
    both = zip(infer(*nets, X, latents(), MU), batches(*nets, X, latents(), MU), strict=True)
    assert all(close(a, b) for a, b in both)


@GIVEN
def test_one_pass_equals_torch(d, q):
    torch = pytest.importorskip("torch")
    from mpm_ref.rom.train.networks import perceptron_of
    (g, h, l), X, xhat, mu = networks(d, q), rom_toys.cloud(d, 30), latents(), MU[:q]
    x, G, tau, C = infer(g, h, l, X, xhat, mu)

    def rows(field, y):
        scaled = torch.from_numpy((X - field.units.low) / field.units.span)
        mean, std = map(torch.from_numpy, field.units[2:4])
        return mean + std * perceptron_of(field)(scaled, y.repeat(len(X), 1))

    def places(y):
        return torch.from_numpy(X) + rows(g, y)

    at = torch.from_numpy(xhat)
    given = torch.from_numpy((mu - h.units.mu_mean) / h.units.mu_std)
    assert close(x, places(at).detach().numpy())
    assert close(G, torch.autograd.functional.jacobian(places, at).numpy())
    assert close(values(tau), rows(h, torch.cat([at, given])).detach().numpy())
    assert close(C.reshape(len(X), -1), rows(l, at).detach().numpy())


def test_the_latent_jacobian_is_the_first_order_of_a_taylor_series(d):
    """What it leaves over falls by four when the step is halved."""
    nets, X, xhat, along = networks(d), rom_toys.cloud(d, 30), latents(), latents(1)
    x, G, _, _ = infer(*nets, X, xhat)
    left = [np.linalg.norm(infer(*nets, X, xhat + h * along)[0] - x - h * (G @ along))
            for h in 1e-3 * 0.5 ** np.arange(5)]
    assert np.log2(np.array(left[:-1]) / left[1:]) == pytest.approx(2.0, abs=0.02)


def test_a_point_does_not_know_the_others(d):
    nets, X, xhat = networks(d, Q), rom_toys.cloud(d, 200), latents()
    whole = infer(*nets, X, xhat, MU)
    for a, b in zip(whole, infer(*nets, X[90:97], xhat, MU), strict=True):
        np.testing.assert_array_equal(a[90:97], b)


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread is all there is")
def test_two_threads_give_the_same_bits(d):
    nets, X, xhat, found = networks(d, Q), rom_toys.cloud(d, 3 * ROWS), latents(), []
    before = numba.get_num_threads()
    for threads in (1, 2):
        numba.set_num_threads(threads)
        found.append((*infer(*nets, X, xhat, MU), *batches(*nets, X, xhat, MU)))
    numba.set_num_threads(before)
    for a, b in zip(*found, strict=True):
        np.testing.assert_array_equal(a, b)


# Units and sizes.

def test_units_standardise_what_they_are_made_of(rng):
    X, mu = rom_toys.cloud(3, 9), rng.normal(size=(4, 2)) * (1.0, 30.0)
    samples = 5.0 + rng.normal(size=(4, 6, 9, 3)) * (1e-3, 1.0, 1e6)
    found = field_units(X, samples, mu)
    scaled = ((samples - found.mean) / found.std).reshape(-1, 3)
    assert scaled.mean(axis=0) == pytest.approx(0.0, abs=1e-6)
    assert scaled.std(axis=0) == pytest.approx(1.0)
    given = (mu - found.mu_mean) / found.mu_std
    assert (given.mean(axis=0), given.std(axis=0)) == (pytest.approx(0.0), pytest.approx(1.0))
    assert (found.low, found.span) == (pytest.approx(X.min(axis=0)), pytest.approx(np.ptp(X, 0)))


def test_what_hardly_varies_is_measured_like_what_varies_most(rng):
    X = rom_toys.cloud(2, 9)
    samples = np.stack([rng.normal(size=(2, 3, 9)), 1e-14 * rng.normal(size=(2, 3, 9)),
                        np.full((2, 3, 9), 0.1)], axis=-1)
    found = field_units(X, samples, np.array([[0.1, 1.0], [0.1, 2.0]]))
    assert found.std[1] == found.std[2] == found.std[0] > 0.1
    assert found.mu_std == pytest.approx([1.0, 0.5])
    assert (field_units(X, 0.0 * samples, np.zeros((2, 0))).std == 1.0).all()


def test_single_precision_snapshots_are_summed_in_double(rng):
    samples = (1e4 + rng.normal(size=(2, 50, 200, 1))).astype(np.float32)
    found = field_units(rom_toys.cloud(2, 200), samples, np.zeros((2, 0)))
    exact = samples.astype(float)
    assert found.mean == pytest.approx(exact.mean(), rel=1e-12)
    assert found.std == pytest.approx(exact.std(), rel=1e-9)


def test_values_that_are_not_finite_are_refused(rng):
    samples = rng.normal(size=(3, 2, 9, 3))
    samples[1, 1, 4, 2] = np.inf
    with pytest.raises(ValueError, match="run 1: the training values are not all finite"):
        field_units(rom_toys.cloud(2, 9), samples, np.zeros((3, 0)))


@pytest.mark.skipif(not TARGETS.exists(), reason="the paper's table is not here")
def test_widths_are_those_of_the_paper():
    """NSF-arch: five hidden layers of beta times the outputs, in every scene of Table 1."""
    known = {one["id"]: one["value"] for one in tomllib.loads(TARGETS.read_text())["target"]}
    widths = {name: known[name] for name in known if ".mlp." in name and name.endswith(".width")}
    outputs = {"g": 3, "h": 6, "l": 9}
    assert len(widths) == 21
    for name, width in widths.items():
        field = name.removesuffix(".width")
        found = hidden(known[f"{field}.beta"], outputs[field[-1]])
        assert found == (width,) * known[f"{field}.layers"]


def test_widths_of_the_bread():
    assert hidden(48, 3) == (144,) * 5
    assert hidden(64, 6) == (384,) * 5
    assert hidden(64, 9) == (576,) * 5


def test_lengths_of_the_encoder_are_those_of_the_rule():
    """NSF-encoder: kernel 6, stride 4, until at most 12 are left."""
    assert nsf_lengths(40_000) == [40_000, 9999, 2499, 624, 155, 38, 9]
    assert nsf_lengths(71_363)[-1] == 3
    assert nsf_lengths(13) == [13, 2]
    assert nsf_lengths(12) == [12]
    assert row_per_axis(2, 40_000).rows == [2, 3, 3, 3, 3, 3, 3]
