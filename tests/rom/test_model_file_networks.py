"""NSF's networks as files: nothing is lost, and nothing damaged or foreign is taken for them.

What a seal tells of a file is tested with `test_model_file`.
"""

import field_toys
import numpy as np
import pytest
import rom_toys
from damaged import changed, refused, without
from field_toys import MU, Q, latents, networks

from mpm_ref.rom import model_file
from mpm_ref.rom.fields.network import Networks
from mpm_ref.rom.model_file import Model, arrays_of, load, save
from mpm_ref.store.weights_file import header, pack
from validation.nsf.pointwise_networks import infer

ABOUT = {"seed": 3, "command": "train nsf", "betas": [48, 64, 64]}


def model(d=3, q=Q, seed=0):
    rng = np.random.default_rng(seed)
    r = field_toys.R
    fields = Networks(*networks(d, q, seed))
    return Model(fields, rng.normal(size=(4, 3, r)), rng.normal(size=r), ABOUT)


def parts(**changes):
    """The model's networks with others in place of some."""
    return model().field._replace(**changes)


def file_of(model):
    """The arrays that are written."""
    return header("fields.npz", model_file.FORMAT, model.about) | arrays_of(model)


@pytest.mark.parametrize("q", [0, Q], ids=["without mu", "with mu"])
def test_a_model_comes_back_bit_for_bit(tmp_path, d, q):
    save(tmp_path / "fields.npz", model(d, q))
    back, own = load(tmp_path / "fields.npz"), model(d, q)
    for a, b in zip(back.field, own.field, strict=True):
        for one, other in zip((*a.net, *a.units), (*b.net, *b.units), strict=True):
            assert one.dtype == other.dtype
            np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(back.xhat, own.xhat)
    np.testing.assert_array_equal(back.rest, own.rest)
    assert back.about == ABOUT
    X, xhat = rom_toys.cloud(d, 20), latents()
    for a, b in zip(infer(*back.field, X, xhat, MU[:q]), infer(*own.field, X, xhat, MU[:q]),
                    strict=True):
        np.testing.assert_array_equal(a, b)


def test_equal_content_gives_equal_bytes(tmp_path):
    for name in ("one", "other"):
        save(tmp_path / name, model())
    assert (tmp_path / "one").read_bytes() == (tmp_path / "other").read_bytes()


# What is refused.

@pytest.mark.parametrize("place", [0.001, 0.3, 0.6, 0.9, 0.999])
def test_a_flipped_bit_and_a_cut_are_told(tmp_path, place):
    path = tmp_path / "fields.npz"
    save(path, model())
    content = path.read_bytes()
    k = int(place * len(content))
    path.write_bytes(content[:k] + bytes([content[k] ^ 4]) + content[k + 1:])
    refused(load, path, "is damaged, cut short|is not an npz file")
    path.write_bytes(content[:k])
    refused(load, path, "is damaged, cut short|is not an npz file")


def test_a_file_of_another_kind_is_told(tmp_path):
    path = tmp_path / "fields.npz"
    path.write_bytes(pack(file_of(model()) | {"kind": np.array("network")}))
    refused(load, path, "holds no reduced model: it lacks net.W, net.b")


FAULTS = {
    "has format None": without("format"),
    "has format reduced model 2, this": changed(format="reduced model 2"),
    "about is no JSON": without("about"),
    r"g.net.W has shape \(149,\), expected \(150,\)":
        lambda a: {**a, "g.net.W": a["g.net.W"][1:]},
    "it lacks rest": without("rest"),
    "it lacks h.units.mu_std": without("h.units.mu_std"),
    r"h.net.b has shape \(25,\), expected \(24,\)":
        lambda a: {**a, "h.net.b": np.append(a["h.net.b"], 0.0)},
    r"l.units.mean has shape \(8,\), expected \(9,\)":
        lambda a: {**a, "l.units.mean": a["l.units.mean"][1:]},
    "l.units.low or mu_mean has not one axis": lambda a: {**a, "l.units.low": np.array(0.0)},
    r"l.net.sizes is an array of shape \(4,\) and type float64, .*: expected whole":
        lambda a: {**a, "l.net.sizes": a["l.net.sizes"] + 0.5},
    r"l.net.sizes is an array of shape \(1,\)": lambda a: {**a, "l.net.sizes": np.array([6])},
    "h.net.W is of type <U": lambda a: {**a, "h.net.W": a["h.net.W"].astype(str)},
    "h.net.W has numbers that are not finite":
        lambda a: {**a, "h.net.W": a["h.net.W"] + np.inf},
    "h.units.mu_std has numbers that are not positive":
        lambda a: {**a, "h.units.mu_std": -a["h.units.mu_std"]},
    "the stress has 3 axes, 3 latent coordinates and 9 values: expected 3, 3 and 6":
        lambda a: a | {f"h{k[1:]}": v for k, v in a.items() if k.startswith("l.")},
    "the affine field has 3 axes, 2 latent coordinates": lambda a: {
        **a, "l.units.mu_mean": np.zeros(1), "l.units.mu_std": np.ones(1)},
}


@pytest.mark.parametrize(("said", "change"), FAULTS.items(), ids=FAULTS.keys())
def test_a_sound_file_of_something_else_is_told(tmp_path, said, change):
    path = tmp_path / "fields.npz"
    path.write_bytes(pack(change(file_of(model()))))
    refused(load, path, said)


@pytest.mark.parametrize(("change", "said"), [
    ({"rest": np.full(field_toys.R, np.nan)}, "is not written: rest has numbers that are not"),
    ({"xhat": np.zeros((4, 3, 5))}, r"is not written: xhat has shape \(4, 3, 5\), expected"),
    ({"field": parts(h=networks(2)[1])}, "is not written: the stress has 2 axes"),
    ({"field": parts(g=rom_toys.decoder(3, 2)), "xhat": np.zeros((1, 1, 2)), "rest": np.zeros(2)},
     "is not written: the stress has 3 axes, 3 latent coordinates .* expected 3, 2 and 6"),
    ({"about": {"x": np.zeros(2)}}, r"is not written: about: Object of type nd.*; give numbers"),
])
def test_what_could_not_be_read_is_not_written(tmp_path, change, said):
    with pytest.raises(ValueError, match=said):
        save(tmp_path / "fields.npz", model()._replace(**change))
    assert list(tmp_path.iterdir()) == []


def test_what_single_precision_holds_is_stored_so(tmp_path):
    """As weights are that were trained in it; on loading all is double."""
    own = model()
    h = own.field.h
    net = h.net._replace(**{name: getattr(h.net, name).astype(np.float32).astype(float)
                            for name in ("W", "b")})
    rounded = own._replace(field=parts(h=h._replace(net=net)))
    arrays = arrays_of(rounded)
    assert (arrays["h.net.W"].dtype, arrays["l.net.W"].dtype) == (np.float32, float)
    save(tmp_path / "fields.npz", rounded)
    back = load(tmp_path / "fields.npz")
    assert back.field.h.net.W.dtype == back.xhat.dtype == float
    assert np.array_equal(back.field.h.net.W, net.W)
