"""Which trained laws a scene takes as a material: networks, admissible ones too; not the others."""

import admissible_toys
import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from small_laws import STEPS, E, identified, saved, write_scene

from mpm_ref.materials import NoFlow
from mpm_ref.materials.learned.contraction import ContractionFlow
from mpm_ref.materials.learned.energetic import EnergyLaw
from mpm_ref.materials.learned.spline import SplineStress, knots
from mpm_ref.materials.learned.stretch_network import StretchStress
from mpm_ref.materials.learned.weights import LawWeights, LearnedLaws, load
from mpm_ref.nclaw.bodies import body_maker
from mpm_ref.nclaw.study.compare import positions
from mpm_ref.scene import SceneError, build
from mpm_ref.scene import load as load_scene
from mpm_ref.store.results import Results

MATERIAL = f'law = "fixed_corotated", E = {E}, nu = 0.2', 'law = "neural", weights = "laws.npz"'
NO_RETURN = LawWeights((), NoFlow())
STRETCHES = LawWeights(((np.ones((3, 3)), np.zeros(3)),), StretchStress())
SPLINES = LawWeights(((np.ones((len(knots()), 3)), np.zeros(3)),), SplineStress())


@pytest.fixture
def scene(tmp_path):
    """Path of a scene whose material is learned."""
    return write_scene(tmp_path, MATERIAL, ("every = 5", 'every = 5\nunstable = "allow"'))


@pytest.mark.parametrize(("laws", "kind"), [
    (LearnedLaws(STRETCHES, NO_RETURN, {}), "elastic law is of kind StretchStress"),
    (LearnedLaws(SPLINES, NO_RETURN, {}), "elastic law is of kind SplineStress"),
    (identified(), "elastic law is of kind FixedCorotated"),
    (LearnedLaws(admissible_toys.energetic(), NO_RETURN, {}), "plastic law is of kind NoFlow"),
], ids=lambda value: value if isinstance(value, str) else "")
def test_laws_that_are_no_material_are_told_by_their_kind(scene, laws, kind):
    saved(scene.parent, laws)
    with pytest.raises(SceneError, match=f"weights = .*laws.npz': its {kind}; expected networks"):
        load_scene(scene)
    assert_told(mpm_ref("run", scene, "--out", scene.parent / "run.h5"), 2, kind)


def test_admissible_laws_are_a_material_with_an_energy(scene):
    file = saved(scene.parent, admissible_toys.laws())
    body, = build(load_scene(scene)).bodies
    assert (type(body.law), type(body.flow)) == (EnergyLaw, ContractionFlow)
    out = scene.parent / "run.h5"
    done = mpm_ref("run", scene, "--out", out)
    assert done.exit_code == 0, done.output
    true = build(load_scene(write_scene(scene.parent, name="true.toml")))
    *_, last = positions(true, tuple(map(body_maker(load(file)), true.bodies)))
    with Results(out) as results:
        assert np.array_equal(results.field("cube", "x")[-1], last)
        assert results.energy[-1, 1] > 0.0
        assert len(results) == 1 + STEPS // 5


def test_learned_laws_are_refused_in_single_precision(scene):
    saved(scene.parent, admissible_toys.laws())
    text = scene.read_text().replace("scheme = {", 'scheme = { precision = "single",')
    assert "precision" in text
    scene.write_text(text)
    with pytest.raises(SceneError, match=r'precision = "single": the learned law of body'):
        load_scene(scene)


def test_admissible_laws_are_refused_in_2d(scene):
    saved(scene.parent, admissible_toys.laws())
    flat = scene.parent / "flat.toml"
    flat.write_text('dim = 2\ndx = 0.1\ndt = 1e-3\nsteps = 1\ngravity = [0.0, 0.0]\n[[body]]\n'
                    'name = "b"\ndensity = 1.0\n'
                    'material = { law = "neural", weights = "laws.npz" }\n'
                    'shape = { type = "box", lower = [0.3, 0.3], upper = [0.6, 0.6] }\n')
    assert_told(mpm_ref("run", flat, "--out", scene.parent / "run.h5"), 2,
                "its laws are for dim = 3, expected dim = 2")
