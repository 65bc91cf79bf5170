"""Features of places, and fields that read them."""

import numpy as np
import pytest
import rom_toys
from field_toys import MU, Q, field, latents, networks

from mpm_ref.core.jit import kernel
from mpm_ref.rom.fields.network import Networks
from mpm_ref.rom.fields.perceptron import ROWS, feature_count, features
from mpm_ref.rom.model_file import Model, load, save
from mpm_ref.rom.symmetric import tensor
from validation.nsf.pointwise_networks import fill_features, infer

OCTAVES = 3


@kernel
def filled(a, d, octaves):
    fill_features(a, d, octaves)


def test_features_of_a_place():
    s = np.sqrt(0.5)
    expected = [[0.25, 0.5, s, 1.0, s, 0.0, 1.0, 0.0, 0.0, -1.0]]
    assert features(np.array([[0.25, 0.5]]), 2) == pytest.approx(np.array(expected))


@pytest.mark.parametrize("octaves", [0, 1, OCTAVES])
def test_one_place_has_the_features_of_many(d, octaves, rng):
    Z = rng.uniform(size=(20, d))
    found = features(Z, octaves)
    assert found.shape == (20, feature_count(d, octaves))
    for z, row in zip(Z, found, strict=True):
        a = np.concatenate([z, np.full(feature_count(d, octaves) - d, np.nan)])
        filled(a, d, octaves)
        assert a == pytest.approx(row, abs=1e-13)


def test_a_field_without_octaves_reads_places_alone(d):
    one, X = field(d, 6, Q), rom_toys.cloud(d, 20)
    other = field(d, 6, Q, octaves=OCTAVES)
    assert (one.r, other.r) == (3, 3)
    assert other.net.sizes[0] - one.net.sizes[0] == 2 * d * OCTAVES
    assert np.isfinite(other.values(X, latents(), MU)).all()


def test_one_pass_equals_batches(d):
    (g, h, l), xhat = networks(d, Q, octaves=OCTAVES), latents()
    X = rom_toys.cloud(d, ROWS + 77)
    x, _, tau, C = infer(g, h, l, X, xhat, MU)
    plain = networks(d, Q)
    assert abs(x - plain[0].place(X, xhat)).max() < 1e-13
    for found, expected in ((tau, tensor(h.values(X, xhat, MU), d)),
                            (C, l.values(X, xhat).reshape(-1, d, d))):
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-13 * abs(expected).max())


def test_torch_reads_the_same_features(d):
    torch = pytest.importorskip("torch")
    from mpm_ref.rom.train.networks import perceptron_of
    one, X, xhat = field(d, 6, octaves=OCTAVES), rom_toys.cloud(d, 30), latents()
    Z = torch.from_numpy((X - one.units.low) / one.units.span)
    y = perceptron_of(one)(Z, torch.from_numpy(xhat).repeat(len(X), 1)).detach().numpy()
    found = one.units.mean + one.units.std * y
    np.testing.assert_allclose(found, one.values(X, xhat), rtol=1e-12)


def stored(tmp_path, octaves):
    """The path of a stored model, and the model."""
    model = Model(Networks(*networks(2, octaves=octaves)), np.zeros((2, 4, 3)), np.zeros(3), {})
    save(tmp_path / "a.npz", model)
    return tmp_path / "a.npz", model


def test_files_keep_octaves(tmp_path):
    path, model = stored(tmp_path, OCTAVES)
    again = load(path)
    assert (again.field.h.octaves, again.field.l.octaves) == (OCTAVES, OCTAVES)
    X, xhat = rom_toys.cloud(2, 20), latents()
    np.testing.assert_array_equal(again.field.h.values(X, xhat), model.field.h.values(X, xhat))


@pytest.mark.parametrize("octaves", [-1, 1.5, (1, 2)])
def test_octaves_that_are_no_number_of_them_are_refused(tmp_path, octaves):
    _, model = stored(tmp_path, 0)
    wrong = model._replace(field=model.field._replace(h=model.field.h._replace(octaves=octaves)))
    with pytest.raises(ValueError, match=r"h.octaves is .*: expected a whole number of 0 or more"):
        save(tmp_path / "b.npz", wrong)
