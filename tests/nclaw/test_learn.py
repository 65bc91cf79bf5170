"""Neural laws as they are trained: teacher, networks, answers, rollouts and their gradients. Needs
PyTorch.
"""

from itertools import pairwise
from math import erf, sqrt

import numpy as np
import pytest
from adjoints import rate
from nclaw_toys import LAW, cube

from tests.nclaw.test_invariants import near_rest, turns

torch = pytest.importorskip("torch")

from mpm_ref.materials.learned.contraction import Contraction  # noqa: E402
from mpm_ref.materials.learned.energetic import Energetic  # noqa: E402
from mpm_ref.materials.learned.response import (  # noqa: E402
    Correction,
    PlainCorrection,
    PlainStress,
    Stress,
    SymmetricStress,
)
from mpm_ref.nclaw.batched_step import make_world  # noqa: E402
from mpm_ref.nclaw.train.autograd import Invariants  # noqa: E402
from mpm_ref.nclaw.train.fit import TrajectorySession  # noqa: E402
from mpm_ref.nclaw.train.neural_laws import (  # noqa: E402
    MultilayerPerceptron,
    NeuralLawModule,
    describe,
    layers_of,
    neural_laws,
)
from mpm_ref.nclaw.train.observations import trajectory_of  # noqa: E402
from mpm_ref.nclaw.train.recipe import (  # noqa: E402
    Recipe,
    TeacherForcing,
)
from mpm_ref.nclaw.train.rollout import DEFAULT, LawPair, segment_errors  # noqa: E402
from mpm_ref.nclaw.train.train import continued_laws, drawn_laws, learned_laws  # noqa: E402
from mpm_ref.scene import build  # noqa: E402
from mpm_ref.trajectories import observed  # noqa: E402
from validation.nclaw.environments import environment, trajectory  # noqa: E402

STEPS = 9
H = 1e-3 * 0.5 ** np.arange(5)      # of Taylor tests; the smaller, the smaller faults are seen
STIFF = Stress(1e5), Correction(0.1)        # answers that matter, of weights that begin near one

pytestmark = pytest.mark.usefixtures("one_torch_thread")


@pytest.fixture(scope="module")
def run():
    """`World` and `Trajectory` of a small cube."""
    problem = cube(STEPS)
    return make_world(problem), trajectory_of(observed(problem))


# The teacher.

def test_horizons_of_the_paper():
    """NCLAW-train: of 1000 steps, 40 segments of 25 at first and 6 at last, never 5."""
    cuts = [TeacherForcing().restarts(1000, epoch, 300) for epoch in range(300)]
    assert cuts[0] == list(range(0, 1001, 25))
    assert sorted(np.diff(cuts[-1]).tolist()) == [166, 166, 167, 167, 167, 167]
    assert (np.diff([len(cut) for cut in cuts]) <= 0).all()
    for cut in cuts:
        lengths = np.diff(cut)
        assert (cut[0], cut[-1]) == (0, 1000)
        assert lengths.min() >= lengths.max() - 1 > 0


def test_horizons_grow_by_half_a_cosine():
    found = [TeacherForcing(25, 200).horizon(epoch, 300) for epoch in (0, 100, 150, 200, 300)]
    assert found == pytest.approx([25.0, 68.75, 112.5, 156.25, 200.0])


def test_restarts_are_those_of_the_release():
    """Where floor(linspace(0, segments, steps)) changes, the segments ceil(steps/horizon)."""
    for steps, epoch in ((1000, 137), (333, 0), (26, 0), (50, 0)):
        count = -(-steps // TeacherForcing().horizon(epoch, 300))
        part = [n * count // steps for n in range(steps)]
        expected = [n for n in range(1, steps) if part[n] > part[n - 1]]
        assert TeacherForcing().restarts(steps, epoch, 300) == [0, *expected, steps]


@pytest.mark.parametrize(("steps", "expected"), [(1, [0, 1]), (3, [0, 1, 2, 3]), (25, [0, 25])])
def test_restarts_of_short_trajectories(steps, expected):
    horizon = 1 if steps == 3 else 25
    assert TeacherForcing(horizon, 200).restarts(steps, 0, 300) == expected


# The recipe.

def test_readings_of_the_loss():
    """The release's loss is not printed: 1e4 segments/steps times the sum over steps."""
    assert Recipe().weight(40, 1000) == pytest.approx(400.0)
    assert Recipe(scale=2.0).weight(6, 1000) == pytest.approx(0.012)
    assert Recipe(reading="printed", scale=2.0).weight(6, 1000) == pytest.approx(1e-3)
    assert Recipe(first=3, last=7).teacher == TeacherForcing(3, 7)


def test_the_recipe_is_that_of_the_paper():
    """NCLAW-train."""
    r = Recipe()
    assert (r.epochs, r.elastic_rate, r.plastic_rate, r.clip) == (300, 1.0, 0.1, 0.1)
    assert (r.teacher, r.reading, r.scale, r.seed) == (TeacherForcing(25, 200), "release", 1e4, 0)


@pytest.mark.parametrize(("settings", "said"), [
    *(({name: value}, f"^{name} = {value}: expected a number >= 0$")
      for name in ("velocity", "idempotence") for value in (-1e-9, float("inf"), float("nan"))),
    *(({name: 0}, f"^{name} = 0: expected at least 1$")
      for name in ("epochs", "first", "last", "batch")),
    *(({name: value}, f"^{name} = {value}: expected a positive number$")
      for name in ("elastic_rate", "plastic_rate", "clip", "scale") for value in (0.0, -1.0)),
    ({"clip": float("nan")}, "^clip = nan: expected a positive number$"),
    *(({"seed": seed}, f"^seed = {seed}: expected 0 .. 4294967295$") for seed in (-1, 2**32)),
    ({"reading": "both"}, "^reading = 'both': expected release or printed$"),
])
def test_settings_that_mean_nothing_are_refused(settings, said):
    with pytest.raises(ValueError, match=said):
        Recipe(**settings)


# Networks.

def parameters(laws):
    return [a for law in laws for a in law.parameters()]


def test_two_laws_have_the_papers_number_of_weights():
    """NCLAW-arch; 9600 in 2D."""
    kinds = Stress(), Correction()
    assert sum(a.numel() for a in parameters(neural_laws(0, *kinds))) == 11_008
    assert sum(a.numel() for a in parameters(neural_laws(0, *kinds, dim=2))) == 9_600


def test_equal_seeds_draw_equal_weights():
    first, again, other = (parameters(neural_laws(seed, *STIFF)) for seed in (3, 3, 4))
    assert all(map(torch.equal, first, again))
    assert not any(map(torch.equal, first, other))
    assert not any(map(torch.equal, first[:3], first[3:]))
    for a in first:
        most = sqrt(6.0 / sum(a.shape))         # Xavier's
        assert 0.9 * most < a.abs().max() <= most


@pytest.mark.parametrize("bias", [False, True])
def test_exported_layers_are_those_of_the_network(bias, rng):
    net, a = MultilayerPerceptron(7, 4, (6, 5), bias), rng.normal(size=(9, 7))
    with torch.no_grad():
        for layer in net.layers if bias else ():
            layer.bias += torch.rand(len(layer.bias))
        expected = net(torch.from_numpy(a).float())
    layers = layers_of(net)
    assert [(W.shape, b.shape) for W, b in layers] == [
        ((n, m), (m,)) for n, m in pairwise((7, 6, 5, 4))]
    for k, (W, b) in enumerate(layers):
        assert W.dtype == b.dtype == float
        a = a @ W + b
        if k < 2:
            a = 0.5 * a * (1.0 + np.vectorize(erf)(a / sqrt(2.0)))      # GELU
    assert a == pytest.approx(expected.numpy(), abs=1e-5)


def test_a_law_says_what_it_is_as_plain_arrays():
    law = NeuralLawModule(SymmetricStress(2.0))
    found = law.weights()
    assert found.kind == SymmetricStress(2.0)
    for (W, b), layer in zip(found.layers, law.net.layers, strict=True):
        assert np.array_equal(W.T, layer.weight.detach().numpy())
        assert not b.any()


# Laws.

def test_laws_leave_a_body_at_rest_alone(d, rng):
    """NCLAW-rest, for the weights of any seed: E(R) = 0 and P(R) = R."""
    elastic, plastic = neural_laws(1, Stress(), Correction(), d)
    one, Q = torch.eye(d).double()[None], torch.from_numpy(turns(5, d, rng))
    with torch.no_grad():
        assert not elastic(one).any()
        assert torch.equal(plastic(one), one)
        assert elastic(Q).abs().max() < 1e-13
        assert (plastic(Q) - Q).abs().max() < 1e-15


def test_laws_turn_with_the_body(d, rng):
    """NCLAW-eq33 to NCLAW-eq37; networks are of single precision."""
    laws = neural_laws(1, Stress(), Correction(1.0), d)
    F, Q = (torch.from_numpy(a) for a in (near_rest(5, d, rng), turns(5, d, rng)))
    with torch.no_grad():
        tau, turned = laws.elastic(F), laws.elastic(Q @ F)
        assert tau.abs().max() > 0.03
        assert turned.numpy() == pytest.approx((Q @ tau @ Q.mT).numpy(), abs=1e-6)
        assert laws.plastic(Q @ F).numpy() == pytest.approx((Q @ laws.plastic(F)).numpy(), abs=1e-6)
        assert (laws.plastic(F) - F).abs().max() > 0.03


# Rollouts.

def J(F):
    return torch.det(F)[:, None, None]


def jelly(F):
    """The law of `nclaw_toys` (NCLAW-eq12), exactly."""
    R = Invariants.apply(F)[1]
    return 2.0 * LAW.mu * (F - R) @ F.mT + LAW.lam * (J(F) - 1.0) * J(F) * torch.eye(3)


def test_with_the_exact_law_nothing_is_off(run):
    """NCLAW-alg2 is NCLAW-alg1 then; a law that is a little off is told."""
    error = segment_errors(LawPair(jelly, lambda F: F), *run, [0, 3], [3, STEPS]).loss
    assert error < 1e-26
    stiffer = LawPair(lambda F: 1.01 * jelly(F), lambda F: F)
    assert segment_errors(stiffer, *run, [0, 3], [3, STEPS]).loss > 1e-16


def test_segments_do_not_know_each_other(run):
    """Nor how many run beside them, or how long those are."""
    laws = neural_laws(0, *STIFF)
    with torch.no_grad():
        parts = [segment_errors(laws, *run, [a], [b]).loss for a, b in ((0, 2), (2, 7), (7, STEPS))]
        together = segment_errors(laws, *run, [0, 2, 7], [2, 7, STEPS]).loss
        assert min(parts) > 0.0
        assert together.item() == pytest.approx(sum(parts).item(), rel=1e-6)


def test_what_would_become_of_a_segment_after_its_end_does_not_matter(run):
    """One that is swollen, and then more, until a law has no answer."""
    (world, data), laws = run, neural_laws(0, *STIFF)
    data = data._replace(F=torch.cat([2.0 * data.F[:1], data.F[1:]]))
    broken = LawPair(lambda F: torch.where(J(F) > 30.0, torch.nan, laws.elastic(F)),
                  lambda F: torch.where(J(F) > 5.0, 2.0 * F, laws.plastic(F)))
    together = segment_errors(broken, world, data, [0, 1], [1, 4]).loss
    parts = sum(segment_errors(broken, world, data, [a], [b]).loss for a, b in ((0, 1), (1, 4)))
    assert together.item() == pytest.approx(parts.item(), rel=1e-6)
    for a, b in zip(*(torch.autograd.grad(loss, parameters(laws)) for loss in (together, parts))):
        assert (a - b).norm() < 1e-5 * b.norm()


@pytest.mark.parametrize(("method", "kinds", "off"), [
    ("ours", STIFF, 0.0), ("admissible", (Energetic(2e4), Contraction(0.02)), 1e-15)])
def test_a_training_goes_on_from_stored_laws(method, kinds, off):
    """With their weights to the bit, in the precision of networks, of an energy to round-off of
    logarithms; of these methods alone.
    """
    laws = drawn_laws(method, 3, *kinds)
    with torch.no_grad():
        for b in parameters(laws):
            b.add_(torch.full_like(b, 0.125))       # biases, too
    stored = learned_laws(laws, {})
    resumed = continued_laws(method, stored)
    for a, b in zip(parameters(laws), parameters(resumed), strict=True):
        assert (a - b).abs().max() <= off * a.abs().max()
    assert [law.kind for law in resumed] == [*kinds]
    assert describe(resumed.elastic)[:-1] == describe(laws.elastic)
    assert describe(resumed.elastic)[-1] != describe(resumed.plastic)[-1]
    for name, others in (("no rotation", (PlainStress(1e5), PlainCorrection(0.1))),
                         ("no undeformed", STIFF)):
        other = learned_laws(drawn_laws(name, 0, *others), {})
        with pytest.raises(ValueError, match="expected those of the method 'ours'"):
            continued_laws("ours", other)
    for other in {"ours", "admissible"} - {method}:
        with pytest.raises(ValueError, match=f"expected those of the method '{other}'"):
            continued_laws(other, stored)


@pytest.mark.parametrize("every", [2, 3, STEPS])
def test_states_between_are_computed_anew(run, every):
    """The loss is the same to the bit, gradients to round-off, whatever states are kept."""
    found = {}
    for keep_every in (1, every):
        laws = neural_laws(0, *STIFF)
        errors = segment_errors(laws, *run, [0, 2], [2, STEPS],
                                Recipe(keep_every=keep_every, velocity=1e-4, idempotence=1.0))
        errors.loss.backward()
        found[keep_every] = errors, [a.grad for a in parameters(laws)]
        assert not errors.positions.requires_grad
    (all_kept, gradients_), (few_kept, others) = found[1], found[every]
    assert all_kept.loss.item() == few_kept.loss.item() > 0.0
    assert all_kept.positions.item() == few_kept.positions.item()
    for a, b in zip(gradients_, others, strict=True):
        assert a.norm() > 0.0
        assert (a - b).norm() < 1e-6 * a.norm()


def test_errors_are_means_over_particles_and_axes(run):
    world, observed = run
    moved = observed._replace(x=observed.x + torch.tensor([3e-3, 0.0, 0.0]))
    state = LawPair(jelly, lambda F: F)
    error = segment_errors(state, world, moved._replace(x=torch.cat([observed.x[:1], moved.x[1:]])),
                    [0], [4])
    assert error.loss.item() == pytest.approx(4 * 3e-6, rel=1e-9)


def test_errors_of_velocities_count_as_told(run):
    """In the loss, beside those of positions, times their weight [s^2]."""
    world, observed = run
    moved = observed._replace(v=observed.v + torch.tensor([0.0, 0.3, 0.0]))
    slower = observed._replace(v=torch.cat([observed.v[:1], moved.v[1:]]))
    found = segment_errors(LawPair(jelly, lambda F: F), world, slower, [0], [4],
                           Recipe(velocity=1e-4))
    assert found.loss.item() == pytest.approx(4 * 1e-4 * 0.03, rel=1e-9)
    assert found.positions < 1e-26


def gradients(laws, run, cuts, recipe=DEFAULT):
    """Loss, and gradients of all weights."""
    loss = segment_errors(laws, *run, cuts[:-1], cuts[1:], recipe).loss
    return loss, torch.autograd.grad(loss, parameters(laws))


def doubled(laws):
    return LawPair(*(law.double() for law in laws))


@pytest.mark.usefixtures("double")
@pytest.mark.parametrize(("kind", "recipe"), [
    (Stress(1e5), DEFAULT), (SymmetricStress(1e5), DEFAULT),
    (Stress(1e5), Recipe(idempotence=1.0))], ids=["paper", "symmetric", "idempotence"])
def test_remainder_is_of_second_order_in_the_weights(run, kind, recipe):
    """Through all steps of a segment, networks of doubles; each law by itself, and both."""
    laws, cuts = doubled(neural_laws(0, kind, STIFF[1])), [0, STEPS]
    slopes = gradients(laws, run, cuts, recipe)[1]
    start = [a.detach().clone() for a in parameters(laws)]
    for turned in ([1, 1, 1, 0, 0, 0], [0, 0, 0, 1, 1, 1], [1] * 6):
        torch.manual_seed(1)
        direction = [on * a.std() * torch.randn_like(a) for on, a in zip(turned, start)]

        def loss(h, direction=direction):
            with torch.no_grad():
                for a, first, da in zip(parameters(laws), start, direction):
                    a[:] = first + h * da
                return segment_errors(laws, *run, cuts[:-1], cuts[1:], recipe).loss.item()

        slope = sum((g * da).sum() for g, da in zip(slopes, direction)).item()
        assert rate(loss, slope, H) == pytest.approx(2.0, abs=0.1)
        assert abs(loss(1.0) - loss(0.0)) > 1e-3 * loss(0.0)


def test_gradients_in_single_precision_are_those_in_double(run, monkeypatch):
    found = gradients(neural_laws(0, *STIFF), run, [0, 4, STEPS])[1]
    monkeypatch.setattr(torch.Tensor, "float", torch.Tensor.double)
    exact = gradients(doubled(neural_laws(0, *STIFF)), run, [0, 4, STEPS])[1]
    for a, b in zip(found, exact):
        assert 0.0 < (a - b).norm() < 1e-5 * b.norm()


# NCLaw's own numbers.

@pytest.mark.slow
def test_the_first_epoch_of_jelly_is_that_of_the_release():
    """Loss and norms of the gradients that the authors' code prints with four digits: 1000 steps in
    40 segments. Theirs is of single precision: positions are off by 3e-8 m a step, beside errors
    of 1e-3 m, which is as much as their last digit.
    """
    laws = neural_laws(0, Stress(), Correction())
    session = TrajectorySession(Recipe(), laws, make_world(build(environment("jelly"))),
                      trajectory_of(trajectory("jelly")))
    session.epoch()
    found = session.history[0]
    assert found.segments == 40
    assert found.loss == pytest.approx(0.3818, abs=1e-4)
    assert found.loss == pytest.approx(400.0 * 1000.0 * found.error)
    assert found.steepness == pytest.approx((4.949e-6, 6.396e-9), rel=1e-4)
