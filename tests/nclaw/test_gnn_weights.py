"""Graph networks as files: nothing is lost, and nothing damaged or foreign is taken for one."""

import gnn_toys as toys
import numpy as np
import pytest
from damaged import assert_damage_is_told, changed, refused, without
from neural_toys import laws

from mpm_ref.materials.learned import weights as of_laws
from mpm_ref.nclaw.gnn.network import PerceptronWeights
from mpm_ref.nclaw.gnn.weights import FORMAT, arrays_of, load, named, save
from mpm_ref.store.weights_file import pack


def numbers(simulator):
    """All of a simulator's numbers."""
    layers = [a for _, one in named(simulator.network) for layer in one.layers for a in layer]
    gains = [a for _, one in named(simulator.network) for a in one.norm]
    return layers + gains, [*simulator.reading.scales, simulator.reading.radius,
                            simulator.reading.dt]


def test_a_simulator_comes_back_in_single_precision(tmp_path, d):
    first = toys.simulator(d)
    save(tmp_path / "gnn.npz", first)
    back = load(tmp_path / "gnn.npz")
    assert back.about == {"seed": 0}
    assert len(back.network.blocks) == toys.BLOCKS
    for a, b in zip(numbers(back)[0], numbers(first)[0], strict=True):
        assert a.dtype == float
        np.testing.assert_array_equal(a, b.astype(np.float32))
    for a, b in zip(numbers(back)[1], numbers(first)[1], strict=True):
        np.testing.assert_array_equal(a, b)


def test_what_came_back_is_written_alike(tmp_path):
    save(tmp_path / "one.npz", toys.simulator())
    save(tmp_path / "other.npz", load(tmp_path / "one.npz"))
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "other.npz").read_bytes()


FAULTS = {
    "holds no trained graph network, format gnn 1: its format, 1, is that of": changed(format=1),
    "it lacks points_W0 or v_mean": without("points_W0"),
    "or they are no matrix and no vector": changed(v_mean=0.0),
    "it lacks answer_b2, edges_1_W0": without("answer_b2", "edges_1_W0"),
    "it has more, which belong to no network of 3 layers each": lambda a: {**a, "more": np.ones(1)},
    r"points_1_W0 has shape \(11, 6\), expected \(12, 6\)": changed(points_1_W0=lambda W: W[1:]),
    r"radius has shape \(1,\), expected \(\)": changed(radius=[0.1]),
    r"edges_W0 has shape \(4, 6\), expected \(3, 6\)": changed(
        **dict.fromkeys(("v_mean", "v_std", "a_mean", "a_std"), lambda a: a[1:]),
        points_W0=lambda W: W[:14], answer_W2=lambda W: W[:, 1:], answer_b2=lambda b: b[1:]),
    "edges_gain has entries that are not finite numbers": changed(edges_gain=lambda a: a / 0.0),
    "points_b1 has entries that are not finite numbers": changed(points_b1=["1"] * 6),
    "a_std has entries that are not positive": changed(a_std=lambda a: 0.0 * a),
    "dt has entries that are not positive": changed(dt=-1.0),
    "about is a list": changed(about="[3]"),
}


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
@pytest.mark.parametrize(("said", "change"), FAULTS.items(), ids=FAULTS.keys())
def test_a_sound_file_of_something_else_is_told(tmp_path, said, change):
    path = tmp_path / "gnn.npz"
    whole = arrays_of(toys.simulator()) | {"format": np.array(FORMAT), "about": np.array("{}")}
    path.write_bytes(pack(change(whole)))
    refused(load, path, said)


def test_laws_and_simulators_are_not_taken_for_each_other(tmp_path):
    path = tmp_path / "a.npz"
    of_laws.save(path, laws(3))
    refused(load, path, "its format, 1, is that of laws; name another file")
    save(path, toys.simulator())
    with pytest.raises(ValueError, match=r"a\.npz holds no trained laws, format 1: its "
                                         "format, gnn 1, is that of graph networks; name another"):
        of_laws.load(path)


def test_damaged_files_are_told(tmp_path):
    assert_damage_is_told(load, lambda path: save(path, toys.simulator()), tmp_path / "gnn.npz")


@pytest.mark.parametrize(("change", "said"), [
    ({"about": {"x": np.nan}}, "about: Out of range float"),
    ({"reading": toys.reading()._replace(radius=0.0)}, "radius has entries that are not positive"),
    ({"network": toys.network(2)}, r"points_W0 has shape \(14, 6\), expected \(21"),
    ({"network": toys.network()._replace(answer=PerceptronWeights(
        4 * ((np.zeros((6, 6)), np.zeros(6)),)))}, "it has answer_W3, answer_b3, which belong to"),
    ({"network": toys.network()._replace(answer=PerceptronWeights(
        3 * ((np.full((6, 6), np.inf), np.zeros(6)),)))}, "answer_W0 has entries that are not"),
])
def test_what_could_not_be_read_is_not_written(tmp_path, change, said):
    with pytest.raises(ValueError, match=rf"gnn\.npz is not written: {said}"):
        save(tmp_path / "gnn.npz", toys.simulator()._replace(**change))
    assert list(tmp_path.iterdir()) == []
