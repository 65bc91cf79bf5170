"""The change of a variant is that of the matter that is left, energies of a half counting twice."""

import numpy as np
import pytest
from needs_toys import HEAD, SCENE, variant_of

from mpm_ref.needs.variant import changes
from mpm_ref.scene import SceneError
from mpm_ref.sweep.observation import FINISHED, RunCost, RunObservation

TIMES = 5


def observation(**values):
    """An observation of some values (T, k) by quantity."""
    return RunObservation(values, RunCost(), FINISHED)


def positions_of(variant):
    """Positions at TIMES of all probes of a variant, each shifted to the right with time."""
    x = np.concatenate([X for _, X in variant.probes])
    return np.stack([(x + [0.1 * k, 0.0]).ravel() for k in range(TIMES)])


@pytest.fixture(scope="module")
def first():
    return variant_of(SCENE)


def test_positions_without_a_body(first):
    variant = first.without(first.offers["body block"])
    base, run = positions_of(first), positions_of(variant)
    assert run.shape[1] < base.shape[1]
    assert changes(observation(positions=base), observation(positions=run), variant,
                   first)["positions"].max() == 0.0
    shift = run.copy()
    shift[-1, ::2] += 0.04
    change = changes(observation(positions=base), observation(positions=shift), variant, first)
    assert change["positions"] == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.1])


def test_positions_of_a_named_body(first):
    variant = first.without(first.offers["body block"])
    text, n = "positions:distant", first.probes[0][1].size
    base, run = positions_of(first)[:, n:], positions_of(variant)
    change = changes(observation(**{text: base}), observation(**{text: run}), variant, first)
    assert change[text].max() == 0.0


def test_positions_of_a_half():
    first = variant_of(HEAD + """
[[body]]
name = "disk"
density = 1000.0
shape = { type = "sphere", center = [0.5, 0.3], radius = 0.2 }
material = { law = "fixed_corotated", E = 1e5, nu = 0.3 }
""")
    label, = (label for label in first.offers if label.startswith("half x"))
    variant = first.without(first.offers[label])
    base, run = positions_of(first), positions_of(variant)
    kinetic = np.arange(TIMES)[:, None] + 1.0
    change = changes(observation(positions=base, kinetic=kinetic),
                     observation(positions=run, kinetic=0.5 * kinetic), variant, first)
    assert change["positions"].max() == change["kinetic"].max() == 0.0


def half_of_a_disk():
    """A scene with a disk on a floor beside walls, and its half x > 0.5 m."""
    first = variant_of(HEAD + """
walls = { low = [2, 2], high = [18, 18] }

[[body]]
name = "disk"
density = 1000.0
shape = { type = "sphere", center = [0.5, 0.3], radius = 0.2 }
material = { law = "fixed_corotated", E = 1e5, nu = 0.3 }

[[collider]]
name = "floor"
shape = { type = "half_space", point = [0.0, 0.1], normal = [0.0, 1.0] }

[[collider]]
name = "west"
shape = { type = "sphere", center = [0.2, 0.3], radius = 0.05 }

[[collider]]
name = "east"
shape = { type = "sphere", center = [0.8, 0.3], radius = 0.05 }
""")
    return first, first.without(first.offers["half x < 0.5 m (symmetry wall instead)"])


@pytest.mark.parametrize(("text", "factor"), [
    ("impulse:floor", 2.0), ("force:floor", 2.0), ("impulse:wall y-", 2.0), ("centroid", 1.0),
    ("centroid:disk", 1.0)])
def test_vectors_of_what_the_plane_halves(text, factor):
    """The component across the plane has no meaning for one half; impulses count twice."""
    first, half = half_of_a_disk()
    base = np.arange(2.0 * TIMES).reshape(TIMES, 2)
    run = base / factor
    run[:, 0] = 77.0
    names = {text: base}
    change = changes(observation(**names), observation(**{text: run}), half, first)
    assert change[text].max() == 0.0
    run[-1, 1] += 0.1
    assert changes(observation(**names), observation(**{text: run}), half, first)[text][-1] > 0.01


@pytest.mark.parametrize("text", ["impulse:east", "force:wall x+"])
def test_vectors_of_a_part_on_the_side_that_is_left(text):
    first, half = half_of_a_disk()
    base = np.arange(2.0 * TIMES).reshape(TIMES, 2)
    same = changes(observation(**{text: base}), observation(**{text: base}), half, first)
    assert same[text].max() == 0.0
    moved = base + [[0.1, 0.0]]
    other = changes(observation(**{text: base}), observation(**{text: moved}), half, first)
    assert other[text].max() > 0.0


@pytest.mark.parametrize("text", ["path:0.6,0.3", "region:0.5,0.1,0.9,0.5"])
def test_vectors_of_a_place_in_the_half_that_is_left(text):
    """They have all components: nothing is summed over both halves."""
    first, half = half_of_a_disk()
    base = np.arange(2.0 * TIMES).reshape(TIMES, 2)
    same = changes(observation(**{text: base}), observation(**{text: base}), half, first)
    assert same[text].max() == 0.0
    moved = base + np.arange(TIMES)[:, None] * [0.1, 0.0]
    other = changes(observation(**{text: base}), observation(**{text: moved}), half, first)
    assert other[text][-1] > 0.01


@pytest.mark.parametrize("text", ["front:x-", "profile:x:disk", "path:0.4,0.3",
                                  "region:0.4,0.1,0.9,0.5", "mean:J:0.4,0.1,0.9,0.5"])
def test_quantity_of_the_half_that_is_removed(text):
    first, half = half_of_a_disk()
    assert first.quantity(text) == text
    with pytest.raises(SceneError, match="of the half that is removed"):
        half.quantity(text)


@pytest.mark.parametrize("text", ["front:x+", "front:y-", "profile:y", "path:0.6,0.3", "kinetic",
                                  "region:0.5,0.1,0.9,0.5", "positions", "impulse:west"])
def test_quantity_of_the_half_that_is_left(text):
    assert half_of_a_disk()[1].quantity(text) == text


def test_largest_change_so_far_and_at_the_end(first):
    base = np.arange(TIMES)[:, None] * 1.0
    run = base.copy()
    run[2] += 1.0
    names = {"kinetic": base, "kinetic@end": base}
    change = changes(observation(**names), observation(**dict.fromkeys(names, run)), first, first)
    assert change["kinetic"] == pytest.approx([0.0, 0.0, 0.25, 0.25, 0.25])
    assert change["kinetic@end"].max() == 0.0


def test_at_the_end_the_change_is_relative_to_the_largest(first):
    swing = np.array([[0.0], [1.0], [0.1]])
    base = RunObservation({"kinetic@end": swing}, RunCost(), FINISHED)
    other = RunObservation({"kinetic@end": swing + [[0.0], [0.0], [0.05]]}, RunCost(), FINISHED)
    assert changes(base, other, first, first)["kinetic@end"][-1] == pytest.approx(0.05)


def test_run_that_stopped_changes_infinitely(first):
    base = np.arange(TIMES)[:, None] * 1.0
    run = base.copy()
    run[3:] = np.nan
    change = changes(observation(kinetic=base), observation(kinetic=run), first, first)["kinetic"]
    assert change[-1] == np.inf
