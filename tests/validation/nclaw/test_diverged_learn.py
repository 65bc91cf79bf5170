"""`python -m validation.training.nclaw NAME` of a training that diverges. Needs PyTorch."""

import pytest

torch = pytest.importorskip("torch")

from mpm_ref.nclaw.train.fit import Epoch  # noqa: E402
from mpm_ref.training import Diverged  # noqa: E402
from validation.nclaw import trained_laws  # noqa: E402
from validation.nclaw.initial_laws import untrained  # noqa: E402
from validation.nclaw.trained_laws import diverged, diverged_path  # noqa: E402
from validation.training import nclaw  # noqa: E402

NAME = "plasticine-no-undeformed"
HISTORY = [Epoch(1.0, 1e-3, 40, (1.0, 1.0)), Epoch(1.0, 2e-3, 40, (1.0, 1.0))]

pytestmark = pytest.mark.usefixtures("one_torch_thread")


@pytest.fixture
def places(tmp_path, monkeypatch):
    """Folders of weights and checkpoints."""
    monkeypatch.setattr(trained_laws, "FOLDER", tmp_path / "weights")
    return tmp_path / "weights", tmp_path / "checkpoints"


def diverging(net, recipe, laws, checkpoint, show):
    """Two epochs with a checkpoint; none if it goes on from there."""
    begins = not checkpoint.exists()
    checkpoint.write_text("two epochs")
    for k in range(2 * begins):
        show(HISTORY[:k + 1])
    raise Diverged("epoch 3: gone")


def test_errors_of_a_training_that_diverges_are_kept(places, monkeypatch, capsys):
    monkeypatch.setattr(nclaw, "train_net", diverging)
    nclaw.main([NAME], *places)
    found = diverged(NAME, trained_laws.identity(trained_laws.nets()[NAME]))
    assert found["errors"] == [1e-3, 2e-3]
    assert found["stopped"] == "epoch 3: gone"
    assert found["recipe"]["epochs"] == 300
    assert found["command"] == f"python -m validation.training.nclaw {NAME}"
    assert f"{NAME} diverged: epoch 3: gone" in capsys.readouterr().err
    assert [path.name for path in places[0].iterdir()] == [f"{NAME}.diverged.json"]
    assert not list(places[1].iterdir())


def test_errors_before_a_checkpoint_are_found_again(places, monkeypatch):
    """A training that goes on and diverges at once has shown none."""
    monkeypatch.setattr(nclaw, "train_net", diverging)
    for place in places:
        place.mkdir()
    (places[1] / f"{NAME}.pt").write_text("two epochs")
    nclaw.main([NAME], *places)
    identity = trained_laws.identity(trained_laws.nets()[NAME])
    assert diverged(NAME, identity)["errors"] == [1e-3, 2e-3]


def test_weights_take_the_place_of_what_was_known(places):
    places[0].mkdir()
    path = places[0] / f"{NAME}.npz"
    nclaw.write(path, {"errors": [], "stopped": "epoch 1: gone"})
    assert diverged_path(path).exists()
    nclaw.write(path, untrained())
    assert path.exists()
    assert not diverged_path(path).exists()
