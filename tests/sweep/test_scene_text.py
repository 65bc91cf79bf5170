import numpy as np
import pytest
from sweep_scenes import FLIGHT

from mpm_ref.scene import digest, load, loads
from mpm_ref.sweep.scene_text import one_line, scene_text


@pytest.mark.parametrize("text", ["nice\n[evil]\nx = 1 #", "a\rb = 2", "a\x85b", "a\u2028b = 1",
                                  "tab\tand\x00null"])
def test_a_comment_stays_one_line(text):
    scene = loads(FLIGHT)
    written = scene_text([f"title: {text}", "  indented"], scene, ".")
    assert digest(loads(written)) == digest(scene)
    assert written.splitlines()[1] == "#   indented"
    assert len(one_line(text).splitlines()) == 1


@pytest.mark.parametrize("name", ["weights.npz", "k\u00f6rper.npz", "a b'.npz"])
def test_files_are_named_from_the_folder_of_the_scene_that_is_written(tmp_path, name):
    there, here = tmp_path / "scenes", tmp_path / "results" / "deep"
    there.mkdir()
    here.mkdir(parents=True)
    np.savez(there / name, x=np.random.default_rng(0).uniform(0.3, 0.7, (20, 2)))
    body = f"particles = {{ file = \"{name}\" }}"
    text = FLIGHT.replace('shape = { type = "sphere", center = [0.5, 0.7], radius = 0.25 }', body)
    assert body in text
    (there / "flight.toml").write_text(text, encoding="utf-8")
    scene = load(there / "flight.toml")
    (here / "flight.best.toml").write_text(scene_text([], scene, here), encoding="utf-8")
    assert digest(load(here / "flight.best.toml")) == digest(scene)
