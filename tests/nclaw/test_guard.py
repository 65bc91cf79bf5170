"""The guard of learned laws: strains are cut to a box around those of training, and counted."""

import json

import neural_toys
import numpy as np
import pytest
from command_line import mpm_ref

from mpm_ref.core.law import kirchhoff, psi, returned
from mpm_ref.materials import FixedCorotated
from mpm_ref.materials.learned import learned_flow, learned_law, weights
from mpm_ref.materials.learned.contraction import Contraction
from mpm_ref.materials.learned.energetic import Energetic
from mpm_ref.materials.learned.guard import (
    MARGIN,
    StrainBox,
    count_cut,
    cut,
    guarded,
    is_guarded,
    strain_box,
)
from mpm_ref.materials.learned.response import Correction, Stress
from mpm_ref.materials.learned.strain_range import strain_measures
from mpm_ref.materials.learned.weights import LawWeights
from mpm_ref.monitor import Unstable
from mpm_ref.scene import SceneError, build, canonical, load
from mpm_ref.simulate import simulate
from mpm_ref.store.results import Results

BOUNDS = {2: {"low": [0.9, 0.7, 0.65], "high": [1.4, 1.05, 1.3]},
          3: {"low": [0.9, 0.8, 0.7, 0.6], "high": [1.4, 1.1, 1.05, 1.3]}}
WIDE = {"low": [0.0, 0.0, 0.0], "high": [9.0, 9.0, 81.0]}
SCENE = """
title = "a learned block"
dim = 2
dx = 0.05
dt = 1e-3
steps = {steps}
every = 30
gravity = [0.0, -9.8]
walls = {{ low = [3, 3], high = [17, 17] }}

[[body]]
name = "learned"
density = 1000.0
shape = {{ type = "box", lower = [0.3, 0.2], upper = [0.5, 0.4] }}
velocity = {{ linear = [0.0, -3.0] }}
material = {{ law = "{law}"{keys} }}
"""


def gradients(d, n=200, spread=1.0, seed=0):
    """Random F (n, d, d), many of which are far from rest, or inverted."""
    return np.eye(d) + spread * np.random.default_rng(seed).normal(size=(n, d, d))


def nested(F):
    """F as kernels take it."""
    return tuple(map(tuple, F.tolist()))


def cut_all(F, box):
    """F_cut (n, d, d) of F."""
    return np.array([cut(nested(one), *box)[0] for one in F])


def polyconvex(seed=0):
    """`LawWeights` of an energy, and of a contraction."""
    rng = np.random.default_rng(seed)
    energy, flow = (tuple((rng.normal(size=(n, m)), rng.normal(size=m)) for n, m in sizes)
                    for sizes in (((4, 8), (8, 1)), ((3, 8), (8, 2))))
    energy = tuple((np.abs(W), b) for W, b in energy)
    return LawWeights(energy, Energetic(1e3)), LawWeights(flow, Contraction())


# the box

def test_the_box_is_a_margin_around_the_training():
    box = strain_box({"low": [1.0, 0.5, -0.5], "high": [2.0, 1.0, 1.5]})
    assert box.low == pytest.approx([1.0 - MARGIN, 0.5 - 0.5 * MARGIN, -0.5 - 2.0 * MARGIN])
    assert box.high == pytest.approx([2.0 + MARGIN, 1.0 + 0.5 * MARGIN, 1.5 + 2.0 * MARGIN])


def test_a_box_asks_about_inversion_only_where_training_did():
    assert strain_box({"low": [0.1, 0.1, 0.01], "high": [2.0, 1.0, 1.5]}).low \
        == pytest.approx([0.05, 0.05, 0.005])


# what is cut

@pytest.mark.parametrize("d", [2, 3])
def test_strains_are_cut_to_the_box(d):
    box, F = strain_box(BOUNDS[d]), gradients(d)
    measures = strain_measures(cut_all(F, box))
    assert (measures >= box.low - 1e-9).all()
    assert (measures <= box.high + 1e-9).all()
    assert count_cut(F, box) > 100


@pytest.mark.parametrize("d", [2, 3])
def test_within_the_box_no_bit_changes(d):
    box, F = strain_box(BOUNDS[d]), gradients(d, spread=0.05)
    assert count_cut(F, box) == 0
    assert np.array_equal(cut_all(F, box), F)


def test_axes_and_the_other_stretches_stay():
    box, F = strain_box(BOUNDS[2]), np.diag([5.0, 0.8])
    assert np.diag(cut_all(F[None], box)[0]) == pytest.approx([box.high[0], 0.8])


def test_a_volume_out_of_bounds_is_shared_by_all_stretches():
    box = StrainBox(np.array([0.5, 0.5, 0.5]), np.array([2.0, 2.0, 1.0]))
    assert np.diag(cut_all(np.diag([1.6, 1.2])[None], box)[0]) \
        == pytest.approx(np.array([1.6, 1.2]) / np.sqrt(1.92))


def test_an_inverted_point_is_read_as_the_most_compressed_one():
    box, F = strain_box(BOUNDS[3]), np.diag([1.0, 0.9, -0.3])[None]
    s = strain_measures(cut_all(F, box))[0]
    assert s[:3] == pytest.approx([1.0, 0.9, box.low[2]])
    assert count_cut(F, box) == 1


def test_what_is_not_finite_stays_so_and_counts():
    box, F = strain_box(BOUNDS[2]), np.full((1, 2, 2), np.nan)
    assert np.isnan(cut_all(F, box)).all()
    assert count_cut(F, box) == 1


# what laws answer

LAWS = {"network": (neural_toys.trained(Stress(1e4), 3), neural_toys.trained(Correction(), 3)),
        "energy": polyconvex()}


@pytest.mark.parametrize("name", LAWS)
def test_a_guarded_law_answers_for_the_cut_strains(name):
    law, flow = (make(of) for make, of in zip((learned_law, learned_flow), LAWS[name], strict=True))
    box, F = strain_box(BOUNDS[3]), gradients(3, n=40)
    cut_law, cut_flow = guarded(law, box), guarded(flow, box)
    for one, F_cut in zip(F, cut_all(F, box), strict=True):
        tau = np.array(kirchhoff(nested(one), cut_law))
        assert np.array_equal(tau, kirchhoff(nested(F_cut), law))
        kept = np.array(returned(nested(F_cut), flow)) + 0.5 * (one - F_cut)
        assert np.array(returned(nested(one), cut_flow)) == pytest.approx(kept, abs=1e-12)
    if name == "energy":
        assert psi(nested(F[0]), cut_law) == psi(nested(cut_all(F[:1], box)[0]), law) < np.inf


@pytest.mark.parametrize("name", LAWS)
def test_a_law_without_guard_and_one_within_its_box_have_equal_bits(name):
    law, flow = (make(of) for make, of in zip((learned_law, learned_flow), LAWS[name], strict=True))
    box = strain_box(BOUNDS[3])
    for one in map(nested, gradients(3, n=20, spread=0.05)):
        assert kirchhoff(one, guarded(law, box)) == kirchhoff(one, law)
        assert returned(one, guarded(flow, box)) == returned(one, flow)


def test_laws_by_name_have_no_guard():
    law = FixedCorotated(1.0, 1.0)
    assert guarded(law, strain_box(BOUNDS[3])) is law
    assert not is_guarded(law)


def test_a_point_that_strains_on_and_on_keeps_a_bounded_F():
    law, box = learned_flow(LAWS["network"][1]), strain_box(BOUNDS[3])
    F, growth = np.eye(3), np.diag([1.3, 0.9, 0.8])
    for _ in range(200):
        F = np.array(returned(nested(growth @ F), guarded(law, box)))
        assert np.abs(F).max() < 3.0
    assert count_cut(F[None], box) == 1


# scenes

def made(folder, about, steps=60, law="neural", keys=', weights = "laws.npz"', unit=1e4):
    """A scene with weights of this record."""
    weights.save(folder / "laws.npz", neural_toys.laws(2, unit)._replace(about=about))
    (folder / "scene.toml").write_text(SCENE.format(steps=steps, law=law, keys=keys))
    return folder / "scene.toml"


def test_a_scene_guards_its_learned_laws_unless_it_turns_the_guard_off(tmp_path):
    scene = made(tmp_path, {"seen": BOUNDS[2]})
    body = build(load(scene)).bodies[0]
    assert is_guarded(body.law)
    assert is_guarded(body.flow)
    assert body.law.low.tolist() == strain_box(BOUNDS[2]).low.tolist()
    off = made(tmp_path, {"seen": BOUNDS[2]}, keys=', weights = "laws.npz", guard = false')
    body = build(load(off)).bodies[0]
    assert not is_guarded(body.law)
    assert not is_guarded(body.flow)


def test_the_default_does_not_change_the_text_of_a_scene(tmp_path):
    plain = canonical(load(made(tmp_path, {"seen": BOUNDS[2]})))
    on = canonical(load(made(tmp_path, {"seen": BOUNDS[2]},
                             keys=', weights = "laws.npz", guard = true')))
    assert plain == on
    assert "guard" not in plain


def test_weights_without_a_range_have_no_guard(tmp_path):
    assert not is_guarded(build(load(made(tmp_path, {}))).bodies[0].law)


def test_a_guard_is_for_learned_laws(tmp_path):
    with pytest.raises(SceneError, match="guard = false: expected with the law 'neural' alone"):
        load(made(tmp_path, {}, law="fixed_corotated", keys=", E = 1e5, nu = 0.3, guard = false"))


# runs

NARROW = {"low": [0.999, 0.999, 0.998], "high": [1.001, 1.001, 1.002]}


def test_a_run_counts_what_was_cut(tmp_path):
    scene, out = made(tmp_path, {"seen": NARROW}), tmp_path / "run.h5"
    done = mpm_ref("run", scene, "--out", out)
    first, last = done.stderr.splitlines()
    assert done.exit_code == 0
    assert "warning: step 20" in first
    assert "the guard cuts what its law is asked about" in first
    assert "particle-steps were cut" in last
    with Results(out) as results:
        counts = results.manifest["parts"][0]["cut_particle_steps"]
    assert 0 < counts["learned"] <= 60 * 64
    facts = json.loads(mpm_ref("info", out, "--json").stdout)
    assert any(f"{counts['learned']} particle-steps were cut" in one for one in facts["warnings"])


def test_a_run_counts_every_step(tmp_path):
    """All strains of a block that is cut to less than its own strains, in each of its steps."""
    scene, out = made(tmp_path, {"seen": NARROW}, steps=27), tmp_path / "run.h5"
    problem, cut_points = build(load(scene)), []
    box = strain_box(NARROW)
    for _ in simulate(problem, on_step=lambda state, dt: cut_points.append(
            count_cut(state.bodies[0].particles.F, box))):
        pass
    assert sum(cut_points) > 0
    mpm_ref("run", scene, "--out", out)
    with Results(out) as results:
        assert results.manifest["parts"][0]["cut_particle_steps"] == {"learned": sum(cut_points)}


def test_a_run_without_guard_counts_nothing(tmp_path):
    scene = made(tmp_path, {"seen": WIDE}, keys=', weights = "laws.npz", guard = false', steps=7)
    mpm_ref("run", scene, "--out", tmp_path / "run.h5")
    with Results(tmp_path / "run.h5") as results:
        assert results.manifest["parts"][0]["cut_particle_steps"] == {}


def test_a_run_with_a_guard_goes_on_with_points_of_any_volume(tmp_path):
    """One particle is inverted, another one a thousand times as large: both read cut strains."""
    off = ', weights = "laws.npz", guard = false'
    for keys, stops in ((off, True), (', weights = "laws.npz"', False)):
        problem = build(load(made(tmp_path, {"seen": BOUNDS[2]}, keys=keys)))
        F = problem.bodies[0].particles.F
        F[0], F[1] = np.diag([1.0, -0.5]), np.diag([60.0, 50.0])
        if stops:
            with pytest.raises(Unstable, match="J is outside"):
                list(simulate(problem))
        else:
            assert len(list(simulate(problem))) == 3


def test_an_unstable_run_names_the_law_its_strain_and_its_training(tmp_path):
    """The block falls into the floor with a law that is much too stiff for its step."""
    keys = ', weights = "laws.npz", guard = false'
    scene = made(tmp_path, {"seen": BOUNDS[2]}, steps=400, keys=keys, unit=3e5)
    with pytest.raises(Unstable) as stop:
        for _ in simulate(build(load(scene))):
            pass
    message = str(stop.value)
    assert "nan" not in message
    assert "learned law of 'learned'" in message
    assert "0.9 to 1.4, 0.7 to 1.05, J 0.65 to 1.3" in message
    assert "guard = true" in message
    assert "take a smaller dt" not in message
