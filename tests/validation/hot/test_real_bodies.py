"""Bodies of HOT's release: filled from tiny meshes made here, placed, exported, and named."""

import hashlib
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from mpm_ref.scene import build, load
from validation.common import user_meshes
from validation.common.record import read_records
from validation.common.registry import discover
from validation.common.run import RunSetting, attempt
from validation.hot import real_bodies, real_counts, whole_runs
from validation.hot.real_bodies import BODIES, COLLIDERS, RealBody, filled, real_scene
from validation.hot.sizes import FILL, SIZES, sized

trimesh = pytest.importorskip("trimesh")

SIDES, SHIFT, DX = (0.4, 0.3, 0.2), (1.1, 1.1, 1.1), 0.02


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The folder that the user names; its only mesh is a box, which is the wheel here."""
    file = tmp_path / "meshes" / "hot" / "box.obj"
    file.parent.mkdir(parents=True)
    trimesh.creation.box(SIDES).export(file)
    real = RealBody(file.name, hashlib.sha256(file.read_bytes()).hexdigest(), SHIFT, 12, False,
                    ("wheel",))
    monkeypatch.setitem(BODIES, "wheel", {"wheel": real})
    monkeypatch.setenv(user_meshes.VARIABLE, str(tmp_path / "meshes"))
    return tmp_path


@pytest.fixture
def box(folder):
    return BODIES["wheel"]["wheel"]


def test_vertices_come_first_and_each_particle_has_the_volume_of_its_cell(box):
    found = filled(box, DX, 0)
    x, V0 = found.points
    corners = 0.5 * np.array(SIDES) * (np.indices((2, 2, 2)).reshape(3, -1).T * 2 - 1) + SHIFT
    assert np.abs(x[:8][np.lexsort(x[:8].T)] - corners[np.lexsort(corners.T)]).max() < 1e-12
    assert (found.vertices, len(x)) == (8, 8 + round(FILL * 0.024 * 12 / DX**3))
    assert (np.abs(x[8:] - SHIFT) < 0.5 * np.array(SIDES)).all()
    assert V0 == pytest.approx(DX**3 / 12, rel=1e-14)
    assert found.volume == pytest.approx(0.024, rel=1e-12)


def test_a_body_that_shares_its_volume_has_the_volume_of_its_mesh(box):
    found = filled(box._replace(shares=True), DX, 0)
    assert found.vertices == 8
    assert found.points.V0.sum() == pytest.approx(0.024, rel=1e-12)


def test_otherwise_vertices_are_no_particles(box):
    found, released = filled(box, DX, 0, as_released=False), filled(box, DX, 0)
    assert np.array_equal(found.points.x, released.points.x[8:])
    assert found.points.V0.sum() == pytest.approx(0.024, rel=1e-12)


def test_scene_has_the_real_body_and_the_rest_as_it_was(folder):
    stand_in = sized("hot_wheel", "quick")
    scene = real_scene("wheel", stand_in, folder)
    (body,), (floor, press) = scene.body, scene.collider
    assert (body.name, body.density) == ("wheel", 2700.0)
    assert body.material == stand_in.body[0].material
    assert (floor, press.shape) == (stand_in.collider[0], COLLIDERS["wheel"]["press"])
    assert press.motion == stand_in.collider[1].motion
    particles = build(scene).bodies[0].particles
    assert particles.m == pytest.approx(2700.0 * scene.dx**3 / 12)
    assert 0.5 * (particles.x.max(axis=0) + particles.x.min(axis=0)) == pytest.approx(SHIFT)


def test_one_mesh_stands_for_two_bodies_and_others_stay(folder, box, monkeypatch):
    monkeypatch.setitem(BODIES, "donut", {"bar": box._replace(replaces=("left bar", "right bar"))})
    scene = real_scene("donut", sized("hot_donut", "quick"), folder)
    assert [body.name for body in scene.body] == ["ring", "bar"]
    assert scene.body[0] == sized("hot_donut", "quick").body[0]


def test_every_real_body_replaces_bodies_of_its_scene_at_the_printed_size():
    for name, reals in BODIES.items():
        names = {body.name for body in sized(f"hot_{name}", "paper").body}
        assert {old for real in reals.values() for old in real.replaces} <= names
        assert SIZES[f"hot_{name}"].paper is not None
        colliders = {c.name for c in sized(f"hot_{name}", "paper").collider}
        assert set(COLLIDERS.get(name, ())) <= colliders


def test_another_file_is_refused_in_a_sentence(folder):
    file = folder / "meshes" / "hot" / "box.obj"
    file.write_text(file.read_text() + "\n")
    with pytest.raises(ValueError, match=r"box\.obj: another file .* its sha256 is [0-9a-f]{64}, "
                                         r"expected [0-9a-f]{64}; take"):
        real_bodies.absent("wheel")


def test_what_is_absent_is_said(folder, monkeypatch):
    assert real_bodies.absent("wheel") == ""
    assert real_bodies.bodies_text("wheel") == "bodies from meshes of the release: wheel (box.obj)"
    assert "hot/bar.obj" in real_bodies.absent("donut")
    assert real_bodies.bodies_text("donut").startswith("bodies stand for the release's: "
                                                       "MPM_REF_MESHES names no folder with")
    monkeypatch.delenv(user_meshes.VARIABLE)
    assert "hot/box.obj" in real_bodies.absent("wheel")


def test_exported_scene_has_the_same_particles_and_needs_no_trimesh(folder, monkeypatch):
    monkeypatch.setitem(SIZES, "hot_wheel", SIZES["hot_wheel"]._replace(paper=DX))
    done = CliRunner().invoke(command(), [str(folder / "out"), "wheel"], catch_exceptions=False)
    assert done.exit_code == 0
    expected = build(real_scene("wheel", sized("hot_wheel", "paper"), folder))
    monkeypatch.setitem(sys.modules, "trimesh", None)
    (folder / "out").rename(folder / "elsewhere")
    problem = build(load(folder / "elsewhere" / "hot_wheel.toml"))
    for a, b in zip(problem.bodies[0].particles, expected.bodies[0].particles, strict=True):
        assert np.array_equal(a, b)
    done = CliRunner().invoke(command(), [str(folder / "out"), "donut"])
    assert done.exit_code == 2
    assert "bar.obj" in done.output


def command():
    app = real_bodies.typer.Typer()
    app.command()(real_bodies.main)
    return app


def test_run_at_the_printed_size_notes_its_bodies(folder, monkeypatch):
    notes, scene = [], sized("hot_wheel", "quick")
    run = SimpleNamespace(folder=folder / "results", note=notes.append)
    real = whole_runs.printed_bodies(run, "wheel", scene)
    assert real.body[0].particles.file == str(folder / "results" / "states" / "wheel-wheel.npz")
    assert (folder / "results" / "states" / ".gitignore").read_text() == "*\n"
    monkeypatch.delenv(user_meshes.VARIABLE)
    assert whole_runs.printed_bodies(run, "wheel", scene) is scene
    assert ["(box.obj)" in note for note in notes] == [True, False]


def recorded(folder, monkeypatch):
    """The records {end of the id: record} of the experiment on the wheel alone."""
    monkeypatch.setattr(real_counts, "BODIES", {"wheel": BODIES["wheel"]})
    monkeypatch.setattr(real_counts, "sized", lambda name, profile, **changes: sized(
        name, "quick", **changes))
    monkeypatch.setattr(real_counts, "START_TIMES", {"wheel": 0.05, "armacat_stiff": 0.05})
    experiment = discover().experiments[real_counts.ID]
    attempt(experiment, RunSetting("standard", folder / "out"), Progress())
    records = read_records(folder / "out" / f"{real_counts.ID}.json")
    return {record.target.removeprefix(f"{real_counts.ID}."): record for record in records}


class Progress:
    """No bars."""

    def inner(self, iterable, desc):
        return iterable


def test_experiment_counts_particles_and_takes_steps(folder, box, monkeypatch):
    records = recorded(folder, monkeypatch)
    dx = sized("hot_wheel", "quick").dx
    count = 8 + round(FILL * 0.024 * 12 / dx**3)
    assert records["wheel.particles"].value == count
    assert records["wheel.particles"].bound == pytest.approx((0.95 * 550_000, 1.05 * 550_000))
    assert records["wheel.wheel.excess"].value == pytest.approx(count * dx**3 / 12 / 0.024)
    assert records["wheel.done"].value == 1.0
    assert records["wheel.converged"].value == 1.0


def test_experiment_without_meshes_names_stand_ins_and_judges_nothing(folder, monkeypatch):
    monkeypatch.delenv(user_meshes.VARIABLE)
    records = recorded(folder, monkeypatch)
    assert records["wheel.particles"].comparator == "info"
    assert "stand-ins" in records["wheel.particles"].scale
    assert "hot/box.obj" in records["wheel.particles"].note
    assert {record.comparator for record in records.values()} == {"info", "remark"}
