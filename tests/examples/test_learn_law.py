"""The example that learns a small law by a loss of its own, and the page that shows how."""

import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def example(monkeypatch, one_torch_thread):
    """The example as a module."""
    monkeypatch.syspath_prepend(ROOT / "examples")
    import learn_small_law
    return learn_small_law


@pytest.fixture
def short(example, monkeypatch):
    """It, with fewer steps."""
    monkeypatch.setattr(example, "STEPS", 20)
    monkeypatch.setattr(example, "OBSERVED", (8, 20))
    return example


def test_its_gradient_is_that_of_its_loss(short):
    """By all weights together."""
    torch = pytest.importorskip("torch")
    torch.manual_seed(0)
    law, corner_loss = short.SmallLaw(), short.CornerLoss(short.thrown_cube())
    weights = torch.nn.utils.parameters_to_vector(law.parameters()).detach()
    assert weights.numel() == 42
    along, h = torch.randn_like(weights), 1e-4
    slope = torch.autograd.grad(corner_loss(law), list(law.parameters()))
    expected = (torch.cat([a.flatten() for a in slope]) @ along).item()
    ends = []
    for k in (1.0, -1.0):
        torch.nn.utils.vector_to_parameters(weights + k * h * along, law.parameters())
        ends.append(corner_loss(law).item())
    assert (ends[0] - ends[1]) / (2.0 * h) == pytest.approx(expected, rel=1e-6)


def test_the_start_has_a_gradient_too(short):
    """As docs/howto/gradients.md says: here by the velocity of one particle."""
    torch = pytest.importorskip("torch")
    torch.manual_seed(0)
    law, corner_loss = short.SmallLaw(), short.CornerLoss(short.thrown_cube())

    def loss(v):
        corner_loss.run = start._replace(v=torch.cat([v[None], start.v[1:]]))
        return corner_loss(law)

    start, ends = corner_loss.run, []
    v = start.v[0].clone().requires_grad_()
    slope, = torch.autograd.grad(loss(v), [v])
    for h in (1e-3, -1e-3):
        shifted = start.v[0].clone()
        shifted[3, 1] += h
        ends.append(loss(shifted).item())
    assert (ends[0] - ends[1]) / 2e-3 == pytest.approx(slope[3, 1].item(), rel=1e-6)


def test_it_learns_the_law(example):
    """Observed: the loss falls to 2e-4 of itself, mu is off by 2 %, k by 5 %, the stress by 5 %."""
    law, losses = example.learn()
    found, true, error = example.compare(law)
    assert losses[-1] < 1e-3 * losses[0]
    assert found == pytest.approx(true, rel=0.15)
    assert error < 0.15


def test_without_pytorch_one_sentence_says_so(monkeypatch, without_torch):
    monkeypatch.syspath_prepend(ROOT / "examples")
    monkeypatch.delitem(sys.modules, "learn_small_law", raising=False)
    with pytest.raises(SystemExit, match="learns with PyTorch, which is not installed: pip"):
        import learn_small_law  # noqa: F401


def test_the_page_on_gradients_runs_as_it_is_printed(monkeypatch, one_torch_thread):
    text = (ROOT / "docs/howto/gradients.md").read_text(encoding="utf-8")
    monkeypatch.chdir(ROOT)
    shown = {}
    exec(compile(text.split("```python\n")[2].split("```")[0], "gradients.md", "exec"), shown)
    for law in shown["laws"]:
        for weight in law.parameters():
            assert 0.0 < weight.grad.norm().item() < np.inf
