"""Small trainings of NCLaw's trades: which there are, and their files."""

import numpy as np
import pytest
from neural_toys import trained as law
from small_toys import known

from mpm_ref.materials.learned import response, weights
from mpm_ref.scene import build
from mpm_ref.store.weights_file import pack
from validation.common.weights_needed import Untrained
from validation.nclaw import bundle, small_trainings, trained_laws
from validation.nclaw.bundle import Bundle
from validation.nclaw.environments import ENVIRONMENTS
from validation.nclaw.initial_laws import untrained
from validation.nclaw.small_trainings import Small, bundled, identity, small_nets


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where weights are looked for; nothing is remembered."""
    monkeypatch.setattr(small_trainings, "FOLDER", tmp_path)
    bundled.cache_clear()
    yield tmp_path
    bundled.cache_clear()


# which trainings there are

def test_each_training_is_of_a_name_of_its_own():
    groups = (small_trainings.OF_EPOCHS, small_trainings.OF_TRAINING, small_trainings.OF_WIDTH,
              small_trainings.OF_OBSERVATION, small_trainings.OF_FAULTS)
    assert len(small_nets()) == sum(map(len, groups))
    assert len(set(small_nets().values())) == len(small_nets())
    assert not {*small_nets()} & {*trained_laws.nets()}
    assert {*small_trainings.SEEDS} <= {*small_trainings.OF_TRAINING}


def test_epochs_are_kept_of_all_materials():
    found = {net.environment: name for name, net in small_trainings.OF_EPOCHS.items()}
    assert found == {name: f"small-{name}-epochs" for name in ENVIRONMENTS}
    assert {(net.epochs, net.checkpoints) for net in small_trainings.OF_EPOCHS.values()} == {
        (300, (10, 20, 30, 50, 75, 100, 150, 200))}


@pytest.mark.parametrize("name", [name for name, net in small_nets().items()
                                  if name != small_trainings.BASE and net not in
                                  small_trainings.OF_EPOCHS.values()])
def test_trainings_differ_from_the_base_in_one_choice(name):
    net, base = small_nets()[name], small_nets()[small_trainings.BASE]
    own = {key for key in Small._fields if getattr(net, key) != getattr(base, key)}
    assert len(own) == 1 or own <= {"edge", "cells", "epochs"}


def test_the_full_size_is_the_environment_s():
    one, full = (build(scene) for scene in (Small(edge=10, cells=20).scene,
                                            small_trainings.environment("jelly")))
    assert np.array_equal(one.bodies[0].particles.x, full.bodies[0].particles.x)
    assert one.dx == pytest.approx(full.dx)
    assert (one.conditions.walls.low, one.conditions.walls.high) == (
        full.conditions.walls.low, full.conditions.walls.high)


def test_a_coarse_grid_has_its_walls_in_the_same_place():
    """The last node in a wall is at 0.1 m, the first in the other at 0.9 m."""
    for cells in (10, 20):
        walls = build(Small(cells=cells).scene).conditions.walls
        assert (walls.low[0] - 1) / cells == pytest.approx(0.1)
        assert (walls.high[0] + 1) / cells == pytest.approx(0.9)


def test_points_share_the_mass_of_the_cube():
    q = build(Small(edge=6).scene).bodies[0].particles
    assert (len(q.m), q.m.sum()) == (216, pytest.approx(125.0))


def test_a_wrong_density_is_the_training_s_alone():
    net = Small(density=2.0)
    m, trained = (build(scene).bodies[0].particles.m.sum() for scene in (net.scene,
                                                                         net.trained_scene))
    assert (m, trained) == (pytest.approx(125.0), pytest.approx(250.0))


def test_what_a_training_is_of_tells_them_apart():
    known = [str(identity(net)) for net in small_nets().values()]
    assert len(set(known)) == len(known)


# files

def test_bundles_come_back_bit_for_bit(tmp_path):
    made = known({"errors": [1.0, 0.5]})
    bundle.save(tmp_path / "a.npz", made)
    back = bundle.load(tmp_path / "a.npz")
    assert back.about == made.about
    assert list(back.laws) == [10, 100]
    for epoch, laws in back.laws.items():
        assert laws.about == made.laws[epoch].about
        for part in weights.PARTS:
            own, was = getattr(laws, part), getattr(made.laws[epoch], part)
            assert own.kind == was.kind
            for (W, b), (W_was, b_was) in zip(own.layers, was.layers, strict=True):
                assert W.dtype == b.dtype == float
                assert np.array_equal(W, W_was)
                assert np.array_equal(b, b_was)


def test_epochs_stand_in_their_order(tmp_path):
    bundle.save(tmp_path / "a.npz", known(epochs=(100, 20, 3)))
    assert list(bundle.load(tmp_path / "a.npz").laws) == [3, 20, 100]


def test_a_bundle_is_a_third_as_large_as_weights(tmp_path):
    bundle.save(tmp_path / "a.npz", known(epochs=(1,)))
    weights.save(tmp_path / "b.npz", untrained())
    assert (tmp_path / "a.npz").stat().st_size < 0.6 * (tmp_path / "b.npz").stat().st_size


def test_a_training_that_kept_nothing_is_a_file_too(tmp_path):
    bundle.save(tmp_path / "a.npz", known({"stopped": "epoch 3: the loss is nan"}, ()))
    assert bundle.load(tmp_path / "a.npz").laws == {}


def test_doubles_are_refused(tmp_path):
    exact = weights.LearnedLaws(law(response.Stress(), 3), law(response.Correction(), 3), {})
    with pytest.raises(ValueError, match=r"a\.npz is not written: elastic_W0 has more digits than"):
        bundle.save(tmp_path / "a.npz", Bundle({1: exact}, {}))
    assert not list(tmp_path.iterdir())


def test_files_of_something_else_are_told(tmp_path):
    path = tmp_path / "a.npz"
    with pytest.raises(ValueError, match="cannot be read"):
        bundle.load(path)
    path.write_bytes(pack({"format": np.array(9), "about": np.array("{}")}))
    with pytest.raises(ValueError, match="has format 9, this program reads 1"):
        bundle.load(path)
    path.write_bytes(pack({"format": np.array(1), "about": np.array('{"laws": {"3": {}}}')}))
    with pytest.raises(ValueError, match="no trained laws of epoch 3: elastic law of kind None"):
        bundle.load(path)


def test_missing_bundles_say_how_to_make_them(folder):
    with pytest.raises(Untrained, match="no weights small.npz: "
                       r"python -m validation\.training\.nclaw small$"):
        bundled("small")


def test_bundles_of_another_training_are_refused(folder):
    bundle.save(folder / "small.npz", known(identity(Small())))
    assert list(bundled("small").laws) == [10, 100]
    assert small_trainings.last("small") is bundled("small").laws[100]
    bundled.cache_clear()
    bundle.save(folder / "small.npz", known(identity(Small(seed=3))))
    with pytest.raises(ValueError, match=r"small.npz are of .*'seed': 3.*now it is .*'seed': 0"):
        bundled("small")


def test_a_training_that_stopped_has_no_last_laws(folder):
    bundle.save(folder / "small.npz", known(
        {"stopped": "epoch 12: nan", **identity(Small())}, (10,)))
    with pytest.raises(Untrained, match="small stopped: epoch 12: nan"):
        small_trainings.last("small")
