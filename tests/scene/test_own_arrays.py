"""Problems from arrays in memory, and the code of docs/howto/own-arrays.md."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

from mpm_ref.body import restore_order
from mpm_ref.materials import LAWS
from mpm_ref.scene import SceneError, Sphere, Walls, build, loads, problem_from_arrays
from mpm_ref.simulate import simulate
from mpm_ref.store.manifest import scene_hash

PAGE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "own-arrays.md"
SOLID = {"law": "hencky", "E": 100.0, "nu": 0.3}
FLUID = {"law": "fluid", "lam": 10.0}
N = 30


@pytest.fixture
def arrays(d, rng):
    """Arrays of N particles in d dimensions."""
    return {"x": 0.5 + 0.2 * rng.random((N, d)), "v": 0.01 * rng.normal(size=(N, d)),
            "C": 0.01 * rng.normal(size=(N, d, d)),
            "F": np.eye(d) + 0.01 * rng.normal(size=(N, d, d)),
            "m": rng.uniform(1.0, 2.0, N), "V0": rng.uniform(1.0, 2.0, N) * 1e-3}


def of(bodies, **keys):
    return problem_from_arrays(bodies, **{"dx": 0.1, "cfl": 0.3, "steps": 3} | keys)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The names of the page's code, run as one file."""
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    file = tmp_path_factory.mktemp("page") / "own_arrays.py"
    file.write_text("\n".join(blocks))
    laws = dict(LAWS)
    yield runpy.run_path(str(file), run_name="__main__")
    LAWS.clear()
    LAWS.update(laws)


def test_the_code_of_the_page_runs(page):
    assert page["positions"].shape == (4, 400, 2)
    assert np.array_equal(page["positions"][0], page["x"])
    assert page["times"] == pytest.approx([0.0, 3e-3, 6e-3, 9e-3])
    assert page["du"].shape == page["place"].shape == page["nodes"].shape
    inside = (page["place"] > 0.2) & (page["place"] < 0.6)
    assert inside.all()
    assert page["du"][:, 1].mean() < 0.0
    assert page["t"] == pytest.approx(4.5e-4)


def test_loose_points_of_the_page_are_right(page):
    assert np.allclose(page["elastic"].P @ page["F"].swapaxes(1, 2), page["elastic"].tau)
    deviator = page["plastic"].tau - np.trace(
        page["plastic"].tau, axis1=1, axis2=2)[:, None, None] / 2.0 * np.eye(2)
    assert np.linalg.norm(deviator, axis=(1, 2)).max() <= 500.0 * (1.0 + 1e-9)


def test_the_law_of_the_page_runs_by_its_name(page):
    body = page["block"] | {"material": {"law": "rubber", "E": 3e4, "lam": 1e4}}
    law = page["Rubber"](1e4, 1e4)
    problem = of({"block": body}, dx=0.05)
    assert problem.bodies[0].law == law
    assert list(simulate(problem))[-1].state.step == 3


def test_the_transfer_of_the_page_damps(page):
    problem = of({"block": page["block"]}, dx=0.05, scheme={"transfer": "apic"})
    plain, stepper = problem.stepper(), page["stepper"]
    other = of({"block": page["block"]}, dx=0.05, scheme={"transfer": "apic"}, gravity=(0.0, -9.8))
    for one, made in ((plain, problem), (stepper, other)):
        one.start(made.bodies)
        made.bodies[0].particles.v[:] = made.bodies[0].particles.x
        one.step(made.bodies, 0.0, 1e-4)
    damped, kept = (made.bodies[0].particles.C for made in (other, problem))
    assert np.allclose(damped, 0.1 * kept, rtol=1e-6, atol=1e-12)


def test_the_shape_of_the_page_has_its_area(page):
    area = np.pi * (0.2**2 + 0.05**2 / 2.0)
    assert page["points"].V0.sum() == pytest.approx(area, rel=1e-2)
    assert page["problem"].bodies[0].name == "star"


def test_all_arrays_arrive_and_are_copied(d, arrays):
    problem = of({"a": {"material": SOLID, **arrays}}, scheme={"transfer": "apic"})
    q = problem.bodies[0].particles
    for name, a in arrays.items():
        assert np.array_equal(getattr(q, name), a)
        assert not np.shares_memory(getattr(q, name), a)


@pytest.mark.parametrize("given", [
    ("m", "V0"), ("m", "density"), ("V0", "density")])
def test_two_of_mass_volume_and_density(arrays, given):
    density = arrays["m"] / arrays["V0"]
    every = arrays | {"density": density}
    q = of({"a": {"material": SOLID, "x": arrays["x"], **{name: every[name] for name in given}}}
           ).bodies[0].particles
    assert np.allclose(q.m, arrays["m"], rtol=1e-14)
    assert np.allclose(q.V0, arrays["V0"], rtol=1e-14)


def test_one_number_is_the_density_of_all(arrays):
    q = of({"a": {"material": SOLID, "x": arrays["x"], "m": arrays["m"], "density": 500.0}}
           ).bodies[0].particles
    assert np.array_equal(q.V0, arrays["m"] / 500.0)


def test_several_bodies_and_conditions_run(d, arrays):
    fluid = {name: arrays[name] for name in ("x", "m", "V0")}
    bodies = {"solid": {"material": SOLID, **arrays},
              "fluid": {"material": FLUID, **fluid, "J": np.full(N, 1.01), "offset": d * (0.3,),
                        "velocity": {"linear": d * (0.5,)}}}
    ball = {"shape": Sphere(center=d * (0.1,), radius=0.1), "kind": "slip"}
    problem = of(bodies, walls=Walls(low=d * (1,), high=d * (30,)), collider=[ball],
                 gravity=np.full(d, -1.0), title="two")
    assert np.array_equal(problem.bodies[1].particles.x, arrays["x"] + 0.3)
    assert (problem.bodies[1].particles.F == 1.01).all()
    assert (problem.bodies[1].particles.v == 0.5).all()
    assert len(problem.conditions.colliders) == 1
    assert problem.conditions.walls.low == d * (1,)
    assert list(simulate(problem))[-1].state.step == 3


def test_an_implicit_run(arrays):
    bodies = {"a": {"material": SOLID, **{n: arrays[n] for n in ("x", "v", "m", "V0")}}}
    problem = of(bodies, integrator="hot", solver={"eps": 1e-5}, cfl=None, dt=1e-3)
    last = list(simulate(problem))[-1].state
    assert last.solve.converged


def test_a_file_makes_the_same_problem(tmp_path, d, arrays):
    number = np.arange(2 * N) % 2
    both = {name: np.repeat(a, 2, axis=0) for name, a in arrays.items()}
    np.savez(tmp_path / "state.npz", body=number, **both)
    text = f"""
        dim = {d}
        dx = 0.1
        cfl = 0.3
        steps = 3
        [[body]]
        name = "a"
        material = {{ law = "hencky", E = 100.0, nu = 0.3 }}
        particles = {{ file = "state.npz", select = 1, offset = {d * [0.25]} }}
        """
    ours = build(loads(text, folder=tmp_path))
    theirs = of({"a": {"material": SOLID, **arrays, "offset": d * (0.25,)}})
    for a, b in zip(ours.bodies[0].particles, theirs.bodies[0].particles, strict=True):
        assert np.array_equal(a, b)


def test_the_text_of_a_problem_knows_its_arrays(arrays):
    def hashed(**more):
        return scene_hash(of({"a": {"material": SOLID, **arrays, **more}}))

    assert hashed() == hashed()
    assert hashed() != hashed(v=2.0 * arrays["v"])
    with pytest.raises(SceneError, match="were handed over in Python: use problem_from_arrays"):
        build(loads(of({"a": {"material": SOLID, **arrays}}).source))


def test_order_is_restored(arrays):
    problem = of({"a": {"material": SOLID, **arrays}}, every=1)
    for frame in simulate(problem):
        body = frame.state.bodies[0]
        assert np.array_equal(restore_order(body.particles.m, body.id), arrays["m"])


@pytest.mark.parametrize(("change", "said"), [
    ({"x": None}, r"bodies\['a'\]: the array x has shape \(0,\): expected \(N, 2\) or \(N, 3\), "
                  r"positions \[m\]"),
    ({"x": np.ones((4, 4))}, r"has shape \(4, 4\): expected \(N, 2\) or \(N, 3\)"),
    ({"v": np.ones(N)}, r"bodies\['a'\]: the array v has shape \(30,\): expected \(30, 2\), "
                        r"velocities \[m/s\]"),
    ({"m": np.zeros(N)}, r"the array m has 0.0 for particle 0: expected a finite number > 0, "
                         r"masses \[kg\]"),
    ({"F": np.ones((N, 2, 2), dtype=complex)}, r"type complex128: expected real numbers, "
                                               r"deformation gradients \[1\]"),
    ({"V0": None}, r"given of m \[kg\], V0 \[m\^d\] and density \[kg/m\^d\]: m; expected two"),
    ({"density": 1.0}, "m, V0, density; expected two"),
    ({"mass": np.ones(N)}, r"unknown key 'mass'; expected material, .* m masses \[kg\]"),
    ({"material": None}, r"body\[0\].material: this key is missing"),
    ({"material": {"law": "hencky"}}, r"body\[0\].material"),
    ({"J": np.ones(N), "F": None}, "the array F is missing"),
    ({"velocity": {"linear": (1.0, 0.0)}}, "the arrays have velocities v; leave this table out"),
    ({"offset": (1.0, 0.0, 0.0)}, "expected 2 numbers"),
])
def test_bad_arrays_are_refused(rng, change, said):
    body = {"material": SOLID, "x": rng.random((N, 2)), "v": np.zeros((N, 2)),
            "F": np.tile(np.eye(2), (N, 1, 1)), "m": np.ones(N), "V0": np.ones(N)}
    body = {key: value for key, value in (body | change).items() if value is not None}
    with pytest.raises(SceneError, match=said) as caught:
        of({"a": body})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("keys", "said"), [
    ({"stesp": 3}, "stesp: unknown key; did you mean `steps`"),
    ({"integrator": "magic"}, "integrator = 'magic'"),
    ({"gravity": (0.0, 0.0, -1.0)}, "gravity.*expected 2 numbers"),
])
def test_bad_keys_are_refused(keys, said):
    body = {"material": SOLID, "x": np.ones((3, 2)), "m": np.ones(3), "V0": np.ones(3)}
    with pytest.raises(SceneError, match=said):
        of({"a": body}, **keys)


def test_no_body_is_refused():
    with pytest.raises(SceneError, match="expected at least one"):
        of({})
