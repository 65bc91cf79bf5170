"""Trained laws as files: nothing is lost, and nothing damaged or foreign is taken for one."""

from itertools import pairwise

import numpy as np
import pytest
import rom_toys
from damaged import assert_damage_is_told, changed, refused, without

from mpm_ref.materials.learned import response, weights
from mpm_ref.materials.learned.table import KINDS
from mpm_ref.materials.learned.weights import (
    PARTS,
    LawWeights,
    LearnedLaws,
    law_arrays,
    load,
    save,
)
from mpm_ref.store.weights_file import pack

ABOUT = {"seed": 3, "command": "train jelly", "errors": [0.1, 1e-300], "scene": "Ärmel", "of": None}
STRESS, CORRECTION = response.Stress(2.5), response.Correction()
RESPONSES = {"elastic": response.STRESSES, "plastic": response.CORRECTIONS}
SIZES = {2: (7, 8, 4), 3: (13, 8, 6, 9)}        # numbers read, .., answered


def law(kind, d=3, seed=0):
    return LawWeights(tuple(rom_toys.layers(SIZES[d], seed)), kind)


def laws(d=3, elastic=STRESS, plastic=CORRECTION):
    return LearnedLaws(law(elastic, d), law(plastic, d, seed=1), ABOUT)


def flat(laws):
    """All weights and biases."""
    return [a for part in PARTS for layer in getattr(laws, part).layers for a in layer]


def file_of(laws):
    """The arrays that are written."""
    return {"format": np.array(weights.FORMAT), "about": np.array("{}"),
            **{name: a for part in PARTS for name, a in
               law_arrays(part, getattr(laws, part)).items()}}


def test_laws_come_back_bit_for_bit(tmp_path, d):
    save(tmp_path / "laws.npz", laws(d))
    back = load(tmp_path / "laws.npz")
    assert (back.elastic.kind, back.plastic.kind) == (STRESS, CORRECTION)
    assert back.about == ABOUT
    for a, b in zip(flat(back), flat(laws(d)), strict=True):
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
    for (W, b), (n, m) in zip(back.elastic.layers, pairwise(SIZES[d]), strict=True):
        assert (W.shape, b.shape) == ((n, m), (m,))


@pytest.mark.parametrize("part", PARTS)
def test_every_kind_of_answer_comes_back(tmp_path, part):
    for record in RESPONSES[part]:
        kind = record(0.3)
        save(tmp_path / "laws.npz", laws(**{part: kind}))
        assert getattr(load(tmp_path / "laws.npz"), part).kind == kind


def test_every_kind_is_a_stress_or_a_deformation_gradient():
    kinds = {*response.STRESSES, *response.CORRECTIONS}
    own = {kind for kind in response.answer.methods if kind.__module__ == response.__name__}
    assert kinds == own == {KINDS[kind.__name__] for kind in kinds}


def test_equal_content_gives_equal_bytes(tmp_path):
    one, other = tmp_path / "one.npz", tmp_path / "other.npz"
    save(one, laws())
    save(other, laws()._replace(about=dict(reversed(ABOUT.items()))))
    assert one.read_bytes() == other.read_bytes()


# What is refused.

FAULTS = {
    "has format None, this program reads 1": without("format"),
    "has format 2, this program reads 1": changed(format=2),
    r"has format an array of shape \(2,\), this program reads 1": changed(format=[1, 1]),
    "elastic law of kind None, expected Stress or": without("elastic_kind"),
    "elastic law of kind Correction, expected Stress or": changed(elastic_kind="Correction"),
    "plastic law of kind Sand, expected Correction or PlainCorrection": changed(
        plastic_kind="Sand"),
    "plastic law without plastic_b1": without("plastic_b1"),
    "plastic law without plastic_W1": lambda a: {
        **without("plastic_W1")(a), "plastic_W3": np.zeros((9, 9)), "plastic_b3": np.zeros(9)},
    "elastic law without elastic_constants": without("elastic_constants"),
    "elastic law without layers": without("elastic_W0", "elastic_W1", "elastic_W2"),
    "elastic_W1 has entries that are not finite numbers": changed(
        elastic_W1=lambda W: W / 0.0),
    "plastic_b2 has entries that are not finite numbers": changed(plastic_b2=["1"] * 9),
    "elastic_constants has entries that are not finite numbers": changed(
        elastic_constants=[np.nan]),
    r"elastic law with constants \[1\. 2\.\]": changed(elastic_constants=[1.0, 2.0]),
    r"elastic law with layers of sizes \[\(13, 8\), \(7, 6\)": changed(
        elastic_W1=lambda W: W[1:]),
    r"plastic law with layers of sizes \[\(12, 8\)": changed(plastic_W0=lambda W: W[1:]),
    r"plastic law with layers of sizes .*\(6, 8\)\]": changed(plastic_W2=lambda W: W[:, 1:]),
    r"plastic law with layers of sizes \[\(104,\)": changed(plastic_W0=lambda W: W.ravel()),
    "elastic law with biases that do not fit": changed(elastic_b1=lambda b: b[1:]),
    "laws that read 13 and 7 numbers": lambda a: {
        **{name: b for name, b in a.items() if not name.startswith("plastic")},
        **law_arrays("plastic", law(response.Correction(), 2))},
    "about is no JSON": without("about"),
    "about is a list": changed(about="[3]"),
}


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
@pytest.mark.parametrize(("said", "change"), FAULTS.items(), ids=FAULTS.keys())
def test_a_sound_file_of_something_else_is_told(tmp_path, said, change):
    path = tmp_path / "laws.npz"
    path.write_bytes(pack(change(file_of(laws()))))
    assert " map" not in refused(load, path, said).removeprefix(str(path))      # of `rom`


def test_damaged_files_are_told(tmp_path):
    """`sealed` sees to it; its own tests are those of `rom.model_file`."""
    assert_damage_is_told(load, lambda path: save(path, laws()), tmp_path / "laws.npz")


def with_first(law, W, b):
    return law._replace(layers=((W, b), *law.layers[1:]))


@pytest.mark.parametrize(("change", "said"), [
    ({"about": {"x": np.zeros(2)}}, r"about: Object of type ndarray .*; give numbers"),
    ({"about": {"x": np.nan}}, r"about: Out of range float"),
    ({"elastic": with_first(law(response.Stress()), np.full((13, 8), np.inf), np.zeros(8))},
     "elastic_W0 has entries that are not finite numbers"),
    ({"plastic": law(response.Stress())}, "plastic law of kind Stress"),
    ({"plastic": law(response.Correction(), 2)}, "laws that read 13 and 7 numbers"),
    ({"elastic": LawWeights((), response.Stress())}, "elastic law without layers"),
])
def test_what_could_not_be_read_is_not_written(tmp_path, change, said):
    with pytest.raises(ValueError, match=rf"laws\.npz is not written: {said}"):
        save(tmp_path / "laws.npz", laws()._replace(**change))
    assert list(tmp_path.iterdir()) == []
