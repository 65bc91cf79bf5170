import json
import re
from inspect import signature
from pathlib import Path

import msgspec
import numpy as np
import pytest

from mpm_ref import materials, scene
from mpm_ref.scene import SceneError, build, canonical, digest, dumps, load, loads
from mpm_ref.scene.records import Flow, Material
from mpm_ref.scene.validate import validate_scene
from validation.common import targets

SCENES = sorted((Path(__file__).parents[2] / "scenes").glob("*.toml"))
SMALL = [file for file in SCENES    # built in a moment; those of HOT are in test_hot_scenes
         if not file.name.startswith(("nsf_", "hot_"))]

DATA = Path(__file__).parents[1] / "support/data"
RICH = (DATA / "rich.toml").read_text()      # a scene with a little of everything
TINY = (DATA / "tiny.toml").read_text()      # the shortest one


# text and hash

@pytest.mark.parametrize("text", [RICH, TINY, *(file.read_text() for file in SCENES)],
                         ids=["rich", "tiny", *(file.stem for file in SCENES)])
def test_round_trip(text):
    first = loads(text)
    assert loads(dumps(first)) == first
    assert loads(canonical(first)) == first
    assert validate_scene(first) == first


def test_hash_does_not_depend_on_how_it_is_written():
    same = loads("title = ''\nseed = 0\nunstable = 'refuse'\n" + TINY.replace("2.0", "2"))
    assert digest(same) == digest(loads(TINY))
    assert canonical(same) == canonical(loads(TINY))
    assert re.fullmatch("[0-9a-f]{64}", digest(same))
    keys = list(json.loads(canonical(same)))
    assert keys == sorted(keys)


@pytest.mark.parametrize("change", [("seed", 1), ("dx", 0.1 + 1e-15), ("title", "other"),
                                    ("unstable", "allow"), ("cfl", 0.5)])
def test_hash_depends_on_every_key(change):
    changed = msgspec.structs.replace(loads(TINY), **dict([change]))
    assert digest(changed) != digest(loads(TINY))


def test_awkward_texts_survive():
    awkward = msgspec.structs.replace(loads(TINY), title="a \"b\" \\ \n \t \x7f \u20ac \U0001f600")
    assert loads(dumps(awkward)) == awkward


def test_python_has_the_names_of_the_file():
    made = scene.Scene(
        dim=2, dx=0.1, steps=1,
        body=(scene.Body(name="a", density=2.0, shape=scene.Box(lower=(0.0, 0.0), upper=(1.0, 1.0)),
                         material=scene.Material(law="fixed_corotated", E=100.0, nu=0.3)),),
    )
    assert made == loads(TINY)
    assert digest(made) == digest(loads(TINY))


def test_numpy_values_are_taken_and_checked():
    made = loads(TINY)
    with_numpy = msgspec.structs.replace(made, dx=np.float64(0.1), gravity=np.array([0.0, -1.0]),
                                         steps=np.int64(1))
    assert validate_scene(with_numpy).gravity == (0.0, -1.0)
    with pytest.raises(SceneError, match=r"^gravity\[1\] = nan"):
        build(msgspec.structs.replace(made, gravity=np.array([0.0, np.nan])))
    with pytest.raises(SceneError, match=r"^dx = 'x': expected a number"):
        digest(msgspec.structs.replace(made, dx="x"))
    with pytest.raises(SceneError, match="expected a number, a text"):
        digest(msgspec.structs.replace(made, dx=object()))


def test_file_names_start_at_the_scene(tmp_path):
    np.savez(tmp_path / "dots.npz", x=np.ones((3, 2)), V0=np.ones(3))
    text = TINY.replace('shape = { type = "box", lower = [0.0, 0.0], upper = [1.0, 1.0] }',
                        'particles = { file = "dots.npz" }')
    (tmp_path / "dots.toml").write_text(text)
    found = load(tmp_path / "dots.toml")
    assert len(build(found).bodies[0].id) == 3
    elsewhere = loads(text, folder=tmp_path)
    assert digest(found) == digest(elsewhere)
    np.savez(tmp_path / "dots.npz", x=np.ones((4, 2)), V0=np.ones(4))
    assert digest(found) != digest(msgspec.structs.replace(elsewhere, seed=1))


def test_hash_holds_what_is_in_files(tmp_path):
    file = tmp_path / "dots.npz"
    text = TINY.replace('shape = { type = "box", lower = [0.0, 0.0], upper = [1.0, 1.0] }',
                        f'particles = {{ file = "{file}" }}')
    np.savez(file, x=np.ones((3, 2)), V0=np.ones(3))
    before, held = digest(loads(text)), canonical(loads(text))
    assert str(tmp_path) not in held
    assert loads(held, folder=tmp_path).body[0].particles.sha256 is not None
    build(loads(held, folder=tmp_path))
    np.savez(file, x=np.zeros((3, 2)), V0=np.ones(3))
    assert digest(loads(text)) != before
    with pytest.raises(SceneError, match=r"body\[0\].particles.sha256: the file .* something else"):
        build(loads(held, folder=tmp_path))


def test_what_building_finds_begins_with_the_source():
    text = TINY.replace("upper = [1.0, 1.0]", "upper = [1e-3, 1e-3]")
    with pytest.raises(SceneError, match=r"^body\[0\].sampling: no sample point"):
        build(loads(text))
    with pytest.raises(SceneError, match=r"^tiny.toml: body\[0\].sampling: no sample point"):
        build(loads(text), "tiny.toml")
    with pytest.raises(SceneError, match=r"^tiny.toml: dx = 'x': expected"):
        build(msgspec.structs.replace(loads(TINY), dx="x"), "tiny.toml")


@pytest.mark.parametrize(("name", "said"), [
    ("none.toml", "cannot be read"), (".", "cannot be read"),
    ("latin.toml", "not a text file in UTF-8"),
])
def test_unreadable_file(tmp_path, name, said):
    (tmp_path / "latin.toml").write_bytes(b"title = '\xe4'")
    with pytest.raises(SceneError, match=said):
        load(tmp_path / name)


# what is built

def test_problem_of_a_rich_scene():
    problem = build(loads(RICH))
    sand, metal = problem.bodies
    assert (sand.name, metal.name) == ("sand", "metal")
    assert len(sand.id) == 20
    assert sand.particles.C is not sand.particles.L
    assert (metal.particles.y == 10.0).all()
    assert sand.particles.m.sum() == pytest.approx(1000.0 * sand.particles.V0.sum())
    r = sand.particles.x - 1.0
    expected = np.column_stack([1.0 - 2.0 * r[:, 1], 2.0 * r[:, 0], 0.0 * r[:, 0]])
    assert np.allclose(sand.particles.v, expected, atol=1e-14)
    assert problem.clock.dt == 1e-4
    assert problem.clock.every == 2
    assert problem.scheme.degree == 3
    assert problem.limits.growth == 1.0
    assert problem.allow_unstable
    assert problem.conditions.walls.low == (3, None, 3)
    blade, = problem.conditions.colliders
    assert blade.motion.rotation.phase == pytest.approx(np.pi / 2.0)
    region, = problem.conditions.prescribed
    assert region.motion.rotation.stop == 2.0
    assert np.allclose(region.motion.translation.value(0.5), (0.5, 0.0, 0.0))
    assert problem.source == canonical(loads(RICH))


def test_problem_of_a_tiny_scene_stores_only_what_it_needs():
    problem = build(loads(TINY))
    particles = problem.bodies[0].particles
    assert problem.conditions is None
    assert problem.clip is None
    assert problem.clock.cfl == 0.5
    assert (problem.gravity == 0.0).all()
    assert particles.C is particles.L
    assert particles.y.size == particles.b.size == 0
    pic = build(loads(TINY + "[scheme]\ntransfer = 'pic'")).bodies[0].particles
    assert pic.C.size == 0
    fluid = TINY.replace('"fixed_corotated", E = 100.0, nu = 0.3', '"fluid", lam = 10.0')
    assert build(loads(fluid)).bodies[0].particles.F.ndim == 1


def test_bodies_of_one_scene_have_seeds_of_their_own():
    text = TINY.replace("material", 'sampling = { type = "poisson", count = 50 }\nmaterial')
    twice = text + text[text.index("[[body]]"):].replace('"a"', '"b"')
    a, b = build(loads(twice)).bodies
    again, _ = build(loads(twice)).bodies
    assert np.array_equal(a.particles.x, again.particles.x)
    assert not np.array_equal(a.particles.x, b.particles.x)
    other, _ = build(loads("seed = 1\n" + twice)).bodies
    assert not np.array_equal(a.particles.x, other.particles.x)


def test_rotation_is_about_the_centre_of_mass_if_no_other():
    text = TINY + "[body.velocity]\nangular = 3.0"
    particles = build(loads(text)).bodies[0].particles
    momentum = (particles.m[:, None] * particles.v).sum(axis=0)
    assert np.allclose(momentum, 0.0, atol=1e-12)
    assert np.allclose(particles.v[0], (-3.0 * (0.025 - 0.5), 3.0 * (0.025 - 0.5)))


def test_every_parameter_of_the_tables_is_a_key():
    laws = {name for make in materials.LAWS.values() for name in signature(make).parameters}
    flows = {name for entry in materials.FLOWS.values()
             for name in signature(entry.build).parameters}
    assert laws == set(Material.__struct_fields__) - {"law", "flow", "weights", "sha256",
                                                      "guard", "precision"}
    assert flows - {"dim"} == set(Flow.__struct_fields__) - {"name"}


# the scenes that come with the package

def test_all_scenes_are_here():
    asked = {"nclaw_jelly", "nclaw_sand", "nclaw_plasticine", "nclaw_water", "ldm_gravity",
             "ldm_torsion", "ldm_poke", "ldm_tower", "nsf_sand", "nsf_metal", "nsf_bread",
             "nsf_shear", "nsf_cake", "nsf_toothpaste", "nsf_jelly", "nsf_ball", "colliding_disks",
             "cantilever", "dam_break", "column_collapse", "incline", "hello", "hot_stiffness",
             "hot_twist", "hot_boxes", "hot_donut", "hot_armacat", "hot_chain", "hot_boards",
             "hot_wheel", "hot_faceless", "hot_sauce", "hot_aluminium"}
    assert {file.stem for file in SCENES} == asked


@pytest.mark.parametrize("file", SCENES, ids=lambda file: file.stem)
def test_scene_opens_with_its_sources_and_loads(file):
    text = file.read_text()
    assert text.startswith("# ")
    assert "ur choice" in text or "Every constant is that of" in text
    assert load(file).title


@pytest.mark.parametrize("file", SMALL, ids=lambda file: file.stem)
def test_scene_builds(file):
    problem = build(load(file))
    for body in problem.bodies:
        assert np.isfinite(body.particles.x).all()
        assert (body.particles.m > 0.0).all()


@pytest.mark.parametrize("name", ["jelly", "sand", "plasticine", "water"])
def test_nclaw_particles(name):
    particles = build(load(SCENES[0].parent / f"nclaw_{name}.toml")).bodies[0].particles
    assert len(particles.x) == 1000
    assert (particles.V0 == 1.25e-4).all()
    assert np.allclose(particles.m, 0.125, rtol=1e-15)
    assert np.array_equal(particles.x[[0, -1]], [[0.25] * 3, [0.75] * 3])
    r = particles.x - 0.5
    assert np.allclose(particles.v, (1.0, -1.5, -2.0) + np.cross((4.0, 4.0, 4.0), r), atol=1e-15)


def test_ldm_gravity_has_the_constants_of_the_paper():       # LDM-sec5.1, LDM-tab2-dt
    """LDM-sec5.1, with the sizes of LDM-X1 and the time step of LDM-X3."""
    paper, made = targets.load(), load(SCENES[0].parent / "ldm_gravity.toml")
    cylinder = made.body[0].shape
    assert cylinder.radius == paper["ldm.sec5_1.radius"].value
    assert cylinder.end[0] - cylinder.start[0] == paper["ldm.sec5_1.height"].value
    assert made.steps == paper["ldm.sec5_1.steps"].value
    assert -made.gravity[2] == paper["ldm.sec5_1.g_max"].value
    assert made.dt == 1.0 / 144.0
    assert len(build(made).bodies[0].id) == 1368


@pytest.mark.parametrize(("integrator", "transfer"), [("explicit", "mls"), ("hot", "apic")])
def test_transfer_where_nothing_is_said(integrator, transfer):
    problem = build(loads(f"integrator = '{integrator}'\n" + TINY))
    assert problem.scheme.transfer == transfer
    particles = problem.bodies[0].particles
    assert (particles.C is particles.L) == (transfer == "mls")
