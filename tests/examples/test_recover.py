"""The example that recovers moduli from motion."""

from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def example(monkeypatch):
    """The example as a module."""
    monkeypatch.syspath_prepend(ROOT / "examples")
    import recover_moduli
    return recover_moduli


def test_its_gradient_is_that_of_its_loss(example, monkeypatch):
    monkeypatch.setattr(example, "OBSERVED", (10, 30))
    monkeypatch.setattr(example, "STEPS", 30)
    _, truth = example.run(example.make_law("fixed_corotated", E=1e5, nu=0.3))
    at, along = np.log((2e4, 1e4)), np.array((0.6, -0.8))
    _, gradient = example.loss(at, truth)
    h = 1e-4
    after, before = (example.loss(at + k * h * along, truth)[0] for k in (1.0, -1.0))
    assert (after - before) / (2.0 * h) == pytest.approx(gradient @ along, rel=1e-6)


def test_it_finds_the_moduli(example):
    """Seen: to 1e-11, in 19 runs."""
    done, (E, nu) = example.recover()
    assert done.fun < 1e-16
    assert (E, nu) == pytest.approx(example.TRUE, rel=1e-9)
    assert done.nfev <= 40


def test_the_page_on_gradients_runs_as_it_is_printed(monkeypatch, capsys):
    text = (ROOT / "docs/howto/gradients.md").read_text(encoding="utf-8")
    monkeypatch.chdir(ROOT)
    exec(compile(text.split("```python\n")[1].split("```")[0], "gradients.md", "exec"), {})
    assert "FixedCorotated(mu=-" in capsys.readouterr().out
