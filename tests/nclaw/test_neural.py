"""Trained laws as a material: their answers, what a step makes of them, scenes and the command."""

import hashlib
import json

import neural_toys
import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from neural_toys import CORRECTIONS, STRESSES, UNIT, deformations, plain, rotations, trained
from problems import DX, run_python, stepped
from problems import digest as digest_of
from small_runs import block
from variants import slow_but

from mpm_ref.adjoint import deform_body_adjoint, zero_bars, zero_sums
from mpm_ref.body import Body, check_fit, particles_at
from mpm_ref.energy import energy
from mpm_ref.explicit import Scheme, deform_body, initial_stress
from mpm_ref.materials import Hencky, NoFlow, make_flow
from mpm_ref.materials.learned import network, response, weights
from mpm_ref.problem import Clock, Problem
from mpm_ref.scene import SceneError, build, canonical, digest, load, loads
from mpm_ref.simulate import simulate
from mpm_ref.store.manifest import scene_hash
from mpm_ref.store.results import Results
from mpm_ref.timestep import moduli

ROUND_OFF = 1e-13       # of the largest entry
SINGLE = 1e-5           # the same of networks in single precision
SHAPES = {"as printed": ((64, 64), 0.0), "biases": ((7, 12, 5), 0.3), "no hidden layer": ((), 0.1)}

DIGEST = """
import json, numba
from tests.nclaw.test_neural import mixed
from problems import digest, stepped
print(json.dumps([digest(stepped(mixed(), 3)), numba.get_num_threads()]))
"""

SCENE = """
title = "two materials"
dim = 2
dx = 0.05
dt = 1e-3
steps = 20
every = 10
gravity = [0.0, -9.8]
walls = { low = [3, 3], high = [17, 17] }

[[body]]
name = "learned"
density = 1000.0
shape = { type = "box", lower = [0.3, 0.2], upper = [0.5, 0.4] }
material = { law = "neural", weights = "laws.npz" }

[[body]]
name = "classical"
density = 1000.0
shape = { type = "box", lower = [0.5, 0.2], upper = [0.7, 0.4] }
material = { law = "fixed_corotated", E = 1e5, nu = 0.3 }
"""


def answers(of, F):
    """Of a `LawWeights`, as compiled; F (n, d, d)."""
    stress = type(of.kind) in STRESSES
    law = network.build_law(of) if stress else network.build_flow(of)
    name = network.kirchhoff if stress else network.returned
    return np.array([name(tuple(map(tuple, F_p.tolist())), law) for F_p in F])


def body_of(laws, F):
    """A body of trained laws with F (n, d, d), at rest."""
    n, d = F.shape[:2]
    q = particles_at(np.zeros((n, d)), np.zeros((n, d)), np.ones(n), np.ones(n))
    q.F[:] = F
    law, flow = network.build_law(laws.elastic), network.build_flow(laws.plastic)
    return Body("b", q, law, flow, np.arange(n))


def mixed():
    """A learned block beside a classical one that hits it, on one grid."""
    made = neural_toys.laws(2)
    left = block("left", (0.3, 0.5), (0.0, 0.0))
    left = left._replace(law=network.build_law(made.elastic), flow=network.build_flow(made.plastic))
    right = block("right", (0.5, 0.5), (-1.0, 0.0))
    return Problem((left, right), DX, Clock(dt=1e-3, steps=10, every=5), np.zeros(2), Scheme())


@pytest.fixture
def folder(tmp_path):
    """A folder with a scene and its weights."""
    weights.save(tmp_path / "laws.npz", neural_toys.laws(2))
    (tmp_path / "scene.toml").write_text(SCENE)
    return tmp_path


# the answers

@pytest.mark.parametrize("kind", slow_but((*STRESSES, *CORRECTIONS), STRESSES[0], CORRECTIONS[0]),
                         ids=lambda kind: kind.__name__)
@pytest.mark.parametrize(("hidden", "bias"), SHAPES.values(), ids=SHAPES)
def test_answers_are_those_of_plain_numpy(d, kind, hidden, bias):
    of, F = trained(kind(**{kind._fields[0]: 0.7}), d, hidden, bias), deformations(d)
    expected = np.array([plain(of, F_p) for F_p in F])
    assert np.linalg.det(F).min() < 0.0
    assert abs(answers(of, F) - expected).max() <= ROUND_OFF * abs(expected).max()


@pytest.mark.parametrize("kind", [response.Stress(), response.Correction()],
                         ids=lambda kind: type(kind).__name__)
def test_answers_are_those_of_the_law_that_was_trained(d, kind):
    torch = pytest.importorskip("torch")
    from mpm_ref.nclaw.train.neural_laws import NeuralLawModule
    torch.manual_seed(3)
    law, F = NeuralLawModule(kind, d), deformations(d)
    with torch.no_grad():
        expected = law(torch.from_numpy(F)).numpy()
    assert abs(answers(law.weights(), F) - expected).max() <= SINGLE * abs(expected).max()


def test_rest_is_kept(d):
    R = rotations(d, 10)
    stress = answers(trained(response.Stress(UNIT), d), R)
    stressed = answers(trained(response.Stress(UNIT), d), 1.01 * R)
    assert abs(stress).max() <= ROUND_OFF * UNIT < 1e-9 * abs(stressed).max()
    assert abs(answers(trained(response.Correction(1.0), d), R) - R).max() <= ROUND_OFF


@pytest.mark.parametrize("kind", [response.Stress(), response.SymmetricStress(),
                                  response.Correction(1.0)], ids=lambda kind: type(kind).__name__)
def test_answers_turn_with_the_body(d, kind):
    of, F = trained(kind, d), deformations(d)
    Q = rotations(d, len(F), seed=5)
    turned = Q @ answers(of, F)
    if type(kind) in STRESSES:
        turned = turned @ Q.swapaxes(1, 2)
    found = answers(of, Q @ F)
    assert abs(found - turned).max() <= ROUND_OFF * abs(turned).max()


def test_what_is_not_finite_gives_nan(d):
    F = np.eye(d)[None].copy()
    F[0, 0, 0] = np.inf
    assert np.isnan(answers(trained(response.Stress(), d), F)).all()


def test_answers_of_the_wrong_kind_are_refused():
    with pytest.raises(ValueError, match="kind Correction: expected Stress or"):
        network.build_law(trained(response.Correction(), 2))
    with pytest.raises(ValueError, match="kind Stress: expected Correction or"):
        network.build_flow(trained(response.Stress(), 2))


# what a step makes of them

def test_a_step_returns_the_trial_gradient_and_leaves_its_stress(d):
    laws, F = neural_toys.laws(d), deformations(d)
    body, dt = body_of(laws, F), 0.1
    body.particles.L[:] = np.random.default_rng(1).normal(size=F.shape)
    trial = (np.eye(d) + dt * body.particles.L) @ F
    deform_body(body, dt)
    returned = np.array([plain(laws.plastic, F_p) for F_p in trial])
    tau = np.array([plain(laws.elastic, F_p) for F_p in returned])
    assert abs(body.particles.F - returned).max() <= ROUND_OFF * abs(returned).max()
    assert abs(body.particles.F - trial).max() > 1e-5
    assert abs(body.particles.tau - tau).max() <= ROUND_OFF * abs(tau).max()


def test_a_learned_return_map_goes_with_a_classical_law():
    F = deformations(2)
    F = F[np.linalg.det(F) > 0.0]
    body = body_of(neural_toys.laws(2), F)._replace(law=Hencky(4e4, 6e4))
    deform_body(body, 0.0)
    tau = body.particles.tau.copy()
    initial_stress(body)
    assert np.array_equal(tau, body.particles.tau)


@pytest.mark.parametrize("seed", range(3))
def test_stiffness_at_rest_is_that_of_small_strains(d, seed):
    of, h = trained(response.Stress(UNIT), d, seed=seed), 1e-4
    law = network.build_law(of)
    wave = max(plain(of, np.diag(1.0 + step * axis))[k, k] / step
               for k, axis in enumerate(np.eye(d)) for step in (h, -h))
    assert law.wave == pytest.approx(max(wave, 0.0), rel=1e-2)
    dilated = abs(np.trace(plain(of, (1.0 + h) * np.eye(d)))) / (d * h)
    assert law.largest >= (1.0 - 1e-2) * max(wave, dilated)
    body = body_of(weights.LearnedLaws(of, trained(response.Correction(), d), {}), deformations(d))
    assert all((K == value).all() for K, value in zip(moduli(body), (law.wave, law.largest)))


def test_bodies_of_both_kinds_share_a_grid():
    problem = mixed()
    *_, last = simulate(problem)
    left, right = (body.particles for body in last.state.bodies)
    assert left.v[:, 0].min() < -0.01
    assert abs(left.tau).max() > 0.0
    assert right.v[:, 0].mean() > -1.0
    assert last.state.account is None
    assert np.isnan(energy(last.state.bodies, problem.gravity).elastic)


def test_bits_do_not_depend_on_threads():
    own, alone = digest_of(stepped(mixed(), 3)), run_python(DIGEST, NUMBA_NUM_THREADS="1")
    assert alone == [own, 1]
    assert run_python(DIGEST, NUMBA_NUM_THREADS="2") == [own, 2]


def test_what_does_not_fit_is_refused():
    body = body_of(neural_toys.laws(3), deformations(3))
    plane = body_of(neural_toys.laws(2), deformations(2))
    with pytest.raises(ValueError, match="its NeuralStress is for 3 dimensions, expected 2"):
        check_fit(plane._replace(law=body.law), Scheme(), 2)
    with pytest.raises(ValueError, match="its NeuralCorrection is for 3 dimensions, expected 2"):
        check_fit(plane._replace(flow=body.flow), Scheme(), 2)
    clamp = make_flow("von_mises", Hencky(1.0, 1.0), 2, tau_y=1.0)
    with pytest.raises(ValueError, match="VonMises acts on singular values"):
        check_fit(plane._replace(flow=clamp), Scheme(), 2)
    check_fit(plane._replace(flow=NoFlow()), Scheme(), 2)


@pytest.mark.parametrize("law", [True, False], ids=["law alone", "flow alone"])
def test_the_adjoint_of_a_network_beside_another_material_is_refused(law):
    """A return map of singular values after a network's, and a network's after Hencky's law."""
    body = body_of(neural_toys.laws(2), deformations(2))
    clamp = make_flow("von_mises", Hencky(1.0, 1.0), 2, tau_y=1.0)
    body = body._replace(flow=clamp) if law else body._replace(law=Hencky(1.0, 1.0))
    said = "VonMises" if law else "NeuralCorrection"
    with pytest.raises(ValueError, match=f"body 'b': {said} has no adjoint"):
        deform_body_adjoint(body, body.particles.L, zero_bars(body), zero_sums(body), 0.1)


def test_weights_belong_to_the_hash_of_a_problem_made_in_python():
    problem, again = mixed(), mixed()
    assert scene_hash(problem) == scene_hash(again)
    again.bodies[0].law.W[1000] += 1e-12
    assert scene_hash(problem) != scene_hash(again)


# scenes and the command line

def test_a_scene_takes_both_laws_from_its_file(folder):
    body = build(load(folder / "scene.toml")).bodies[0]
    laws = neural_toys.laws(2)
    assert isinstance(body.law, network.NeuralStress)
    assert isinstance(body.flow, network.NeuralCorrection)
    assert np.array_equal(body.law.W, network.build_law(laws.elastic).W)
    assert np.array_equal(body.flow.W, network.build_flow(laws.plastic).W)


def test_weights_belong_to_the_hash_of_a_scene(folder):
    scene, content = load(folder / "scene.toml"), (folder / "laws.npz").read_bytes()
    assert hashlib.sha256(content).hexdigest() in canonical(scene)
    before = digest(scene)
    assert digest(loads(canonical(scene), folder=folder)) == before
    weights.save(folder / "laws.npz", neural_toys.laws(2, unit=2.0 * UNIT))
    assert digest(scene) != before


@pytest.mark.parametrize(("old", "new", "said"), [
    ('"laws.npz"', '"none.npz"', r"body\[0\].material: .*none.npz cannot be read: No such file"),
    ('"laws.npz"', '"broken.npz"', r"body\[0\].material: .*broken.npz is damaged"),
    ('"laws.npz"', '"solid.npz"', r"weights = .*its laws are for dim = 3, expected dim = 2"),
    (', weights = "laws.npz"', "", "law 'neural': missing parameter weights"),
    ('"laws.npz"', '"laws.npz", E = 1e5', "law 'neural': unknown parameter E; all that it takes"),
    ('"laws.npz"', '"laws.npz", flow = { type = "snow_clamp" }', "unknown parameter flow"),
    ('"laws.npz"', f'"laws.npz", sha256 = "{64 * "0"}"', "material.sha256: the file .*holds some"),
    ('"neural", weights = "laws.npz"', '"hencky", E = 1.0, nu = 0.2, weights = "laws.npz"',
     "law 'hencky': unknown parameter weights"),
    ('"neural"', '"granite"', "law 'granite': expected one of fixed_corotated, .*, neural"),
    ("dim = 2", 'dim = 2\nintegrator = "hot"', "law = 'neural': expected the integrator"),
])
def test_what_a_scene_gets_wrong_is_said(folder, old, new, said):
    content = (folder / "laws.npz").read_bytes()
    (folder / "broken.npz").write_bytes(content[:1000] + b"x" + content[1001:])
    weights.save(folder / "solid.npz", neural_toys.laws(3))
    with pytest.raises(SceneError, match=said):
        build(loads(SCENE.replace(old, new, 1), folder=folder))


def test_the_command_runs_it_and_goes_on_only_with_the_same_weights(folder):
    out = folder / "run.h5"
    done = mpm_ref("run", folder / "scene.toml", "--out", out, "--steps", 10)
    assert done.exit_code == 0, done.stderr
    with Results(out) as results:
        content = (folder / "laws.npz").read_bytes()
        assert hashlib.sha256(content).hexdigest() in results.manifest["scene"]
        law = json.loads(results.h5["bodies/learned"].attrs["law"])
        assert (law["type"], len(law["W"])) == ("NeuralStress", 64)
        assert np.isnan(results.energy[:, 1]).all()
        assert np.isfinite(results.energy[:, 0]).all()
    said = mpm_ref("info", out).stdout
    assert ", elastic unknown, gravity " in said
    assert "nan" not in said
    assert mpm_ref("info", folder / "scene.toml").exit_code == 0
    assert mpm_ref("run", folder / "scene.toml", "--out", out, "--resume").exit_code == 0
    weights.save(folder / "laws.npz", neural_toys.laws(2, unit=2.0 * UNIT))
    assert_told(mpm_ref("run", folder / "scene.toml", "--out", out, "--resume"), 2, "scene")
