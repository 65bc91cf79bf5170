"""Problems from arrays in memory, and the code of the how-to guides on arrays and additions."""

import contextlib
import re
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from mpm_ref.body import restore_order
from mpm_ref.constitutive import return_map
from mpm_ref.materials import FLOWS, LAWS
from mpm_ref.scene import SceneError, Sphere, Walls, build, loads, problem_from_arrays
from mpm_ref.simulate import simulate
from mpm_ref.store.manifest import scene_hash
from mpm_ref.store.results import Results

pytestmark = pytest.mark.slow

PAGES = Path(__file__).resolve().parents[2] / "docs" / "howto"
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


def names_of(page, folder):
    """Return the names that the code of a page defines, its blocks run as one file."""
    text = (PAGES / f"{page}.md").read_text(encoding="utf-8")
    file = folder.mktemp("page") / f"{page.replace('-', '_')}.py"
    file.write_text("\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL)))
    with contextlib.chdir(file.parent):             # the code of a page may write files
        return runpy.run_path(str(file), run_name="__main__") | {"folder": file.parent}


@pytest.fixture(scope="module")
def arrays_page(tmp_path_factory):
    return names_of("own-arrays", tmp_path_factory)


@pytest.fixture(scope="module")
def states_page(tmp_path_factory):
    return names_of("read-states", tmp_path_factory)


def registries():
    """Return the tables of names and of kernels by type, to which a law or a flow is added."""
    functions = {id(value): value for name, module in list(sys.modules.items())
                 if name.startswith("mpm_ref.") for value in vars(module).values()
                 if isinstance(getattr(value, "methods", None), dict)}
    return [LAWS, FLOWS, *(function.methods for function in functions.values())]


@pytest.fixture(scope="module")
def additions_page(tmp_path_factory):
    tables = [(table, dict(table)) for table in registries()]
    yield names_of("add-a-law", tmp_path_factory)
    for table, content in tables:
        table.clear()
        table.update(content)


def test_the_code_on_own_arrays_runs(arrays_page):
    assert arrays_page["frame"].t == pytest.approx(0.05)
    assert arrays_page["t"] == pytest.approx(4.5e-4)


def test_a_run_of_arrays_is_stored_in_their_order(arrays_page):
    assert arrays_page["outcome"].why == "finished"
    with Results(arrays_page["folder"] / "run.h5") as results:
        assert len(results) == 6
        assert np.array_equal(results.field("block", "x")[0], arrays_page["x"])


def test_laws_without_a_simulation_are_right(arrays_page):
    elastic, plastic = arrays_page["elastic"], arrays_page["plastic"]
    assert np.allclose(elastic.P @ arrays_page["F"].swapaxes(1, 2), elastic.tau)
    pressure = np.trace(plastic.tau, axis1=1, axis2=2)[:, None, None] / 2.0 * np.eye(2)
    assert np.linalg.norm(plastic.tau - pressure, axis=(1, 2)).max() <= 500.0 * (1.0 + 1e-9)


def test_states_have_the_original_order(states_page):
    assert states_page["positions"].shape == (4, 400, 2)
    assert np.array_equal(states_page["positions"][0], states_page["x"])
    assert states_page["times"] == pytest.approx([0.0, 3e-3, 6e-3, 9e-3])
    assert states_page["t"] == pytest.approx(4.5e-4)


def test_increments_of_nodes_are_those_of_free_fall(states_page):
    grid, filled, dv = (states_page[name] for name in ("grid", "filled", "dv"))
    assert states_page["du"].shape == states_page["place"].shape == dv.shape
    assert ((states_page["place"] > 0.2) & (states_page["place"] < 0.6)).all()
    assert np.array_equal(filled, grid.m > 0.0)
    momentum = (grid.m[filled][:, None] * dv).sum(axis=0)
    assert momentum == pytest.approx((0.0, -9.8 * 1e-3 * 40.0), rel=1e-4, abs=1e-4)
    assert states_page["stepper"].report.converged


def block_of(page, **material):
    points = page["points"]
    return {"material": {"law": "rubber", "E": 3e4, "lam": 1e4, **material},
            "x": points.x, "V0": points.V0, "density": 1000.0}


def test_the_added_law_runs_by_its_name(additions_page):
    problem = of({"block": block_of(additions_page)}, dx=0.05)
    assert problem.bodies[0].law == additions_page["Rubber"](1e4, 1e4)
    assert list(simulate(problem))[-1].state.step == 3


def test_the_added_law_has_right_derivatives(additions_page):
    assert additions_page["error_P"] < 1e-7
    assert additions_page["error_dP"] < 1e-7
    law, F = additions_page["law"], additions_page["F"]
    s = np.linalg.svd(F[0], compute_uv=False)
    tau = np.linalg.eigvalsh(additions_page["response"](F, law).tau[0])[::-1]
    assert additions_page["principal_stress"](tuple(s), law) == pytest.approx(tau)


def test_the_added_law_passes_the_taylor_test(additions_page):
    ratios = np.divide(additions_page["remainders"][:-1], additions_page["remainders"][1:])
    assert ratios == pytest.approx([4.0, 4.0], rel=1e-3)


def test_the_added_law_makes_implicit_steps(additions_page):
    stretch = np.tile(np.diag((1.1, 0.95)), (len(additions_page["points"].x), 1, 1))
    block = block_of(additions_page) | {"F": stretch}
    problem = of({"block": block}, dx=0.05, integrator="hot", cfl=None, dt=1e-3)
    last = list(simulate(problem))[-1].state
    assert last.solve.converged
    assert last.solve.iterations > 0


def test_the_added_flow_relaxes_shear_and_keeps_the_volume(additions_page):
    problem = of({"block": block_of(additions_page, flow={"type": "maxwell", "eta": 1e3})}, dx=0.05)
    assert list(simulate(problem))[-1].state.step == 3
    after = return_map(additions_page["F"], additions_page["law"], problem.bodies[0].flow, dt=0.1)
    before, s = (np.log(np.linalg.svd(F, compute_uv=False)) for F in (additions_page["F"], after.F))
    assert np.allclose(s.sum(axis=1), before.sum(axis=1), rtol=1e-10, atol=1e-13)
    assert np.allclose(s[:, 0] - s[:, 1], 0.5 * (before[:, 0] - before[:, 1]))


def test_the_added_transfer_damps(additions_page):
    material = {"material": SOLID}
    made = [of({"block": block_of(additions_page) | material}, dx=0.05,
               scheme={"transfer": "apic"}, gravity=(0.0, -9.8)) for _ in range(2)]
    for problem, stepper in zip(made, (made[0].stepper(), additions_page["stepper"]), strict=True):
        stepper.start(problem.bodies)
        problem.bodies[0].particles.v[:] = problem.bodies[0].particles.x
        stepper.step(problem.bodies, 0.0, 1e-4)
    kept, damped = (problem.bodies[0].particles.C for problem in made)
    assert np.allclose(damped, 0.1 * kept, rtol=1e-6, atol=1e-12)


def test_the_added_shape_has_its_area(additions_page):
    area = np.pi * (0.2**2 + 0.05**2 / 2.0)
    assert additions_page["points"].V0.sum() == pytest.approx(area, rel=1e-2)
    assert additions_page["problem"].bodies[0].name == "star"


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
    ({"V0": None}, r"given of m \[kg\], V0 \[m\^d\] and density \[kg/m\^3\]: m; expected two"),
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
