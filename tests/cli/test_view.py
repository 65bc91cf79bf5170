import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from command_line import SCENE, assert_told, mpm_ref
from matplotlib.colors import to_rgba
from PIL import Image

from mpm_ref import oracle, plotting
from mpm_ref.cli.catalogue import bundled_scenes, find_scene
from mpm_ref.store.results import Results
from mpm_ref.store.running import checkpoint_of

ROOT = Path(__file__).resolve().parents[2]


def test_info_of_results(finished):
    done = mpm_ref("info", finished)
    for words in ("Disk: 2D", "disk 52 (x v F tau)", "5 frames, t = 0 to 0.04 s", "finished",
                  "state sha256", "run.checkpoint.h5"):
        assert words in done.stdout
    facts = json.loads(mpm_ref("info", finished, "--json").stdout)
    assert (facts["frames"], facts["steps"], facts["time"]) == (5, 40, [0.0, 0.04])


def test_info_of_a_checkpoint_and_of_a_scene(finished, scene):
    checkpoint = checkpoint_of(finished)
    assert "step 40, t = 0.04 s, after 5 frames" in mpm_ref("info", checkpoint).stdout
    assert json.loads(mpm_ref("info", checkpoint, "--json").stdout)["step"] == 40
    assert "52 particles" in mpm_ref("info", scene).stdout
    assert json.loads(mpm_ref("info", scene, "--json").stdout)["nodes"] > 0


def test_info_of_damaged_files(finished, tmp_path):
    for name, source in (("cut.h5", finished), ("cut.checkpoint.h5", checkpoint_of(finished))):
        (tmp_path / name).write_bytes(source.read_bytes()[:4000])
        assert_told(mpm_ref("info", tmp_path / name), 2, name)


def test_scenes_are_listed():
    done = mpm_ref("scenes")
    assert done.exit_code == 0
    assert set(json.loads(mpm_ref("scenes", "--json").stdout)) == set(bundled_scenes())
    for name in bundled_scenes():
        assert name in done.stdout
        assert find_scene(name) == ROOT / "scenes" / f"{name}.toml"


def test_oracle(scene, tmp_path):
    golden = tmp_path / "golden.h5"
    done = mpm_ref("oracle", "record", scene, "-o", golden, "--steps", 1)
    assert (done.exit_code, done.stdout) == (0, f"{golden}: 1 step of Disk\n")
    with h5py.File(golden) as h5:
        nodes, mass = h5["steps/0/nodes"][()], h5["steps/0/mass"][()]
    for factor, code, words in ((1.0, 0, "agrees"), (1.0 + 1e-6, 1, "array mass")):
        oracle.write(tmp_path / "other.h5", [{"nodes": nodes, "mass": factor * mass}])
        done = mpm_ref("oracle", "check", golden, tmp_path / "other.h5")
        assert done.exit_code == code
        assert words in done.stdout
        done = mpm_ref("oracle", "check", golden, tmp_path / "other.h5", "--json")
        assert json.loads(done.stdout)["agrees"] is (code == 0)


def test_bad_requests_to_the_oracle_are_told(scene, tmp_path):
    golden = tmp_path / "golden.h5"
    assert_told(mpm_ref("oracle", "record", scene, "-o", golden, "--steps", 0), 2, "steps = 0")
    assert_told(mpm_ref("oracle", "check", scene, scene), 2, "cannot be read as HDF5")


# plot, animate, export

@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_plot(finished, tmp_path, suffix):
    out = tmp_path / f"disk.{suffix}"
    done = mpm_ref("plot", finished, "--frame", 2, "--field", "pressure", "-o", out)
    assert (done.exit_code, done.stdout.strip()) == (0, str(out))
    assert out.read_bytes()[:4] in (b"\x89PNG", b"%PDF", b"<?xm")


def test_plot_draws_the_particles(finished):
    with Results(finished) as results:
        figure = plotting.draw(results, frame=1, field="speed")
        points = plotting.particles(figure.axes[0])
        np.testing.assert_array_equal(points.get_offsets(), results.field("disk", "x", 1))
        np.testing.assert_array_equal(points.get_array(), results.scalar("disk", "speed", 1))
        assert figure.axes[0].get_ylabel() == "y [m]"
        assert "t = 0.01 s" in figure.axes[0].get_title()


def test_body_has_a_legend_and_no_colour_bar(finished):
    with Results(finished) as results:
        axes, = plotting.draw(results, field="body").axes
        assert [text.get_text() for text in axes.get_legend().get_texts()] == ["disk"]
        colours = plotting.particles(axes)
        assert tuple(colours.to_rgba(0.0)) == to_rgba("tab:blue")
        axes, bar = plotting.draw(results, field="tau").axes
        assert axes.get_legend() is None
        assert bar.get_ylabel() == "|tau|_F [Pa]"


FLOOR = """
[[collider]]
shape = { type = "half_space", point = [0.0, 0.17], normal = [0.0, 1.0] }
kind = "separate"
"""
MOVING = """
[[collider]]
shape = { type = "sphere", center = [0.36, 0.35], radius = 0.02 }
motion = { translation = { type = "steady", rate = [0.0, 2.0] } }
"""
CUT = SCENE.replace("dim = 2", "dim = 3").replace("[0.5, 0.3]", "[0.5, 0.3, 0.5]").replace(
    "[0.0, -9.8]", "[0.0, -9.8, 0.0]").replace("steps = 40", "steps = 1").replace(
    "[[body]]", 'walls = { low = ["open", 5, "open"], high = [11, "open", "open"] }\n\n[[body]]')
CUT += """
[[fixed]]
region = { type = "sphere", center = [0.5, 0.3, 0.44], radius = 0.1 }
"""


def run(folder, text):
    (folder / "scene.toml").write_text(text)
    done = mpm_ref("run", folder / "scene.toml", "--out", folder / "run.h5", "--quiet")
    assert done.exit_code == 0, done.output
    return folder / "run.h5"


def contours(axes):
    """Points of the contours of solids, for each that has some."""
    return [drawn.get_paths()[0].vertices for drawn in axes.collections
            if drawn is not plotting.particles(axes) and not drawn.filled]


def test_colliders_are_drawn_where_they_are(tmp_path):
    with Results(run(tmp_path, SCENE + FLOOR + MOVING)) as results:
        for frame in (0, 4):
            line, = contours(plotting.draw(results, frame).axes[0])
            on_floor = abs(line[:, 1] - 0.17) < 1e-9
            x, y = (line[~on_floor] - (0.36, 0.35 + 2.0 * results.time[frame])).T
            assert on_floor.sum() > 300
            assert len(x) > 50
            np.testing.assert_allclose(np.hypot(x, y), 0.02, atol=1e-4)
        assert results.time[frame] == pytest.approx(0.04)


def test_film_moves_the_colliders(tmp_path):
    out = tmp_path / "run.gif"
    with Results(run(tmp_path, SCENE + MOVING)) as results:
        plotting.animate(results, out)
        way, width = 2.0 * results.time[-1], 0.375      # 7 particles and 2 dx on both sides
    with Image.open(out) as film:
        rows = []
        for k in (0, film.n_frames - 1):
            film.seek(k)
            pixels = np.asarray(film.convert("RGB")).astype(int)
            shaded = (np.ptp(pixels, axis=2) == 0) & (abs(pixels[..., 0] - 224) < 6)
            rows.append(np.median(np.nonzero(shaded)[0]))
    assert rows[0] - rows[1] == pytest.approx(way * 80 * plotting.WIDTH / width, rel=0.05)


def test_solids_in_3d_are_cut_in_the_middle(tmp_path):
    with Results(run(tmp_path, CUT)) as results:
        walls, held = contours(plotting.draw(results, 0).axes[0])
    assert walls[:, 0].max() == pytest.approx(0.6)          # node 12 at 0.6 m is the first held
    assert walls[:, 1].min() == pytest.approx(0.2)          # node 4 at 0.2 m is the last
    radius = np.hypot(*(held - (0.5, 0.3)).T)
    np.testing.assert_allclose(radius, 0.08, atol=1e-3)     # sqrt(0.1^2 - 0.06^2)


def test_scene_that_cannot_be_made_again_is_left_out(finished):
    with Results(finished) as results:
        for text in (None, "", "dim = 2", '{"dim": 2, "dx": -1}'):
            results.manifest["scene"] = text
            assert len(plotting.draw(results).axes[0].collections) == 1


def test_view_has_gravity_pointing_down():
    def view(*gravity):
        return plotting.view_of(type("Some", (), {"gravity": np.array(gravity)}))

    assert [view(0.0, -9.8), view(-9.8, 0.0), view(0.0, 0.0)] == [(0, 1), (1, 0), (0, 1)]
    assert [view(0.0, 0.0, -9.8), view(0.0, -9.8, 0.0)] == [(0, 2), (0, 1)]


def test_animate(finished, tmp_path):
    out = tmp_path / "disk.gif"
    assert mpm_ref("animate", finished, "--field", "tau", "-o", out).exit_code == 0
    with Image.open(out) as film:
        assert film.n_frames == 5


def test_export(finished, tmp_path):
    for options in ([], ["--grid"]):
        out = tmp_path / f"disk{len(options)}.vtkhdf"
        assert mpm_ref("export", finished, *options, "-o", out).exit_code == 0
        assert out.read_bytes()[1:4] == b"HDF"


@pytest.mark.parametrize(("command", "words"), [
    (["plot", "--field", "colour"], "expected one of speed"),
    (["plot", "--frame", 9], "no frame 9"),
    (["plot", "--view", "xx"], "two different axes"),
    (["animate", "--view", "xz"], "no axis z in 2D"),
    (["plot", "-o", "a.jpg"], "ends in .png"),
    (["animate", "-o", "a.mp4"], "ends in .gif"),
    (["export", "-o", "a.vtk"], "ends in .vtkhdf"),
])
def test_bad_requests_are_told(finished, command, words):
    assert_told(mpm_ref(command[0], finished, *command[1:]), 2, words)
