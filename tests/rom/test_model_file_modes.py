"""Fields of modes as files: nothing is lost, and nothing damaged or foreign is taken for them.

What a seal tells of a file is tested with `test_model_file`.
"""

import numpy as np
import pytest

from mpm_ref.rom import model_file
from mpm_ref.rom.fields.pod_fields import Sizes, fit_pod_fields
from mpm_ref.rom.model_file import Model, arrays_of, load, save
from mpm_ref.rom.snapshots import join_histories
from mpm_ref.store.weights_file import header, pack
from tests.rom.test_pod_fields import ALL, bent

ABOUT = {"command": "train", "map": {"kind": "modes", "r": 2}}
KINDS = {"all": (Sizes(r=2, modes=3, tau=2, C=1), True), "straight": (Sizes(2, 2, 2, 1), True),
         "without C": (Sizes(2, 3, 2, 0), True), "not told": (Sizes(2, 3, 2, 1), False)}


def model(d=2, kind="all"):
    sizes, follows = KINDS[kind]
    runs = join_histories([bent(d, mu) for mu in (0.4, 0.7, 1.0)])
    fields, xhat = fit_pod_fields(runs, sizes, 0.3, follows)
    return Model(fields, xhat, xhat[:, 0].mean(axis=0), ABOUT)


def leaves(record):
    """All arrays of a record of records, by their places."""
    if record is None or isinstance(record, np.ndarray):
        return [record]
    return [leaf for part in record for leaf in leaves(part)]


@pytest.mark.parametrize("kind", KINDS)
def test_fields_come_back_bit_for_bit(tmp_path, d, kind):
    own = model(d, kind)
    save(tmp_path / "fields.npz", own)
    back = load(tmp_path / "fields.npz")
    assert back.about == ABOUT
    for a, b in zip(leaves(back[:3]), leaves(own[:3]), strict=True):
        assert (a is None) == (b is None)
        if a is not None:
            assert a.dtype == b.dtype
            assert np.array_equal(a, b)
    y = own.xhat[1, 4] + 0.01
    for name in ("place", "stress", "affine"):
        assert np.array_equal(getattr(back.field, name)(ALL, y),
                              getattr(own.field, name)(ALL, y))
    assert np.array_equal(back.field.near(y, own.field.X[:3], 0.1),
                          own.field.near(y, own.field.X[:3], 0.1))


def test_equal_content_gives_equal_bytes(tmp_path):
    for name in ("one", "other"):
        save(tmp_path / name, model())
    assert (tmp_path / "one").read_bytes() == (tmp_path / "other").read_bytes()


# What is refused.

def changed(**changes):
    """The arrays of a file with others in place of some; None: without."""
    found = header("f", model_file.FORMAT, ABOUT) | arrays_of(model())
    found |= {name.replace("__", "."): a for name, a in changes.items()}
    return {name: a for name, a in found.items() if a is not None}


N = len(ALL)


@pytest.mark.parametrize(("changes", "said"), [
    ({"X": None}, "it lacks X"),
    ({"cells__order": None}, "it lacks cells.order"),
    ({"C__modes": None}, "it lacks C.modes"),
    ({"bend__w": None}, "it lacks bend.w"),
    ({f"bend__{name}": None for name in ("centers", "unit", "w", "tail")}, "do not go together"),
    ({"U": np.zeros((N, 2))}, "U has 2 axes, expected 3"),
    ({"tau__coefficients__centers": np.float64(1.0)}, "centers has 0 axes, expected 2"),
    ({"X": np.zeros((N, 3))}, r"X has shape \(60, 3\), expected \(60, 2\)"),
    ({"tau__modes": np.zeros((N, 6, 2))}, r"tau.modes has shape .* expected \(60, 3, 2\)"),
    ({"mu": np.zeros(0)}, "tau.coefficients.centers has shape"),
    ({"rest": np.zeros(2, dtype=int)}, "rest is of type int64"),
    ({"cells__order": np.arange(N, dtype=float)}, "cells.order is of type float64"),
    ({"rest": np.array([0.0, np.nan])}, "rest has numbers that are not finite"),
    ({"bend__unit": np.zeros(2)}, "bend.unit has numbers that are not positive"),
    ({"bend__unit": np.array([1.0, np.inf])}, "bend.unit is infinite of coordinates that vary"),
    ({"cells__order": np.zeros(N, dtype=int)}, "do not hold each point once"),
    ({"kind": np.array("modes")}, "its kind is modes, expected one of network, "),
])
def test_what_does_not_fit_is_refused(tmp_path, changes, said):
    path = tmp_path / "fields.npz"
    path.write_bytes(pack(changed(**changes)))
    with pytest.raises(ValueError, match=said) as refusal:
        load(path)
    assert str(refusal.value).startswith(f"{path} holds no reduced model: ")
    assert "\n" not in str(refusal.value)


def test_blocks_whose_middle_is_no_point_are_refused(tmp_path):
    middle = arrays_of(model())["cells.middle"].copy()
    middle[0] = N
    path = tmp_path / "fields.npz"
    path.write_bytes(pack(changed(cells__middle=middle)))
    with pytest.raises(ValueError, match="the middle of a block is no point"):
        load(path)


def test_fields_that_do_not_fit_are_not_written(tmp_path):
    bad = model()._replace(rest=np.array([np.inf, 0.0]))
    with pytest.raises(ValueError, match="is not written: rest has numbers"):
        save(tmp_path / "fields.npz", bad)
    assert list(tmp_path.iterdir()) == []
