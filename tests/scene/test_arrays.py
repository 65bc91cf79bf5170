import h5py
import numpy as np
import pytest

from mpm_ref.sampling.arrays import read_arrays
from mpm_ref.scene import SceneError, build, loads

N = 5
SCENE = """
dim = {dim}
dx = 0.1
steps = 1
[scheme]
transfer = "{transfer}"
[[body]]
name = "a"
particles = {{ file = "{file}"{more} }}
material = {{ {material} }}
{body}
"""
SOLID = 'law = "hencky", E = 100.0, nu = 0.3'
METAL = SOLID + ', flow = { type = "von_mises_hardening", tau_y = 1.0, xi = 0.1 }'
FLUID = 'law = "fluid", lam = 10.0'


@pytest.fixture
def state(d, rng):
    """Arrays of N particles in d dimensions."""
    return {
        "x": rng.normal(size=(N, d)), "v": rng.normal(size=(N, d)),
        "C": rng.normal(size=(N, d, d)), "F": np.eye(d) + 0.1 * rng.normal(size=(N, d, d)),
        "m": rng.uniform(1.0, 2.0, N), "V0": rng.uniform(1.0, 2.0, N),
        "y": rng.uniform(1.0, 2.0, N), "body": np.array([0, 1, 1, 0, 1]),
    }


def npz(folder, arrays):
    np.savez(folder / "state.npz", **arrays)
    return folder / "state.npz"


def hdf5(folder, arrays, group="/"):
    with h5py.File(folder / "state.h5", "w") as h5:
        for name, a in arrays.items():
            h5[f"{group}/{name}"] = a
    return folder / "state.h5"


def particles(file, d, transfer="apic", material=METAL, more="", body=""):
    text = SCENE.format(file=file, dim=d, transfer=transfer, material=material, more=more,
                        body=body)
    return build(loads(text)).bodies[0].particles


@pytest.mark.parametrize("write", [npz, hdf5])
def test_state_arrives_whole(tmp_path, d, state, write):
    made = particles(write(tmp_path, state), d)
    for name in ("x", "v", "C", "F", "m", "V0", "y"):
        assert np.array_equal(getattr(made, name), state[name]), name
        assert getattr(made, name).flags.c_contiguous
        assert getattr(made, name).dtype == np.float64


def test_only_what_the_scene_needs_is_kept(tmp_path, d, state):
    file = npz(tmp_path, state)
    assert particles(file, d, transfer="pic").C.size == 0
    assert particles(file, d, material=SOLID).y.size == 0
    mls = particles(file, d, transfer="mls")
    assert mls.C is mls.L


def test_defaults(tmp_path, d, state):
    made = particles(npz(tmp_path, {"x": state["x"], "V0": state["V0"]}), d, body="density = 3.0")
    assert (made.v == 0.0).all()
    assert (made.C == 0.0).all()
    assert (np.eye(d) == made.F).all()
    assert (made.y == 1.0).all()
    assert np.array_equal(made.m, 3.0 * state["V0"])
    by_mass = npz(tmp_path, {"x": state["x"], "m": state["m"]})
    assert np.allclose(particles(by_mass, d, body="density = 3.0").V0, state["m"] / 3.0)
    moving = particles(by_mass, d, body=f"density = 3.0\nvelocity = {{ linear = {d * [1.0]} }}")
    assert (moving.v == 1.0).all()


def test_rotation_is_about_the_centre_of_mass(tmp_path, state):
    arrays = {"x": state["x"][:, :2], "m": state["m"], "V0": state["V0"]}
    made = particles(npz(tmp_path, arrays), 2, body="velocity = { angular = 2.0 }")
    assert np.abs(made.m @ made.v).max() < 1e-13
    assert np.allclose(made.v[1] - made.v[0], 2.0 * (made.x[1] - made.x[0])[::-1] * (-1.0, 1.0))


def test_single_precision_and_whole_numbers_become_doubles(tmp_path):
    arrays = {"x": np.ones((N, 2), dtype=np.float32), "m": np.ones(N, dtype=np.int32),
              "V0": np.ones(N, dtype=">f8")}
    made = particles(npz(tmp_path, arrays), 2)
    assert made.x.dtype == made.m.dtype == np.float64


def test_group_and_selection(tmp_path, state, d):
    file = hdf5(tmp_path, state, "run/last")
    made = particles(file, d, more=', group = "run/last", select = 1')
    assert np.array_equal(made.x, state["x"][[1, 2, 4]])


def test_a_fluid_takes_j_or_the_determinant_of_f(tmp_path, d, state):
    J = np.linalg.det(state["F"])
    assert np.allclose(particles(npz(tmp_path, state), d, material=FLUID).F, J, rtol=1e-14)
    del state["F"]
    state["J"] = np.linspace(0.9, 1.1, N)
    made = particles(npz(tmp_path, state), d, material=FLUID)
    assert np.array_equal(made.F, state["J"])


def changed(**arrays):
    """Arrays of N particles in 2D, with changes; None takes one away."""
    good = {"x": np.ones((N, 2)), "m": np.ones(N), "V0": np.ones(N)}
    return {name: a for name, a in {**good, **arrays}.items() if a is not None}


def one(value, shape=(N,)):
    """Ones with one other value."""
    a = np.ones(shape)
    a.flat[-1] = value
    return a


@pytest.mark.parametrize(("arrays", "said"), [
    ({"x": None}, "the array x is missing; found m, V0"),
    ({"x": np.ones((0, 2))}, "the array x holds no particle"),
    ({"x": np.ones((N, 3))}, r"the array x has shape \(5, 3\): expected \(5, 2\)"),
    ({"x": np.float64(1.0)}, r"the array x has shape \(\): expected \(1, 2\)"),
    ({"m": np.ones(4)}, r"the array m has shape \(4,\): expected \(5,\)"),
    ({"F": np.ones(N)}, r"the array F has shape \(5,\): expected \(5, 2, 2\)"),
    ({"x": one(np.nan, (N, 2))}, "the array x has nan for particle 4: expected a finite number"),
    ({"v": one(np.inf, (N, 2))}, "the array v has inf for particle 4"),
    ({"m": one(0.0)}, "the array m has 0.0 for particle 4: expected a finite number > 0"),
    ({"V0": one(-1.0)}, "the array V0 has -1.0 for particle 4"),
    ({"x": np.ones((N, 2), dtype=complex)}, "type complex128: expected real numbers"),
    ({"m": np.ones(N, dtype=bool)}, "type bool: expected real numbers"),
    ({"m": np.full(N, "a")}, "expected real numbers"),
    ({"body": np.ones(N)}, "the array body has type float64: expected whole numbers"),
    ({"V0": None}, r"given of m \[kg\], V0 \[m\^d\] and density \[kg/m\^3\]: m; expected two"),
    ({"J": np.ones(N)}, "the array F is missing"),
    ({"x": np.full((N, 2), None)}, "the array x has type object: expected real numbers"),
])
def test_bad_array_is_refused(tmp_path, arrays, said):
    file = npz(tmp_path, changed(**arrays))
    with pytest.raises(SceneError, match=rf"^body\[0\].particles.*({said})") as caught:
        particles(file, 2)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("write", [npz, hdf5])
def test_a_misnamed_array_is_refused(tmp_path, write):
    file = write(tmp_path, changed(vel=np.ones((N, 2)), v0=np.ones(N)))
    with pytest.raises(SceneError, match=r"the array v0 has no meaning: did you mean V0\?|"
                       r"the array vel has no meaning: .*; the file has V0, m, v0, vel, x; rename"):
        particles(file, 2)
    made = particles(file, 2, more=', ignore = ["vel", "v0", "none"]')
    assert (made.v == 0.0).all()


@pytest.mark.parametrize(("x", "words"), [
    (np.ones((300_000, 100), np.int8), "the array x has shape"),
    (np.ones((300_000, 2), bool), "the array x has type bool"),
])
def test_what_cannot_be_particles_is_refused_unread(tmp_path, monkeypatch, x, words):
    np.savez_compressed(tmp_path / "state.npz", x=x, m=np.ones(N), V0=np.ones(N))
    monkeypatch.setattr(np.lib.npyio.NpzFile, "__getitem__", lambda *_: 1 / 0)
    with pytest.raises(SceneError, match=words):
        particles(tmp_path / "state.npz", 2)


def test_arrays_beyond_the_memory_are_refused_unread(tmp_path, monkeypatch):
    monkeypatch.setattr("os.sysconf", lambda _: 10)
    with pytest.raises(SceneError, match="GB: this machine has 1e-07 GB of memory"):
        particles(npz(tmp_path, changed()), 2)


def test_negative_volume_ratio_of_a_fluid_is_refused(tmp_path):
    F = np.tile(np.diag([1.0, -1.0]), (N, 1, 1))
    with pytest.raises(SceneError, match="has determinant -1 for particle 0"):
        particles(npz(tmp_path, changed(F=F)), 2, material=FLUID)


def test_too_much_is_refused(tmp_path):
    with pytest.raises(SceneError, match="m, V0, density; expected two"):
        particles(npz(tmp_path, changed()), 2, body="density = 1.0")
    file = npz(tmp_path, changed(v=np.ones((N, 2))))
    with pytest.raises(SceneError, match=r"body\[0\].velocity: the arrays have velocities"):
        particles(file, 2, body="velocity = { angular = 1.0 }")


@pytest.mark.parametrize(("more", "said"), [
    (', group = "none"', "particles.group = 'none': the file has no such group"),
    (', group = "x"', "particles.group = 'x': the file has no such group"),
    (", select = 3", r"particles.select = 3: no particle has this body; there are 0, 1"),
])
def test_missing_group_or_body(tmp_path, more, said):
    file = hdf5(tmp_path, changed(body=np.array([0, 1, 0, 1, 0])))
    with pytest.raises(SceneError, match=said):
        particles(file, 2, more=more)


def test_selection_needs_the_array_body(tmp_path):
    with pytest.raises(SceneError, match="no array body to select by"):
        particles(npz(tmp_path, changed()), 2, more=", select = 0")


@pytest.mark.parametrize(("name", "content", "said"), [
    ("none.npz", None, "cannot be read|no such file"),
    ("a.csv", b"1,2", "expected a name that ends in"),
    ("junk.npz", b"junk", "cannot be read|Cannot load|not an NPZ|pickle"),
    ("junk.npz", b"PK\x03\x04junk", "cannot be read"),
    ("junk.h5", b"junk", "cannot be read"),
    ("empty.npz", b"", "cannot be read|not an NPZ"),
])
def test_unreadable_file(tmp_path, name, content, said):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=said) as caught:
        read_arrays(tmp_path / name, 2)
    assert "\n" not in str(caught.value)
    with pytest.raises(SceneError):
        particles(tmp_path / name, 2)


def test_truncated_files(tmp_path, state, d):
    for file in (npz(tmp_path, state), hdf5(tmp_path, state)):
        whole = file.read_bytes()
        file.write_bytes(whole[:len(whole) // 2])
        with pytest.raises(ValueError, match="cannot be read"):
            read_arrays(file, d)


def test_array_alone_is_no_archive(tmp_path):
    with (tmp_path / "x.npz").open("wb") as stream:
        np.save(stream, np.ones((N, 2)))
    with pytest.raises(ValueError, match="not an NPZ archive"):
        read_arrays(tmp_path / "x.npz", 2)
