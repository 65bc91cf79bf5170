"""The code uses no array, stage, kernel or library that a scene has no use for."""

import json
import subprocess

import pytest
from needs_toys import BLOCK, DROP, FLOOR, HEAD

from mpm_ref.core.grid import Storage
from mpm_ref.needs import code_parts as module
from mpm_ref.needs.code_parts import STAGES, CodeParts, code_parts, table_lines
from mpm_ref.needs.code_probe import ALWAYS, NEVER, RARELY, particle_arrays, svd_of
from mpm_ref.scene import build, loads

FLOWS = {
    "none": "hencky", "von_mises": "hencky", "von_mises_hardening": "hencky",
    "drucker_prager": "hencky", "snow_clamp": "neo_hookean",
}
VALUES = {
    "none": "", "von_mises": ", tau_y = 1.0", "von_mises_hardening": ", tau_y = 1.0, xi = 0.1",
    "von_mises_softening": ", tau_y = 1.0, theta = 0.1",
    "drucker_prager": ", friction_angle = 30.0", "snow_clamp": ", s_min = 0.9, s_max = 1.1",
}
IMPLICIT = HEAD.replace("dt = 0.001", "cfl = 0.6").replace("0.1\n", "0.2\n") + """
integrator = "hot"
[[body]]
name = "block"
density = 1000.0
shape = { type = "box", lower = [0.3, 0.1], upper = [0.5, 0.3] }
velocity = { linear = [0.2, 0.0] }
material = { law = "fixed_corotated", E = 1e5, nu = 0.3 }

[[fixed]]
region = { type = "box", lower = [0.0, 0.0], upper = [0.35, 1.0] }
"""


def body_of(law="hencky", flow="none", scheme='{ transfer = "mls" }', dim=2):
    """A body of a law and a flow under a scheme."""
    law = f'law = "{law}", ' + ("lam = 1e4" if law == "fluid" else "E = 1e5, nu = 0.3")
    zero = ", ".join(["0.0"] * dim)
    return build(loads(f"""
dim = {dim}
dx = 0.1
dt = 0.001
end = 0.1
scheme = {scheme}
[[body]]
name = "ball"
density = 1.0
shape = {{ type = "sphere", center = [{zero}], radius = 0.1 }}
material = {{ {law}, flow = {{ type = "{flow}"{VALUES[flow]} }} }}
""")).bodies[0]


# arrays: bytes per particle are those of the fields that the scene needs, zero for the others

def test_fluid_carries_J_and_pressure_alone(d):
    body = body_of("fluid", dim=d)
    sizes, n = particle_arrays(body), len(body.id)
    assert sizes["F"] == sizes["tau"] == 8 * n
    assert particle_arrays(body_of("hencky", dim=d))["F"] == 8 * n * d * d


@pytest.mark.parametrize(("scheme", "C", "L"), [
    ('{ transfer = "mls" }', 4, 0),             # one array for both
    ('{ transfer = "apic" }', 4, 4),
    ('{ transfer = "pic" }', 0, 4),
    ('{ transfer = "flip" }', 0, 4),
])
def test_affine_field_is_carried_by_affine_transfers_alone(scheme, C, L):
    body = body_of(scheme=scheme)
    sizes, n = particle_arrays(body), len(body.id)
    assert (sizes["C"], sizes["L"]) == (8 * n * C, 8 * n * L)


@pytest.mark.parametrize("flow", FLOWS)
def test_history_is_carried_by_hardening_alone(flow):
    sizes = particle_arrays(body_of(FLOWS[flow], flow))
    assert (sizes["y"] > 0) == (flow == "von_mises_hardening")
    assert sizes["b"] == 0


def test_grid_carries_forces_and_old_velocities_for_flip_alone():
    for flip in (False, True):
        grid = Storage(0.1, (0, 1, 2), 2, flip=flip).cover([body_of().particles.x])
        assert (grid.f.nbytes > 0) == (grid.v_old.nbytes > 0) == flip


# formulas

@pytest.mark.parametrize(("law", "flow", "expected"), [
    ("fluid", "none", NEVER),
    ("neo_hookean", "none", NEVER),
    ("fixed_corotated", "none", RARELY),
    ("hencky", "none", RARELY),
    ("hencky", "von_mises", RARELY),
    ("fixed_corotated", "von_mises_softening", ALWAYS),
    ("neo_hookean", "snow_clamp", ALWAYS),
])
def test_svd(law, flow, expected):
    assert svd_of(body_of(law, flow)) == expected


def test_svd_in_every_step_where_stretches_are_lifted():
    body = body_of("hencky", "von_mises")
    lifted = body._replace(flow=body.flow._replace(s_min=0.95))
    assert svd_of(lifted) == ALWAYS


# stages and kernels, in a process of their own

@pytest.fixture(scope="module")
def drop():
    return code_parts(loads(DROP.partition("[[collider]]")[0]))


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    return code_parts(loads(HEAD + BLOCK + FLOOR))


def entered(parts):
    """The stages that a run entered."""
    return {stage for stage, names in parts.stages.items() if names}


def test_free_drop_of_fluid_enters_no_other_stage(drop):
    assert drop.steps == 50
    assert entered(drop) == {"sort particles by cell", "particles to grid", "velocities of nodes",
                             "grid to particles", "J alone"}
    others = "hot.", "core.boundary", "core.contact", "rom.", "nclaw.", "materials.learned"
    assert not any(name.startswith(others) for name in drop.kernels)
    assert "core.levelset._all_normals" not in drop.kernels
    assert "core.deform.stress_fluid" in drop.kernels


def test_block_on_a_floor_enters_boundaries_and_return_map(block):
    assert entered(block) == {
        "sort particles by cell", "particles to grid", "velocities of nodes", "grid to particles",
        "colliders and regions: nodes tested", "colliders, regions, walls: nodes in contact", "F",
        "return map"}
    assert not block.implicit
    assert "core.deform.fluid" not in block.kernels


def test_averaged_volumes_are_a_stage():
    text = DROP.partition("[[collider]]")[0]
    parts = code_parts(loads(text.replace("scheme = { ", "scheme = { f_bar = true, ")))
    assert len(parts.stages["averaged volumes"]) == 2


def test_each_kernel_has_one_form_but_distances(drop, block):
    for parts in (drop, block):
        assert {name for name, forms in parts.kernels.items() if forms > 1} <= {
            "core.levelset._all_distances"}


def test_torch_is_not_loaded(drop, block):
    assert not drop.torch
    assert not block.torch


@pytest.mark.slow
def test_implicit_steps_enter_solver_and_multigrid():
    parts = code_parts(loads(IMPLICIT))
    assert {"implicit solve", "multigrid"} <= entered(parts)
    assert "velocities of nodes" not in entered(parts)


# the table, and the file

def test_table_has_a_column_for_each_scene(drop, block):
    lines = table_lines({"as given": block, "lean": drop})
    rows = {line[:-26].strip(): line[-26:].split() for line in lines}
    assert lines[0].split()[-3:] == ["as", "given", "lean"]
    assert rows["C, affine velocity"] == ["32", "0"]         # the lean scene has no such body
    assert rows["return map"] == ["1", "0"]
    assert rows["multigrid"] == ["0", "0"]
    assert set(STAGES) <= rows.keys()


def test_stored_parts_are_read_unless_damaged(drop, tmp_path, monkeypatch):
    calls, stdout = [], json.dumps(vars(drop)).encode()

    def run(*arguments, **options):
        calls.append(arguments)
        return subprocess.CompletedProcess(arguments, 0, stdout)

    monkeypatch.setattr(module.subprocess, "run", run)
    scene = loads(DROP)
    assert code_parts(scene, tmp_path) == code_parts(scene, tmp_path) == drop
    assert len(calls) == 1
    file, = tmp_path.iterdir()
    file.write_text("{")
    assert code_parts(scene, tmp_path) == drop
    assert len(calls) == 2


def test_failure_of_the_process_is_one_sentence(monkeypatch):
    monkeypatch.setattr(module.code_probe, "__name__", "mpm_ref.no_such_module")
    with pytest.raises(RuntimeError, match="no_such_module"):
        code_parts(loads(DROP))


def test_no_module_of_the_current_folder_is_loaded(drop, tmp_path, monkeypatch):
    (tmp_path / "numba.py").write_text("raise SystemExit('a stranger')\n")
    monkeypatch.chdir(tmp_path)
    assert code_parts(loads(DROP.partition("[[collider]]")[0])) == drop


def test_a_process_that_takes_too_long_is_one_sentence(monkeypatch):
    monkeypatch.setattr(module, "LONGEST", 0.01)
    with pytest.raises(RuntimeError, match=r"took over 0\.01 s"):
        code_parts(loads(DROP))


def test_without_scenes_there_is_no_table():
    assert table_lines({}) == []


def test_facts_are_plain(drop):
    assert CodeParts(**{name: drop.facts[name] for name in vars(drop)}) == drop
    assert drop.facts["stages"]["multigrid"] == []
