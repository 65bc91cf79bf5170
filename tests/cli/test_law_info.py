"""`mpm-ref info` of learned laws, of their layers, of graph networks and of law studies."""

import json
from pathlib import Path

import gnn_toys
import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from neural_toys import laws as random_laws
from small_laws import DT, DX, FLOWING, STEPS, E, identified, saved, write_study

from mpm_ref.materials import NoFlow, VonMises
from mpm_ref.materials.learned import spline, weights
from mpm_ref.materials.learned.weights import LawWeights, LearnedLaws
from mpm_ref.nclaw.gnn import weights as of_graphs
from mpm_ref.store.weights_file import pack
from validation.nclaw.dough import doughs
from validation.nclaw.trained_laws import nets

NCLAW = Path(__file__).parents[2] / "validation" / "nclaw" / "weights"
COMMITTED = sorted(path for path in NCLAW.glob("*.npz")
                   if path.stem in nets() and "-gnn" not in path.stem)
FILMED = sorted(path for path in NCLAW.glob("*.npz") if path.stem in doughs())
KNOTS = len(spline.knots())
ABOUT = {"command": "learn", "title": "Cube", "scene_sha256": 64 * "a", "dt": 5e-4,
         "errors": [0.5, 0.25, 0.125], "source_sha256": 64 * "b"}
RECIPE = {"first": 10, "last": 50, "epochs": 3}


def lines(*words):
    done = mpm_ref("info", *words)
    assert (done.exit_code, done.stderr) == (0, "")
    return done.stdout.splitlines()


def facts(name):
    return json.loads(mpm_ref("info", name, "--json").stdout)


# laws

@pytest.mark.parametrize("path", COMMITTED, ids=lambda path: path.stem)
def test_the_laws_of_the_experiments_say_what_they_know(path):
    what, elastic, plastic, trained, *met, by = lines(path)
    laws = weights.load(path)
    about, errors = laws.about, laws.about["errors"]
    assert what.startswith(f"{path}: learned laws, 3D")
    assert elastic.startswith(f"elastic: {about['elastic']}, ")
    assert plastic.startswith(f"plastic: {about['plastic']}")
    assert trained.startswith(f"trained on {about['environment']}, scene {about['scene'][:12]}, "
                              f"{about['epochs']} epochs: ")
    first, last = f"{errors[0]:.3g} at first", f"{errors[-1]:.3g} at last"
    assert trained.endswith(f" of F {first}, {last}" if about.get("method") == "labeled" else
                            f" {first}, over up to 25 steps from a restart; {last}, over up to 200")
    assert [line.split(":")[0] for line in met] == ["met in training"] * ("seen" in about)
    assert by == f"made by: {about['command']}, commit {about['commit']}, {about['date']}"
    assert facts(path)["about"] == about


@pytest.mark.parametrize("path", FILMED, ids=lambda path: path.stem)
def test_laws_learned_from_a_film_say_what_their_errors_are(path):
    about, (*_, trained, by) = weights.load(path).about, lines(path)
    assert trained.startswith(f"trained on scene {about['scene'][:12]}, {about['epochs']} epochs: "
                              "squared distance of marks in images [px^2]")
    assert by == f"made by: {about['command']}, commit {about['commit']}, {about['date']}"


def test_widths_and_weights_are_those_of_the_layers():
    found, laws = facts(NCLAW / "jelly.npz"), weights.load(NCLAW / "jelly.npz")
    for part in weights.PARTS:
        layers = getattr(laws, part).layers
        assert found[part]["widths"] == [*(len(W) for W, _ in layers), len(layers[-1][1])]
        assert found[part]["weights"] == sum(W.size for W, _ in layers)
        assert not any(b.any() for _, b in layers)      # which are not counted
    assert lines(NCLAW / "jelly.npz")[1] == (
        "elastic: Stress, layers 13-64-64-9, 5504 weights, unit = 1")


def test_biases_are_counted_where_there_are_some():
    """3 6 + 6 + 6 6 + 6 + 6 3 + 3."""
    assert lines(NCLAW / "jelly-neural.npz")[1] == (
        "elastic: StretchStress, layers 3-6-6-3, 87 weights, unit = 1")


def test_laws_say_what_the_command_wrote_of_them(tmp_path):
    seen = {"low": [0.9, 0.8, 0.7, 0.6], "high": [1.4, 1.3, 1.2, 1.1]}
    laws = random_laws(3)._replace(about=ABOUT | {"method": "ours", "seen": seen})
    what, _, plastic, *rest = lines(saved(tmp_path, laws))
    assert what == (f'{tmp_path / "laws.npz"}: learned laws, 3D, method "ours", for steps of '
                    "0.0005 s")
    assert plastic == "plastic: Correction, layers 13-64-64-9, 5504 weights, alpha = 0.001"
    assert rest == [
        "trained on Cube, scene aaaaaaaaaaaa, 3 epochs: mean squared error of a step [m^2] 0.5 at "
        "first, 0.125 at last",
        "met in training: stretches 0.7 .. 1.4, J 0.6 .. 1.1",
        "made by: learn, source sha256 bbbbbbbbbbbb"]


@pytest.mark.parametrize(("more", "of"), [
    ({"method": "labeled", "recipe": RECIPE}, "squared error of F"),
    ({"method": "ours", "camera": [1.0], "recipe": RECIPE},
     "squared distance of marks in images [px^2]"),
])
def test_errors_say_what_they_are_of(tmp_path, more, of):
    laws = random_laws(2)._replace(about=ABOUT | more)
    assert lines(saved(tmp_path, laws))[3].endswith(
        f" 3 epochs: {of} 0.5 at first, 0.125 at last")


def test_errors_of_other_horizons_say_so(tmp_path):
    """After 2 of 3 epochs the horizon has come 3/4 of its way (NCLAW-train)."""
    laws = random_laws(2)._replace(about=ABOUT | {"method": "ours", "recipe": RECIPE})
    assert lines(saved(tmp_path, laws))[3].endswith(
        "a step [m^2] 0.5 at first, over up to 10 steps from a restart; 0.125 at last, over up to "
        "40")


def test_errors_with_velocities_in_them_say_so(tmp_path):
    """Files that name what errors are of have them of that alone."""
    about = ABOUT | {"method": "ours", "recipe": {"velocity": 1e-4}}
    for more, said in (({}, ", with the term of velocities,"), ({"errors_of": "positions"}, "")):
        laws = random_laws(2)._replace(about=about | more)
        assert f" a step [m^2]{said} 0.5 at first, " in lines(saved(tmp_path, laws))[3]


def test_laws_without_layers_say_their_constants(tmp_path):
    laws = identified(name="hencky", flow=VonMises(2e3, 0.05))
    what, elastic, plastic, by = lines(saved(tmp_path, laws))
    assert what.endswith(": learned laws, 3D")
    assert elastic == f"elastic: Hencky, mu = {E / 2.4:g}, lam = {E / 3.6:g}"
    assert plastic == "plastic: VonMises, tau_y = 2000, s_min = 0.05"
    assert by == "made by: unknown"
    assert facts(tmp_path / "laws.npz")["elastic"]["weights"] == 0


# layers

@pytest.mark.parametrize("name", ["layers.npz", "layers.json"])
@pytest.mark.parametrize("weights", ["plasticine-no-rotation", "sand-sys-id", "jelly-neural"])
def test_layers_say_what_the_weights_say(tmp_path, name, weights):
    path = tmp_path / name
    assert mpm_ref("law", "export", NCLAW / f"{weights}.npz", "--out", path).exit_code == 0
    (what, *rest), (of_weights, *expected) = lines(path), lines(NCLAW / f"{weights}.npz")
    assert what.startswith(f"{path}: layers of learned laws, 29 questions with answers, 3D")
    assert what.split(", 3D")[1] == of_weights.split(", 3D")[1]
    assert rest == expected


def test_splines_say_how_many_numbers_they_have(tmp_path):
    values = LawWeights(((np.ones((KNOTS, 3)), np.zeros(3)),), spline.SplineStress())
    path = saved(tmp_path, LearnedLaws(values, LawWeights((), NoFlow()), {}))
    assert lines(path)[1] == f"elastic: SplineStress, splines of {3 * KNOTS} numbers, unit = 1000"
    assert mpm_ref("law", "export", path).exit_code == 0
    with np.load(tmp_path / "laws.layers.npz") as file:
        size = file["elastic_tables"].size
    assert f"splines of {size} numbers" in lines(tmp_path / "laws.layers.npz")[1]


@pytest.mark.parametrize(("change", "words"), [
    (lambda t: {key: t[key] for key in t if key != "check"}, "it lacks check_F; export them"),
    (lambda t: t | {"format": "mpm_ref law 2"}, "has format mpm_ref law 2, this program reads"),
    (lambda t: t | {"check": {"F": [[1.0], 2.0]}}, "holds no layers of laws: "),
])
def test_what_are_no_layers_is_told(tmp_path, change, words):
    path = tmp_path / "layers.json"
    assert mpm_ref("law", "export", NCLAW / "jelly.npz", "--out", path).exit_code == 0
    path.write_text(json.dumps(change(json.loads(path.read_text()))))
    assert_told(mpm_ref("info", path), 2, f"{path} h", words)


# graph networks

def test_a_graph_network_says_what_it_is_and_what_it_learned_from(tmp_path):
    about = {"command": "learn", "environment": "water", "scene": 16 * "a", "runs": 10,
             "recipe": {"steps": 3000}, "errors": [None, 0.5, 0.25, 0.75], "picked": 2,
             "commit": "abc", "date": "2026-01-02"}
    made = gnn_toys.simulator()._replace(about=about)
    of_graphs.save(tmp_path / "gnn.npz", made)
    arrays = of_graphs.arrays_of(made)
    size = sum(a.size for a in arrays.values() if a.dtype == np.float32)
    assert lines(tmp_path / "gnn.npz") == [
        f"{tmp_path / 'gnn.npz'}: a graph network, 3D, {gnn_toys.WIDTH} wide, {gnn_toys.BLOCKS} "
        f"blocks, {size} weights and biases",
        "frames 0.0025 s apart, neighbours within 0.2 m",
        "trained on 10 runs of water, scene aaaaaaaaaaaa: 3000 steps of Adam",
        "mean squared error of a free run [m^2]: inf at first, 0.25 of what is kept",
        "made by: learn, commit abc, 2026-01-02"]
    found = facts(tmp_path / "gnn.npz")
    assert (found["weights"], found["picked"], found["about"]) == (size, 2, about)


def test_a_graph_network_that_says_nothing_is_told_all_the_same(tmp_path):
    of_graphs.save(tmp_path / "gnn.npz", gnn_toys.simulator(2))
    what, _, by = lines(tmp_path / "gnn.npz")
    assert ", 2D, " in what
    assert by == "made by: unknown"


# what is none of these

def test_weights_with_a_fault_are_told_as_what_they_are(tmp_path):
    path = tmp_path / "laws.npz"
    arrays = {"format": np.array(2), "about": np.array("{}"), "elastic_kind": np.array("Stress")}
    path.write_bytes(pack(arrays))
    assert_told(mpm_ref("info", path), 2, "laws.npz has format 2, this program reads 1")
    path.write_bytes(pack(arrays | {"format": np.array(1)}))
    assert_told(mpm_ref("info", path), 2, "laws.npz holds no trained laws: elastic law without")
    path.write_bytes(pack({"format": np.array("gnn 2")}))
    assert_told(mpm_ref("info", path), 2, "laws.npz has format gnn 2, this program reads gnn 1")
    path.write_bytes((NCLAW / "jelly.npz").read_bytes()[:-1])
    assert_told(mpm_ref("info", path), 2, "laws.npz is damaged, cut short")


def test_arrays_of_something_else_are_told(tmp_path):
    path = tmp_path / "other.npz"
    path.write_bytes(pack({name: np.ones(2) for name in "edcba"}))
    assert_told(mpm_ref("info", path), 2, "other.npz holds no map, no laws and no graph network: it"
                " has a, b, c, d, ..; name a file of `mpm-ref rom train`")


def test_laws_of_several_epochs_are_told_as_such():
    assert_told(mpm_ref("info", NCLAW / "small-water-epochs.npz"), 2, "holds the laws of several "
                "epochs, 10, 20, 30, 50, 75, 100, 150, 200, 300, of a training")


# law studies

def test_a_law_study_says_what_is_learned_from_what(tmp_path):
    file = write_study(tmp_path, ("[train]", 'title = "Cubes"\nweights = "w.npz"\n[train]'))
    assert lines(file) == [
        f'{file}: a law study, Cubes: laws of the scene cube.toml, method "ours"',
        f"3D, 27 points, dx = {DX} m, {STEPS} steps of {DT} s",
        "laws: elastic Stress, unit = 1; plastic Correction, alpha = 0.001",
        "training: 4 epochs, horizon 5 .. 10 steps, rates 1 (elastic) and 0.1 (plastic), seed 0"]
    found = facts(file)
    assert found["recipe"]["epochs"] == 4
    assert found["files"] == {"weights": str(tmp_path / "w.npz")}


def test_a_scene_alone_makes_a_law_study(tmp_path):
    file = write_study(tmp_path)
    file.write_text('scene = "cube.toml"')
    assert lines(file)[0].endswith(
        ': a law study, untitled: laws of the scene cube.toml, method "admissible"')


def test_studies_of_labels_have_no_horizon_and_those_of_constants_no_networks(tmp_path):
    def told(method):
        return lines(write_study(tmp_path, ('method = "ours"', f'method = "{method}"'),
                                 scene=[FLOWING]))[2:]

    assert told("labeled")[1] == (
        "training: 4 epochs, rates 0.1 (elastic) and 0.1 (plastic), seed 0")
    laws, training = told("sys-id")
    assert laws == (f"constants of: elastic Hencky, mu = {E / 2.4:g}, lam = {E / 3.6:g}; plastic "
                    "VonMises, tau_y = 2000, s_min = 0")
    assert ", horizon 5 .. 10 steps, " in training


@pytest.mark.parametrize("name", ["law_jelly", "law_jelly_small"])
def test_bundled_law_studies_are_known_by_their_names(name):
    what, size, *_ = lines(name)
    assert f"{name}.toml: a law study, NCLaw: jelly" in what
    assert size.startswith("3D, ")


@pytest.mark.parametrize(("before", "after", "words"), [
    ("epochs", "epocs", "train.epocs: unknown key; did you mean `epochs`?"),
    ('scene = "cube.toml"', "", "scene: this key is missing"),
    ("cube.toml", "none.toml", "scene = 'none.toml': there is no such file"),
])
def test_a_law_study_with_a_fault_is_told_as_one(tmp_path, before, after, words):
    assert_told(mpm_ref("info", write_study(tmp_path, (before, after))), 2, "cubes.toml: ", words)
