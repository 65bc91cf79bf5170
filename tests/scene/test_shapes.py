import sys

import numpy as np
import pytest

from mpm_ref import shapes
from mpm_ref.shapes import mesh
from mpm_ref.shapes.extents import bounds, volume
from mpm_ref.shapes.inside import Solid, check_bounded, measured_volume, rotation, solid

ANALYTIC = {
    "box2": shapes.Box(lower=(-0.3, 0.1), upper=(0.5, 0.7)),
    "box3": shapes.Box(lower=(-0.3, 0.1, 0.0), upper=(0.5, 0.7, 0.2)),
    "sphere2": shapes.Sphere(center=(0.2, -0.1), radius=0.4),
    "sphere3": shapes.Sphere(center=(0.2, -0.1, 0.3), radius=0.4),
    "cylinder2": shapes.Cylinder(start=(0.0, 0.0), end=(0.6, 0.3), radius=0.2),
    "cylinder3": shapes.Cylinder(start=(0.0, 0.0, 0.1), end=(0.6, 0.3, -0.2), radius=0.2),
    "capsule2": shapes.Capsule(start=(0.0, 0.0), end=(0.6, 0.3), radius=0.2),
    "capsule3": shapes.Capsule(start=(0.0, 0.0, 0.1), end=(0.6, 0.3, -0.2), radius=0.2),
    "torus2": shapes.Torus(center=(0.1, 0.2), major=0.5, minor=0.2),
    "torus3": shapes.Torus(center=(0.1, 0.2, 0.3), major=0.5, minor=0.2, axis=(1.0, -1.0, 2.0)),
    "wedge2": shapes.Wedge(tip=(0.0, 0.2), direction=(1.0, 2.0), half_angle=20.0, length=0.7),
    "wedge3": shapes.Wedge(tip=(0.0, 0.2, 0.0), direction=(1.0, 2.0, 0.0), half_angle=20.0,
                           length=0.7, edge=(0.0, 0.0, 1.0), width=0.4),
    "tilted wedge": shapes.Wedge(tip=(0.0, 0.2, 0.0), direction=(1.0, 2.0, 0.5), half_angle=20.0,
                                 length=0.7, edge=(1.0, 0.0, 1.0), width=0.4),
}
UNIT2 = shapes.Box(lower=(0.0, 0.0), upper=(1.0, 1.0))
DISK = shapes.Sphere(center=(1.0, 0.5), radius=0.3)


@pytest.fixture(params=ANALYTIC.values(), ids=ANALYTIC.keys())
def shape(request):
    return request.param


def darts(low, high, n, rng):
    """Points of the box, half as large again."""
    margin = 0.25 * (high - low)
    return rng.uniform(low - margin, high + margin, (n, len(low)))


def test_box_holds_the_shape_and_touches_it(shape, rng):
    low, high = bounds(shape)
    x = darts(low, high, 400_000, rng)
    inside = x[solid(shape).inside(x)]
    assert (inside >= low).all()
    assert (inside <= high).all()
    # the darts come within a tenth of the box of each of its faces, rounded ones included
    assert (inside.min(axis=0) - low < 0.1 * (high - low)).all()
    assert (high - inside.max(axis=0) < 0.1 * (high - low)).all()


def test_volume_by_formula_is_the_measured_one(shape):
    part = solid(shape)
    box = np.prod(part.high - part.low)
    # five standard errors of `measured_volume`
    error = 5.0 * {2: 1e-5, 3: 4e-5}[len(part.low)] * box
    assert abs(volume(shape) - measured_volume(part)) < error


def test_surface_counts_as_inside():
    square = solid(UNIT2)
    assert square.inside(np.array([[0.0, 0.0], [1.0, 0.5], [1.0 + 1e-12, 0.5]])).all()
    assert not square.inside(np.array([[1.0 + 1e-6, 0.5]])).any()


def test_booleans_are_those_of_their_parts(rng):
    a, b = solid(UNIT2), solid(DISK)
    x = rng.uniform(-0.5, 1.5, (10_000, 2))
    in_a, in_b = a.inside(x), b.inside(x)
    union = solid(shapes.Union(shapes=(UNIT2, DISK)))
    both = solid(shapes.Intersection(shapes=(UNIT2, DISK)))
    rest = solid(shapes.Difference(shape=UNIT2, minus=(DISK,)))
    assert np.array_equal(union.inside(x), in_a | in_b)
    assert np.array_equal(both.inside(x), in_a & in_b)
    assert np.array_equal(rest.inside(x), in_a & ~in_b)
    assert np.array_equal([union.low, union.high], [[0.0, 0.0], [1.3, 1.0]])
    assert np.array_equal([both.low, both.high], [[0.7, 0.2], [1.0, 0.8]])
    assert np.array_equal([rest.low, rest.high], [[0.0, 0.0], [1.0, 1.0]])


def test_measured_volume_of_booleans():
    half_disk = 0.5 * np.pi * 0.3**2
    union = solid(shapes.Union(shapes=(UNIT2, DISK)))
    rest = solid(shapes.Difference(shape=UNIT2, minus=(DISK,)))
    assert abs(union.volume - (1.0 + half_disk)) < 5e-5 * 1.3
    assert abs(rest.volume - (1.0 - half_disk)) < 5e-5


@pytest.fixture
def measured(monkeypatch):
    """Let every measured volume be 0.5, and return the list of the solids that were measured."""
    solids = []
    monkeypatch.setattr("mpm_ref.shapes.inside.measured_volume",
                        lambda part: solids.append(part) or 0.5)
    return solids


def test_a_volume_is_measured_once_for_equal_records(measured):
    for lower in (0.125, 0.125, 0.25):
        hole = shapes.Box(lower=(lower, lower), upper=(0.75, 0.75))
        assert solid(shapes.Difference(shape=UNIT2, minus=(hole,))).volume == 0.5
    assert len(measured) == 2


def test_unbounded_shapes():
    half = shapes.HalfSpace(point=(0.5, 0.0), normal=(2.0, 0.0))
    assert np.array_equal(solid(half).high, [0.5, np.inf])
    with pytest.raises(ValueError, match="has no end"):
        check_bounded(solid(half))
    with pytest.raises(ValueError, match="has no end"):
        _ = solid(half).volume
    cut = solid(shapes.Intersection(shapes=(half, UNIT2)))
    assert np.array_equal([cut.low, cut.high], [[0.0, 0.0], [0.5, 1.0]])
    assert abs(cut.volume - 0.5) < 1e-9
    blade = shapes.Wedge(tip=(0.0, 0.0, 0.0), direction=(1.0, 0.0, 0.0), half_angle=10.0,
                         length=1.0, edge=(0.0, 0.0, 1.0))
    assert np.isinf(solid(blade).high).tolist() == [False, False, True]
    assert solid(blade).exact_volume is None


def test_shapes_that_do_not_meet():
    far = shapes.Sphere(center=(9.0, 9.0), radius=0.3)
    with pytest.raises(ValueError, match="do not meet"):
        solid(shapes.Intersection(shapes=(UNIT2, far)))


def test_only_analytic_shapes_are_level_sets():
    with pytest.raises(ValueError, match="of type union has no distance"):
        shapes.level_set(shapes.Union(shapes=(UNIT2,)))


def test_moved_shape_by_hand():
    # the unit square, doubled about (1, 0), turned by 90 degrees about it, then lifted by 5:
    # [0,1]^2 -> [-1,1] x [0,2] -> about (1,0): x' = 1 - y, y' = x - 1
    moved = solid(shapes.Transformed(shape=UNIT2, scale=2.0, angle=90.0, about=(1.0, 0.0),
                               translate=(0.0, 5.0)))
    assert np.allclose([moved.low, moved.high], [[-1.0, 3.0], [1.0, 5.0]], atol=1e-12)
    assert moved.volume == 4.0
    assert moved.inside(np.array([[0.9, 3.1], [-0.9, 4.9]])).all()
    assert not moved.inside(np.array([[1.1, 4.0], [0.0, 5.1]])).any()


def test_moved_shape_holds_the_moved_points(shape, rng):
    d = len(bounds(shape)[0])
    axis, about, by = ((1.0, 2.0, 3.0) if d == 3 else None), rng.normal(size=d), rng.normal(size=d)
    record = shapes.Transformed(shape=shape, scale=1.7, angle=40.0, axis=axis, about=tuple(about),
                          translate=tuple(by))
    x = darts(*bounds(shape), 2000, rng)
    y = (x - about) @ rotation(40.0, axis, d).T * 1.7 + about + by
    part, moved = solid(shape), solid(record)
    assert np.array_equal(moved.inside(y), part.inside(x))
    assert (y[part.inside(x)] >= moved.low).all()
    assert (y[part.inside(x)] <= moved.high).all()
    assert moved.volume == pytest.approx(part.volume * 1.7**d)


def test_moved_infinity_stays_infinite():
    half = shapes.HalfSpace(point=(0.0, 0.0), normal=(0.0, 1.0))
    moved = solid(shapes.Transformed(shape=half, angle=30.0))
    assert np.isinf([moved.low, moved.high]).all()


def test_rotation_is_right_handed():
    assert np.allclose(rotation(90.0, None, 2) @ (1.0, 0.0), (0.0, 1.0))
    assert np.allclose(rotation(90.0, (0.0, 0.0, 2.0), 3) @ (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert np.allclose(rotation(120.0, (1.0, 1.0, 1.0), 3) @ (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


@pytest.mark.parametrize(("angle", "axis", "d", "said"), [
    (10.0, (0.0, 0.0, 1.0), 2, "leave it out"),
    (10.0, None, 3, "expected an axis"),
    (10.0, (0.0, 0.0, 0.0), 3, "positive length"),
])
def test_impossible_rotation_is_refused(angle, axis, d, said):
    with pytest.raises(ValueError, match=said):
        rotation(angle, axis, d)


# meshes

trimesh = pytest.importorskip("trimesh")


@pytest.fixture
def stl(tmp_path):
    """A function that writes a mesh and returns the file's name."""
    def write(body, name="body.stl"):
        body.export(tmp_path / name)
        return str(tmp_path / name)
    return write


def solid_angle(triangles, x):
    """Winding number by the solid angles of the triangles: the slow twin."""
    total = np.zeros(len(x))
    for triangle in triangles:
        a, b, c = (corner - x for corner in triangle)
        la, lb, lc = (np.linalg.norm(r, axis=1) for r in (a, b, c))
        ab, bc, ca = (np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a)))
        volume = np.einsum("ij,ij->i", a, np.cross(b, c))
        total += 2.0 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return total / (4.0 * np.pi)


@pytest.mark.parametrize("body", [
    trimesh.creation.icosphere(2), trimesh.creation.torus(1.0, 0.3, 16, 8),
    trimesh.creation.box((1.0, 1.5, 0.5)),
], ids=("ball", "torus", "box"))
def test_winding_number_is_that_of_solid_angles(body, rng):
    triangles = np.array(body.triangles)
    x = rng.uniform(-1.5, 1.5, (2000, 3))
    exact = solid_angle(triangles, x)
    assert np.abs(exact - np.round(exact)).max() < 1e-9
    assert np.array_equal(mesh.winding(x, mesh.bins_of(triangles)), np.round(exact).astype(int))
    assert mesh.enclosed_volume(triangles) == pytest.approx(body.volume, rel=1e-12)


def test_lines_through_vertices_and_edges(rng):
    # below vertices and edges of a box of 12 triangles: lines along z would meet an edge or a
    # vertex, were they not moved aside
    bins = mesh.bins_of(np.array(trimesh.creation.box((2.0, 2.0, 2.0)).triangles))
    ticks = np.linspace(-0.75, 0.75, 7)
    x = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 3)
    assert (mesh.winding(x, bins) == 1).all()
    assert (mesh.winding(x + (0.0, 0.0, 3.0), bins) == 0).all()
    assert (mesh.winding(x - (0.0, 0.0, 3.0), bins) == 0).all()
    assert (mesh.winding(x + (3.0, 0.0, 0.0), bins) == 0).all()


def test_mesh_is_scaled_and_placed(stl):
    file = stl(trimesh.creation.box((1.0, 2.0, 4.0)))
    part = solid(shapes.Mesh(file=file, size=0.8, center=(0.5, 0.5, 0.5)))
    assert np.allclose([part.low, part.high], [[0.4, 0.3, 0.1], [0.6, 0.7, 0.9]])
    assert part.volume == pytest.approx(0.2 * 0.4 * 0.8)
    assert part.inside(np.array([[0.5, 0.5, 0.5], [0.7, 0.5, 0.5]])).tolist() == [True, False]
    assert solid(shapes.Mesh(file=file)).volume == pytest.approx(8.0)


def test_inward_normals_are_turned(stl):
    body = trimesh.creation.box((1.0, 1.0, 1.0))
    body.invert()
    part = solid(shapes.Mesh(file=stl(body)))
    assert part.volume == pytest.approx(1.0)
    assert part.inside(np.zeros((1, 3))).all()


def test_a_volume_with_a_mesh_is_measured_anew_as_its_file_may_change(measured, stl):
    body = shapes.Mesh(file=stl(trimesh.creation.box((1.0, 1.0, 1.0))))
    hole = shapes.Sphere(center=(0.0, 0.0, 0.0), radius=0.25)
    for _ in range(2):
        assert solid(shapes.Difference(shape=body, minus=(hole,))).volume == 0.5
    assert len(measured) == 2


def test_open_mesh_is_refused(stl):
    body = trimesh.creation.box((1.0, 1.0, 1.0))
    body.update_faces(np.arange(12) != 5)
    with pytest.raises(ValueError, match="not closed, 3 of its edges"):
        solid(shapes.Mesh(file=stl(body)))


def test_two_bodies_that_share_an_edge_are_closed(stl):
    # four triangles meet there, two of either orientation
    other = trimesh.creation.box((1.0, 1.0, 1.0))
    other.apply_translation((1.0, 1.0, 0.0))
    both = trimesh.util.concatenate([trimesh.creation.box((1.0, 1.0, 1.0)), other])
    both.merge_vertices()
    assert not both.is_watertight
    part = solid(shapes.Mesh(file=stl(both)))
    assert part.volume == pytest.approx(2.0)
    assert part.inside(np.array([[0.1, 0.2, 0.3], [1.1, 0.8, 0.3], [1.0, 0.0, 0.0]])).tolist() \
        == [True, True, False]


def test_a_triangle_that_is_there_twice_leaves_the_mesh_open(stl):
    body = trimesh.creation.box((1.0, 1.0, 1.0))
    twice = trimesh.Trimesh(body.vertices, [*body.faces, body.faces[0]], process=False)
    with pytest.raises(ValueError, match="not closed, 3 of its edges"):
        solid(shapes.Mesh(file=stl(twice)))


def test_corners_that_differ_in_their_texture_are_one(tmp_path):
    body = trimesh.creation.box((1.0, 1.0, 1.0))
    lines = [f"v {x} {y} {z}" for x, y, z in body.vertices]
    lines += [f"vt {k / 36} 0" for k in range(36)]
    lines += [f"f {a + 1}/{3 * k + 1} {b + 1}/{3 * k + 2} {c + 1}/{3 * k + 3}"
              for k, (a, b, c) in enumerate(body.faces)]
    (tmp_path / "textured.obj").write_text("\n".join(lines))
    assert len(trimesh.load_mesh(tmp_path / "textured.obj").vertices) == 36
    assert solid(shapes.Mesh(file=str(tmp_path / "textured.obj"))).volume == pytest.approx(1.0)


@pytest.mark.parametrize(("name", "text", "said"), [
    ("none.stl", None, "no such file"),
    ("junk.stl", "junk", "not a readable mesh|no triangles"),
    ("junk.xyz_", "junk", "not a readable mesh"),
    ("empty.obj", "", "not a readable mesh|no triangles"),
])
def test_unreadable_mesh_is_refused(tmp_path, name, text, said):
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=said):
        solid(shapes.Mesh(file=str(tmp_path / name)))


def test_without_trimesh_the_error_says_what_to_install(stl, monkeypatch):
    file = stl(trimesh.creation.box((1.0, 1.0, 1.0)))
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(ValueError, match=r"mpm_ref\[mesh\]"):
        solid(shapes.Mesh(file=file))


def test_mesh_in_a_boolean(stl, rng):
    record = shapes.Difference(
        shape=shapes.Mesh(file=stl(trimesh.creation.box((1.0, 1.0, 1.0)))),
        minus=(shapes.Sphere(center=(0.5, 0.5, 0.5), radius=0.6),))
    part = solid(record)
    assert isinstance(part, Solid)
    assert part.volume == pytest.approx(1.0 - np.pi * 0.6**3 / 6.0, abs=2e-4)
    x = rng.uniform(-0.7, 0.7, (1000, 3))
    expected = (np.abs(x).max(axis=1) < 0.5) & (np.linalg.norm(x - 0.5, axis=1) > 0.6)
    assert np.array_equal(part.inside(x), expected)
