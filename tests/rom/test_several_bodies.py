"""Reduced runs of LDM with several elastic bodies against the full model, and their parts."""

import numpy as np
import pytest
from rom_toys import cloud
from two_blocks import SCENE

from mpm_ref.explicit import Stepper
from mpm_ref.plain import laws
from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.fields.blocks import MANY, body_blocks
from mpm_ref.rom.fields.elastic import BodyLaws
from mpm_ref.rom.fields.numbered import NumberedModes, numbered
from mpm_ref.rom.fields.pod import basis, modes
from mpm_ref.rom.fields.polynomial_manifold import curved
from mpm_ref.rom.latent import Latent
from mpm_ref.rom.quadrature.lagrangian import lagrangian
from mpm_ref.rom.sampling import PER_GROUP
from mpm_ref.rom.snapshots import Snapshots
from mpm_ref.rom.step import ldm_stepper
from mpm_ref.rom.study import run as run_module
from mpm_ref.rom.study.full_model import field_of, ldm_full_model
from mpm_ref.rom.study.reduce import map_misfit
from mpm_ref.rom.study.run import RunOptions, ldm_model, ldm_run, with_numbers
from mpm_ref.rom.study.samples import random_draw
from mpm_ref.scene import build, loads
from mpm_ref.simulate import simulate

TRANSFERS = ("pic", "apic", "mls")
DT = 0.002


def in_one_place(d, transfer):
    """`FullModel` of two bodies of other stiffness and density, whose points are the same places at
    rest.
    """
    upper = [0.2, 0.1] if d == 2 else [0.1, 0.1, 0.1]
    body = """
    [[body]]
    name = "{name}"
    density = {rho}
    shape = {{ type = "box", lower = {lower}, upper = {upper} }}
    sampling = {{ type = "regular", per_cell = 2 }}
    material = {{ law = "fixed_corotated", E = {E}, nu = {nu} }}
    """
    size = {"lower": d * [0.0], "upper": upper}
    return ldm_full_model(loads(
        f'title = "Twice"\ndim = {d}\ndx = 0.1\ndt = {DT}\nsteps = 1\n'
        f'gravity = {[1.0, -9.8, 3.0][:d]}\nscheme = {{ transfer = "{transfer}" }}\n'
        + body.format(name="soft", rho=1000.0, E=1e5, nu=0.3, **size)
        + body.format(name="hard", rho=3000.0, E=1e6, nu=0.2, **size)))


def anything(X):
    """Modes of points X that reach every position and velocity, and coordinates of a stressed state
    with rates.
    """
    (n, d), rng = X.shape, np.random.default_rng(1)
    x = X + 0.02 * rng.uniform(-1.0, 1.0, (n * d, n, d))
    F = np.eye(d) + 0.1 * rng.uniform(-1.0, 1.0, (n * d, n, d, d))
    g = numbered(modes(X, x, F, n * d))
    xhat = np.linalg.solve(g.U.reshape(n * d, n * d), (x[0] - X).ravel())
    vhat = np.linalg.solve(g.U.reshape(n * d, n * d), rng.normal(size=n * d))
    return g, Latent(xhat, vhat, xhat - DT * vhat)


def full_step(full, x, v, F, C):
    """x, v (n, d) and F (n, d, d) of a `FullModel`'s bodies after an explicit step from a state."""
    problem, ends = full.problem, np.cumsum([len(body.id) for body in full.bodies])
    for body, points in zip(full.bodies, np.split(np.arange(len(x)), ends[:-1])):
        q = body.particles
        for a, new in ((q.x, x), (q.v, v), (q.F, F)) + (((q.C, C),) if C is not None else ()):
            a[:] = new[points]
    stepper = Stepper(problem.scheme, problem.dx, x.shape[1], problem.gravity)
    stepper.start(full.bodies)
    stepper.step(full.bodies, 0.0, DT)
    return tuple(field_of(full.bodies, name) for name in ("x", "v", "F"))


@pytest.mark.parametrize("transfer", TRANSFERS)
def test_a_step_that_nothing_restrains_is_one_of_the_full_model(d, transfer):
    full = in_one_place(d, transfer)
    half = len(full.X) // 2
    assert np.array_equal(full.X[:half], full.X[half:])
    g, latent = anything(full.X)
    x, F, G = g.derivatives(full.map_points, latent.xhat)
    v = G @ latent.vhat
    for projection in ("linear", "nonlinear"):
        model = ldm_model(full, g, RunOptions(projection=projection))
        C = None
        if transfer != "pic":
            C = model.field.velocity_gradient(full.map_points, latent.before, latent.vhat)
        after, report = model.step(latent, full.map_points, 0.0, DT)
        assert report.points == report.samples == len(full.X)
        x_full, v_full, _ = full_step(full, x, v, F, C)
        assert abs(v_full - v).max() > 0.1
        found = g.velocity(full.map_points, after.fitted_at, after.vhat)
        assert abs(found - v_full).max() < 1e-11 * abs(v_full).max()
        assert abs(g.place(full.map_points, after.xhat) - x_full).max() < 1e-12


def test_each_point_has_the_law_of_its_body(d):
    full = in_one_place(d, "pic")
    half = len(full.X) // 2
    F = np.eye(d) + 0.3 * np.random.default_rng(2).normal(size=(len(full.X), d, d))
    soft, hard = (body.law for body in full.bodies)
    points = np.array([0, half - 1, half, len(full.X) - 1])
    expected = np.concatenate([laws.kirchhoff(F[points[:2]], soft),
                               laws.kirchhoff(F[points[2:]], hard)])
    assert abs(full.law.stress(points, F[points]) - expected).max() < 1e-9


# runs on the modes of a run

def simulated(scene):
    """Positions (k + 1, n, d) and deformation gradients of all bodies in a scene's run."""
    states = [[field_of(frame.state.bodies, name) for name in ("x", "F")]
              for frame in simulate(build(scene))]
    return tuple(np.array(field) for field in zip(*states))


@pytest.mark.parametrize("gradient", ["map", "evolved"])
@pytest.mark.parametrize(("transfer", "most"), [("pic", 1e-12), ("mls", 1e-8)])
@pytest.mark.parametrize("lifted", [0.0, 0.06])
def test_a_run_on_its_own_displacements_is_that_of_the_full_model(transfer, most, lifted, gradient):
    """Also from a start whose velocity is no sum of modes, since it jumps between the bodies."""
    text = SCENE.replace("[0.1, 0.2]", f"[0.1, {0.2 + lifted}]").replace(
        "[0.5, 0.4]", f"[0.5, {0.4 + lifted}]").replace('"pic"', f'"{transfer}"')
    scene = loads(text.replace("steps = 8", "steps = 8\nevery = 1"))
    x, F = simulated(scene)
    full = ldm_full_model(scene)
    g = numbered(modes(full.X, x, F, 8))
    options = RunOptions(deformation_gradient=gradient)
    states = list(ldm_run(full, g, options, np.zeros(8)).states())
    found = np.array([g.place(full.map_points, state.latent.xhat) for state in states])
    start = states[0].latent
    assert abs(g.velocity(full.map_points, start.xhat, start.vhat) - full.v).max() > 1e-3
    assert np.linalg.norm(found - x) < most * np.linalg.norm(x - full.X)


def test_a_run_of_one_body_is_that_of_its_parts_alone():
    """Bit for bit, whether points have places at rest or numbers; its one law is that of all."""
    hard = SCENE.index('[[body]]\nname = "hard"')
    scene = loads((SCENE[:hard] + SCENE[SCENE.index("[[fixed]]"):]).replace(
        "density = 1000.0", "density = 1000.0\nvelocity = { linear = [1.0, -1.0] }").replace(
        "steps = 8", "steps = 8\nevery = 1"))
    x, F = simulated(scene)
    full = ldm_full_model(scene)
    g, problem = modes(full.X, x, F, 4), full.problem
    run = ldm_run(full, g, RunOptions(points=20), np.zeros(4))
    alone = ldm_stepper(g, lagrangian(full.X, full.m, full.V0, problem.dx, problem.scheme.degree),
                        problem.bodies[0].law, problem.gravity, conditions=problem.conditions)
    assert full.map_points is full.X
    assert full.law is problem.bodies[0].law
    assert full.body_points == ()
    for name in ("xhat", "vhat"):
        states = [list(one.states()) for one in (run, run._replace(stepper=alone))]
        ends = [getattr(one[-1].latent, name) for one in states]
        assert np.array_equal(*ends)
        assert abs(ends[0]).max() > 0.1


# parts

def test_modes_by_number_are_those_at_the_points_of_the_data(d):
    X, rng = cloud(d, 30), np.random.default_rng(3)
    x, F = X + rng.normal(size=(9, 30, d)), rng.normal(size=(9, 30, d, d))
    straight = basis(X, x, F, 5)
    points, xhat = np.array([4, 7, 29]), rng.normal(size=5)
    for g, y in ((straight.modes, xhat), (curved(straight, 2, 2), xhat[:2])):
        by_number = numbered(g)
        assert (by_number.dim, by_number.r) == (d, len(y))
        assert np.array_equal(by_number.place(points, y), g.place(X[points], y))
        for a, b in zip(by_number.derivatives(points, y), g.derivatives(X[points], y)):
            assert np.array_equal(a, b)
        assert np.array_equal(by_number.velocity(points, y, 2.0 * y),
                              g.velocity(X[points], y, 2.0 * y))


@pytest.mark.parametrize("kind", ["modes", "curved"])
def test_misfit_tells_points_in_one_place_apart(d, kind):
    X, rng = np.concatenate([cloud(d, 20)] * 2), np.random.default_rng(6)
    xhat = rng.normal(size=(8, 1)) * np.array([1.0, 1.0])
    xhat[:, 1] **= 2
    x = X + np.einsum("sr,ndr->snd", xhat, rng.normal(size=(40, d, 2)))
    F = np.tile(np.eye(d), (8, 40, 1, 1))
    straight = basis(X, x, F, 2)
    g = straight.modes if kind == "modes" else curved(straight, 1, 3)
    runs = Snapshots(X, None, None, None, x[:, None], None, None, 1.0)
    found = map_misfit(g, runs, straight.xhat[:, None, :g.r])
    assert found.displacement < (1e-12 if kind == "modes" else 0.5)


def test_other_maps_have_no_numbers(d):
    with pytest.raises(ValueError, match="a map of the type Affine for several bodies"):
        numbered(Affine(d))


def test_a_run_of_several_bodies_takes_maps_of_modes_alone():
    full = ldm_full_model(loads(SCENE))
    with pytest.raises(ValueError, match="a map of the type Affine for several bodies"):
        ldm_run(full, Affine(2), RunOptions(), np.zeros(6))


@pytest.mark.parametrize("transfer", ["pic", "apic", "mls"])
@pytest.mark.parametrize("options", [
    RunOptions(points=12, samples="pivoted"), RunOptions(points=12, samples="kept"),
    RunOptions(driven_weight=16.0), RunOptions(projection="nonlinear"),
    RunOptions(points=12, deformation_gradient="evolved")],
    ids=["pivoted", "kept", "weights", "nonlinear", "evolved"])
def test_numbers_of_points_change_no_bit(options, transfer, monkeypatch):
    """A run on modes by the numbers of points is that by their places at rest."""
    hard = SCENE.index('[[body]]\nname = "hard"')
    scene = loads((SCENE[:hard] + SCENE[SCENE.index("[[fixed]]"):]).replace(
        "steps = 8", "steps = 8\nevery = 1").replace('"pic"', f'"{transfer}"'))
    x, F = simulated(scene)
    full = ldm_full_model(scene)
    g = modes(full.X, x, F, 4)
    assert with_numbers(full, g, options)[0].by_number
    assert with_numbers(full, g, RunOptions("eulerian")) == (full, g)

    def found():
        states = ldm_run(full, g, options, np.zeros(4)).states()
        return np.array([state.latent.xhat for state in states])

    by_number = found()
    monkeypatch.setattr(run_module, "with_numbers", lambda full, g, options: (full, g))
    assert np.array_equal(by_number, found())


def apart(X, d):
    """Modes of two bodies of as many points X each: the first grows, the second flies away."""
    rng = np.random.default_rng(4)
    A, away = 0.4 * rng.uniform(-1.0, 1.0, (d, d)), 1.5 * np.eye(d)[0]
    first = np.arange(2 * len(X)) < len(X)
    both = np.concatenate([X, X])
    U = np.where(first[:, None], both @ A.T, away)[:, :, None]
    slope = np.where(first[:, None, None], A, 0.0)[..., None]
    return NumberedModes(both, U, slope)


@pytest.mark.parametrize("size", [0.2, 0.02], ids=["few blocks", "many blocks"])
def test_points_near_a_place_are_found_in_each_body(d, size):
    """In one place at rest, the bodies are apart in motion."""
    X, distance, rng = cloud(d, 1500), 0.1, np.random.default_rng(5)
    g = apart(X, d)
    found = body_blocks(g.X, (len(X), len(X)), size)
    assert (found.blocks[0].above is not None) == (size < 0.1)
    assert size > 0.1 or len(found.blocks[0].center) > MANY
    x = g.place(np.arange(2 * len(X)), np.ones(1))
    for samples in (rng.choice(len(X), 3), len(X) + rng.choice(len(X), 3)):
        off = np.abs(x[:, None] - x[samples]).max(axis=2).min(axis=1)
        near = found.near(g, np.ones(1), x[samples], distance)
        assert len(np.unique(near)) == len(near) < len(x)
        assert np.isin(np.flatnonzero(off <= distance), near).all()


def test_each_body_has_samples():
    small = SCENE.replace("[0.5, 0.4]", "[0.2, 0.3]")
    full = ldm_full_model(loads(small))
    soft, hard = full.body_points
    assert (len(soft), len(hard)) == (48, 4)
    g = numbered(modes(full.X, full.X + np.random.default_rng(0).normal(size=(3, *full.X.shape)),
                       np.tile(np.eye(2), (3, len(full.X), 1, 1)), 2))
    for seed in range(20):
        draw = random_draw(full, g, RunOptions(points=30))
        points = draw(np.random.default_rng(seed))
        assert len(points) == 30
        assert np.isin(points, hard).sum() == min(PER_GROUP, len(hard))


@pytest.mark.parametrize("quadrature", ["eulerian", "resampled"])
def test_other_quadratures_are_refused(quadrature):
    full = ldm_full_model(loads(SCENE))
    g, _ = anything(full.X[:2])
    with pytest.raises(ValueError, match=f"quadrature = '{quadrature}' with 2 bodies: expected"):
        ldm_model(full, g, RunOptions(quadrature))


@pytest.mark.parametrize(("edit", "said"), [
    (('material = { law = "fixed_corotated", E = 1.0e6, nu = 0.2 }',
      'material = { law = "hencky", E = 1.0e6, nu = 0.2, flow = { type = "von_mises", '
      'tau_y = 1e3 } }'), "plastic flow"),
    (("[[fixed]]", '[[contact]]\nbodies = ["soft", "hard"]\n\n[[fixed]]'), "contact of bodies"),
], ids=["flow", "contact"])
def test_features_of_any_body_are_refused(edit, said):
    with pytest.raises(ValueError, match=f"has {said}: reduced runs know none"):
        ldm_full_model(loads(SCENE.replace(*edit)))


def test_laws_of_bodies_follow_one_another():
    full = ldm_full_model(loads(SCENE))
    assert isinstance(full.law, BodyLaws)
    assert [(one.first, one.last) for one in full.law.portions] == [(0, 48), (48, 80)]
    assert [one.tolist() for one in full.body_points] == [list(range(48)), list(range(48, 80))]
