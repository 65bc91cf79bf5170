"""The benchmark scenes of HOT: that they build, stand well, have the printed sizes, and step."""

from math import inf

import numpy as np
import pytest

from mpm_ref.preflight import misplaced
from mpm_ref.scene import build
from mpm_ref.simulate import simulate
from validation.common import targets
from validation.common.scenes import SCENES, catalogue_scene, with_
from validation.hot.settings import PARTS, UNCOUNTED
from validation.hot.sizes import FILL, SIZES, Size, entered, sized
from validation.hot.stretched_box import HIGH, LOW, VARIANTS, stretched

pytestmark = pytest.mark.slow

PER_CELL = {            # of the release, where it is not 8 for all bodies
    "hot_armacat": {"trampoline": 16}, "hot_boards": {"grains": 16}, "hot_faceless": {"bust": 20},
    "hot_sauce": {"sauce": 16}, "hot_wheel": {"wheel": 12},
}
FULL = "hot_stiffness"  # has all of its 12 particles per cell
OVERLAP = "hot_twist"   # its balls are where its pillars are, as in the release
ELSEWHERE = {"hot_stiffness", "hot_aluminium"}      # no number to compare with
WARM = 0.6              # time by which sizes count poured particles [s]


def count(scene, t, but=()):
    return sum(entered(body, t) for body in scene.body if body.name not in but)


def test_every_scene_has_its_sizes():
    assert set(SIZES) == {file.stem for file in SCENES.glob("hot_*.toml")}
    assert set(SIZES) >= {f"hot_{name}" for name in PARTS}


@pytest.mark.parametrize("name", SIZES)
def test_scene_is_bundled_at_its_quick_size(name):
    assert sized(name, "quick") == catalogue_scene(name)
    assert 3000 <= count(sized(name, "quick"), WARM) <= 6000
    assert 15_000 <= count(sized(name, "standard"), WARM) <= 60_000


@pytest.mark.parametrize("name", sorted(set(SIZES) - ELSEWHERE))
def test_paper_size_has_about_the_printed_particles(name):
    printed, scene = targets.load(), sized(name, "paper")
    table = f"hot.table2.{name.removeprefix('hot_')}"
    expected = printed[f"{table}.particles"].value
    # stand-ins have not the volume of the meshes, nor ours the random radii of the release
    assert count(scene, inf, UNCOUNTED) == pytest.approx(expected, rel=0.07)
    assert scene.dx == pytest.approx(printed[f"{table}.dx"].value, rel=0.01)    # print is rounded


def test_sources_enter_block_by_block():
    grains, board = catalogue_scene("hot_boards").body[:2]
    assert [entered(grains, t) for t in (0.0, 0.119, 0.12, inf)] == [151, 151, 302, 35 * 151]
    assert entered(board, 0.0) == entered(board) == board.sampling.count
    late = with_(grains, source=with_(grains.source, start=1.0))
    assert [entered(late, t) for t in (0.9, 1.0)] == [0, 151]
    problem = build(catalogue_scene("hot_sauce"))
    assert problem.sources[0].particles == entered(catalogue_scene("hot_sauce").body[0])


def test_sizes_are_refused_in_a_sentence():
    with pytest.raises(ValueError, match="prints no size"):
        sized("hot_aluminium", "paper")
    for name, profile in (("hot_cube", "quick"), ("hot_twist", "small")):
        with pytest.raises(ValueError, match=f"{name}.*{profile}.*expected one of"):
            sized(name, profile)
    assert Size._fields == ("quick", "standard", "paper")


@pytest.mark.parametrize("name", SIZES)
def test_scene_is_filled_stands_and_steps(name):
    problem = build(catalogue_scene(name, steps=2, end=None, interval=None))
    assert_filled(name, problem)
    assert_stands(name, problem)
    assert_converges(problem)


def assert_filled(name, problem):
    """Particles per cell are those of the release."""
    share = 1.0 if name == FULL else FILL
    for body in problem.bodies:
        per_cell = 12 if name == FULL else PER_CELL.get(name, {}).get(body.name, 8)
        cells = body.particles.V0.sum() / problem.dx**3
        assert len(body.particles.x) == pytest.approx(share * per_cell * cells, abs=1.0)


def assert_stands(name, problem):
    """No body starts in another, or in a solid, but for those that are meant to."""
    sentences = misplaced(problem)
    if name == OVERLAP:
        assert sentences.pop().startswith("bodies 'pillars' and 'balls' overlap at the start")
    assert sentences == []


def assert_converges(problem):
    """Both steps."""
    reports = []
    for _ in simulate(problem, on_step=lambda state, dt: reports.append(state.solve)):
        pass
    assert [r.converged for r in reports] == [True, True]


@pytest.mark.parametrize("variant", VARIANTS)
def test_stretched_box_is_stretched_along_the_axes(variant):
    box = stretched(variant, dx=0.25).bodies[0]
    F = box.particles.F
    stretches = np.einsum("pii->pi", F)
    assert np.array_equal(F, stretches[:, :, None] * np.eye(3))
    assert LOW <= stretches.min() < stretches.max() <= HIGH
    assert len(np.unique(stretches)) == (3 if variant == "body" else 3 * len(box.id))
    assert len(box.id) == 8 * 4**3


def test_stretched_box_relaxes():
    frames = list(simulate(stretched("body", dx=0.25)))
    assert frames[-1].dt == 1.0 / 24.0
    assert frames[-1].state.solve.converged
    with pytest.raises(ValueError, match="'cell': expected one of"):
        stretched("cell")
