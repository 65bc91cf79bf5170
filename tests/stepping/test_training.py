"""What learns is imported when it is asked for; without PyTorch one sentence says so."""

import importlib

import pytest
from hidden_torch import hide

from mpm_ref import rom
from mpm_ref.nclaw.study import training
from mpm_ref.rom.study import reduce
from mpm_ref.training import import_with_torch


@pytest.mark.parametrize(("asked", "said"), [
    (training.trainer, 'laws are trained with PyTorch, which is not installed: pip install '
                     '"mpm_ref[learn]", or `make learn` in the repository; laws that were trained '
                     'run, export and plot without it'),
    (reduce.trainer, 'a network is trained with PyTorch, which is not installed: pip install '
                    '"mpm_ref[learn]", or `make learn` in the repository; or make modes, which '
                    'need none: --kind modes'),
])
def test_without_pytorch_one_sentence_says_what_to_do(without_torch, asked, said):
    with pytest.raises(ValueError, match="PyTorch") as refusal:
        asked()
    assert str(refusal.value) == said


def test_another_module_that_is_missing_is_named():
    with pytest.raises(ModuleNotFoundError, match=r"mpm_ref\.nclaw\.train\.unheard"):
        import_with_torch("nclaw.train.unheard", "it is made", "")


def test_with_pytorch_the_part_is_there():
    pytest.importorskip("torch")
    assert training.trainer().__name__ == "mpm_ref.nclaw.train.train"
    assert reduce.trainer().__name__ == "mpm_ref.rom.train.settings"


def test_what_is_taken_away_for_a_test_comes_back():
    pytest.importorskip("torch")
    fit = importlib.import_module("mpm_ref.rom.train.decoder")
    with pytest.MonkeyPatch.context() as monkeypatch:
        hide(monkeypatch)
        assert not hasattr(rom.train, "decoder")
        with pytest.raises(ValueError, match="PyTorch"):
            reduce.trainer()
        assert importlib.import_module("mpm_ref.rom.train.schedule")
    assert rom.train.decoder is fit is importlib.import_module("mpm_ref.rom.train.decoder")
