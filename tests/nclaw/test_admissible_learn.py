"""Laws that thermodynamics admits as they are trained: exact gradients, what is stored answers
alike, a training. Needs PyTorch.
"""

import numpy as np
import pytest
from adjoints import rate
from admissible_toys import tuples
from nclaw_toys import cube

from tests.nclaw.test_admissible import strained
from tests.nclaw.test_invariants import REPEATED, built

torch = pytest.importorskip("torch")

from mpm_ref.core.law import kirchhoff, returned  # noqa: E402
from mpm_ref.materials.learned import learned_flow, learned_law  # noqa: E402
from mpm_ref.materials.learned.contraction import Contraction  # noqa: E402
from mpm_ref.materials.learned.energetic import Energetic  # noqa: E402
from mpm_ref.materials.learned.weights import LearnedLaws, load, save  # noqa: E402
from mpm_ref.nclaw.batched_step import make_world  # noqa: E402
from mpm_ref.nclaw.train.admissible_laws import START  # noqa: E402
from mpm_ref.nclaw.train.fit import train  # noqa: E402
from mpm_ref.nclaw.train.observations import trajectory_of  # noqa: E402
from mpm_ref.nclaw.train.recipe import Recipe  # noqa: E402
from mpm_ref.nclaw.train.rollout import segment_errors  # noqa: E402
from mpm_ref.nclaw.train.train import drawn_laws  # noqa: E402
from mpm_ref.trajectories import observed  # noqa: E402
from validation.nclaw.trained_laws import nets  # noqa: E402
from validation.training.nclaw import untrained_laws  # noqa: E402

pytestmark = pytest.mark.usefixtures("one_torch_thread")

H = 1e-3 * 0.5 ** np.arange(5)
STEPS = 6
PARTS = "elastic", "plastic"
SPHERES = "I", "1.01 I"     # where the size of the deviator has a kink


@pytest.fixture
def laws():
    """Laws that bend and flow, unlike those that training begins with."""
    made = drawn_laws("admissible", 0, Energetic(1e5), Contraction(1e-2))
    torch.manual_seed(1)
    with torch.no_grad():
        for own in (*made.elastic.parameters(), *made.plastic.parameters()):
            own += 0.3 * torch.randn_like(own)
        made.plastic.net.layers[-1].bias[:] = -1.0
    return made


@pytest.fixture(scope="module")
def run():
    """`World` and `Trajectory` of a small cube."""
    problem = cube(STEPS)
    return make_world(problem), trajectory_of(observed(problem))


@pytest.mark.parametrize(("part", "stretches"), [
    (part, name) for part in PARTS for name in ("generic", *REPEATED)
    if part == "elastic" or name not in SPHERES])
def test_gradient_is_exact(laws, part, stretches, rng):
    """Through measures or strains, network and answer; equal stretches are no kink, unless all are.
    """
    law, F = getattr(laws, part), built(stretches, 5, 3, rng)
    G, dF = (torch.from_numpy(a) for a in rng.normal(size=(2, *F.shape)))
    F = torch.from_numpy(F).requires_grad_()
    slope, = torch.autograd.grad((G * law(F)).sum(), F)

    def moved(h):
        with torch.no_grad():
            return float((G * law(F + h * dF)).sum())

    assert rate(moved, float((slope * dF).sum()), H) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("turned", [(1, 0), (0, 1), (1, 1)], ids=["elastic", "plastic", "both"])
def test_remainder_is_of_second_order_in_the_weights(laws, run, turned):
    """Through all steps of a segment."""
    own = [list(law.parameters()) for law in laws]
    torch.manual_seed(2)
    flat = [a for some in own for a in some]
    start = [a.detach().clone() for a in flat]
    way = [on * torch.randn_like(a) for some, on in zip(own, turned, strict=True) for a in some]
    slopes = torch.autograd.grad(segment_errors(laws, *run, [0], [STEPS]).loss, flat)

    def loss(h):
        with torch.no_grad():
            for a, first, da in zip(flat, start, way, strict=True):
                a[:] = first + h * da
            return segment_errors(laws, *run, [0], [STEPS]).loss.item()

    slope = sum((g * da).sum() for g, da in zip(slopes, way, strict=True)).item()
    assert rate(loss, slope, H) == pytest.approx(2.0, abs=0.1)


def test_stored_laws_answer_as_the_trained_ones(laws, tmp_path, rng):
    save(tmp_path / "laws.npz", LearnedLaws(*(law.weights() for law in laws), {}))
    back, F = load(tmp_path / "laws.npz"), strained(rng)
    law, flow = learned_law(back.elastic), learned_flow(back.plastic)
    with torch.no_grad():
        tau, left = (own(torch.from_numpy(F)).numpy() for own in laws)
    found = np.array([kirchhoff(tuples(A), law) for A in F])
    assert abs(found - tau).max() < 1e-12 * abs(tau).max()
    assert np.array([returned(tuples(A), flow) for A in F]) == pytest.approx(left, abs=1e-13)
    assert abs(left - F).max() > 0.01


def test_training_begins_near_its_unit_and_with_little_flow(rng):
    net = nets()["plasticine-admissible"]
    laws = untrained_laws(net)
    law = learned_law(laws.elastic.weights())
    assert (net.elastic, net.plastic) == ("Energetic", "Contraction")
    assert 0.1 < law.mu / Energetic().unit < 10.0
    F = torch.from_numpy(strained(rng))
    with torch.no_grad():
        left = laws.plastic(F)
    assert 0.0 < (left - F).abs().max() < 10.0 * START


def test_training_lowers_the_error(run):
    recipe = Recipe(epochs=15, first=3, last=3, elastic_rate=0.1, plastic_rate=0.01)
    history = train(recipe, drawn_laws("admissible", 0, Energetic(), Contraction()), *run).history
    assert history[-1].error < 0.3 * history[0].error
