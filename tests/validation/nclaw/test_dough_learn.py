"""Laws that learn from a film: what counts, what is known, gradients, a training. Needs PyTorch."""

import numpy as np
import pytest
from adjoints import rate

torch = pytest.importorskip("torch")

from mpm_ref.materials.learned.contraction import Contraction  # noqa: E402
from mpm_ref.materials.learned.energetic import Energetic  # noqa: E402
from mpm_ref.nclaw.batched_step import make_world  # noqa: E402
from mpm_ref.nclaw.camera import project  # noqa: E402
from mpm_ref.nclaw.train.fit import Epoch, train  # noqa: E402
from mpm_ref.nclaw.train.identified_laws import IdentifiedFlow, IdentifiedLaw  # noqa: E402
from mpm_ref.nclaw.train.observations import observe_images  # noqa: E402
from mpm_ref.nclaw.train.recipe import (  # noqa: E402
    Recipe,
    TeacherForcing,
)
from mpm_ref.nclaw.train.rollout import LawPair, segment_errors  # noqa: E402
from mpm_ref.nclaw.train.train import drawn_laws  # noqa: E402
from mpm_ref.training import Diverged  # noqa: E402
from validation.common.weights_needed import Untrained  # noqa: E402
from validation.nclaw import dough  # noqa: E402
from validation.nclaw.trained_laws import diverged  # noqa: E402
from validation.training import dough as dough_training  # noqa: E402
from validation.training.nclaw import main  # noqa: E402

pytestmark = pytest.mark.usefixtures("one_torch_thread")

VELOCITIES = Recipe(velocity=1.0)
STEPS = 36          # the corner hits the floor at about half of them
H = 1e-3 * 0.5 ** np.arange(5)


@pytest.fixture(scope="module")
def true():
    """`Problem` and `cases.Observed` of the block."""
    return dough_training.run_of()


@pytest.fixture(scope="module")
def seen():
    """`World` and `Film` of the block."""
    return dough_training.training_data()


def exact(problem):
    """The true laws, in PyTorch."""
    body, = problem.bodies
    unit = type(body.law)(*(a / dough.E for a in body.law))
    elastic = IdentifiedLaw(unit, np.log(dough.E))
    return LawPair(elastic, IdentifiedFlow(elastic, body.flow))


def cut(film, steps):
    """The beginning of a film."""
    return film._replace(x=film.x[:steps + 1], weight=film.weight[:steps + 1])


def admissible():
    return drawn_laws("admissible", 0, Energetic(1e3), Contraction())


def test_with_the_true_laws_noise_is_left(true, seen):
    """The mean over steps is that over frames of the squared noise in the image."""
    (problem, run), (where, film) = true, seen
    assert film.weight.sum() == dough.EVERY * (1 + dough.FRAMES)
    with torch.no_grad():
        error = segment_errors(exact(problem), where, film, [0], [STEPS]).loss.item()
    marks = dough.observe(run.x[::dough.EVERY])
    frames = slice(1, 1 + STEPS // dough.EVERY)
    noise = marks.places - project(dough.camera(), run.x[::dough.EVERY][:, marks.points])
    expected = (noise[frames] ** 2).sum(axis=2).mean()
    assert error / STEPS == pytest.approx(expected, rel=1e-5)


def test_velocities_count_in_depth_alone(true, seen):
    """And of all points, at every step."""
    (problem, run), (where, film) = true, seen
    with torch.no_grad():
        laws = exact(problem)
        with_it, without = (
            segment_errors(laws, where, film, [0], [STEPS], Recipe(velocity=weight)).loss.item()
            for weight in (3.0, 0.0))
    depth = (run.v[1:STEPS + 1, :, 2] ** 2).mean(axis=1).sum()
    assert with_it - without == pytest.approx(3.0 * depth, rel=1e-6)


def test_the_state_is_known_at_the_start_alone(true, seen):
    film = seen[1]
    for a, name in zip(film.states(torch.tensor([0])), "xvCF", strict=True):
        assert np.array_equal(a[0].numpy(), getattr(true[1], name)[0])
    with pytest.raises(ValueError, match=r"levels \[25\]: images give them at level 0 alone"):
        film.states(torch.tensor([25]))


def test_horizons_grow_to_the_whole_run(seen):
    net = dough.doughs()["dough"]
    steps = len(seen[1].x) - 1
    recipe = dough_training.recipe_of(net, steps)
    ends = [seen[1].restarts(recipe.teacher.restarts(steps, epoch, net.epochs))
            for epoch in range(net.epochs)]
    assert all(start == 0 and len(rest) == 1 for start, *rest in ends)
    horizons = [end for _, end in ends]
    assert (np.diff(horizons) >= 0).all()
    assert horizons[0] == net.horizon
    assert 0.4 < horizons.count(steps) / net.epochs < 0.6
    assert recipe.teacher == TeacherForcing(net.horizon, round(1.7 * steps))


def test_what_the_film_does_not_show_is_not_trained_on(true, seen):
    """Of the run only its start and the places of marks are kept."""
    problem, run = true
    later = run.x.copy()
    marks = dough.observe(later[::dough.EVERY])
    hidden = np.setdiff1d(np.arange(later.shape[1]), marks.points)
    later[1:, hidden] = np.nan
    other = observe_images(dough.observe(later[::dough.EVERY]), dough.camera(), problem.bodies[0],
                           dough.EVERY)
    assert all(torch.equal(a, b) for a, b in zip(other, seen[1], strict=True))


def test_gradient_is_exact(seen):
    """Through camera, run and laws; the run ends on the floor."""
    (where, film), laws = seen, admissible()
    own = [a for law in laws for a in law.parameters()]
    start = [a.detach().clone() for a in own]
    torch.manual_seed(1)
    way = [torch.randn_like(a) for a in own]
    loss_now = segment_errors(laws, where, film, [0], [STEPS], VELOCITIES).loss
    slopes = torch.autograd.grad(loss_now, own)

    def loss(h):
        with torch.no_grad():
            for a, first, da in zip(own, start, way, strict=True):
                a[:] = first + h * da
            return segment_errors(laws, where, film, [0], [STEPS], VELOCITIES).loss.item()

    slope = sum((g * da).sum() for g, da in zip(slopes, way, strict=True)).item()
    assert rate(loss, slope, H) == pytest.approx(2.0, abs=0.1)


def test_training_on_a_film_lowers_the_error(seen):
    (where, film), laws = seen, admissible()
    recipe = Recipe(epochs=8, elastic_rate=0.2, plastic_rate=0.02, first=STEPS, last=STEPS,
                    reading="printed")
    history = train(recipe, laws, where, cut(film, STEPS)).history
    assert history[-1].error < 0.8 * history[0].error


def test_the_command_writes_weights_that_are_taken(tmp_path, monkeypatch):
    """With a training of one epoch."""
    short = dough.doughs()["dough"]._replace(epochs=1, guessed=1)
    monkeypatch.setattr("validation.training.nclaw.doughs", lambda: {"dough": short})
    monkeypatch.setattr(dough, "doughs", lambda: {"dough": short})
    monkeypatch.setattr("validation.nclaw.trained_laws.FOLDER", tmp_path)
    main(["dough"], tmp_path, tmp_path / "checkpoints")
    dough.trained.cache_clear()
    laws = dough.trained("dough")
    dough.trained.cache_clear()
    assert laws.elastic.kind._fields == ("unit",)
    assert len(laws.about["errors"]) == 1
    assert laws.about["command"] == "python -m validation.training.nclaw dough"
    assert make_world(dough_training.run_of()[0]).dt == pytest.approx(1.0 / 2880.0)


def test_errors_of_a_training_that_diverges_are_kept(tmp_path, monkeypatch):
    """And told where the others' errors are."""
    def diverging(recipe, laws, where, film, checkpoint, show):
        """None is shown of a training that goes on from a checkpoint, and diverges at once."""
        if not checkpoint.exists():
            show([Epoch(1.0, 1e-3, 1, (1.0, 1.0))])
        raise Diverged("epoch 2: gone")

    (tmp_path / "checkpoints").mkdir()
    (tmp_path / "checkpoints" / "dough-free.pt").write_text("an epoch")

    net = dough.doughs()["dough-free"]._replace(guessed=0)
    monkeypatch.setattr("validation.training.nclaw.doughs", lambda: {"dough-free": net})
    monkeypatch.setattr("validation.nclaw.trained_laws.FOLDER", tmp_path)
    monkeypatch.setattr(dough_training, "train", diverging)
    main(["dough-free"], tmp_path, tmp_path / "checkpoints")
    found = diverged("dough-free", dough.identity(net))
    assert (found["errors"], found["stopped"]) == ([1e-3], "epoch 2: gone")
    dough.trained.cache_clear()
    with pytest.raises(Untrained, match=r"no weights dough-free.npz: its training diverged"):
        dough.trained("dough-free")
