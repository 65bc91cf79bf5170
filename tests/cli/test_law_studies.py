"""Law studies: what a file may say, and what `mpm-ref law train` refuses before it trains."""

import pytest
from command_line import assert_told, mpm_ref
from small_laws import DT, E, write_study

from mpm_ref.cli.catalogue import bundled_scenes, bundled_studies
from mpm_ref.materials.learned.table import KINDS
from mpm_ref.nclaw.study import study as law_study
from mpm_ref.nclaw.study.study import load
from mpm_ref.nclaw.train.recipe import Recipe


def train(folder, *edits, scene=(), options=()):
    return mpm_ref("law", "train", write_study(folder, *edits, scene=scene), "--out",
                   folder / "laws.npz", *options)


def of_method(method):
    return 'method = "ours"', f'method = "{method}"'


def test_bundled_studies_load():
    found = {name: load(path, bundled_scenes()) for name, path in bundled_studies().items()
             if name.startswith("law_")}
    assert found["law_jelly"].tables.train == Recipe()
    assert found["law_jelly"].scene.every == 1
    assert found["law_jelly_small"].tables.method == "spline"
    assert found["law_jelly_small"].scene.steps == 300
    assert found["law_plasticine"].tables.method == "admissible"


@pytest.mark.parametrize("method", law_study.METHOD_KINDS)
def test_each_method_has_usual_kinds(tmp_path, method):
    study = load(write_study(tmp_path, of_method(method)))
    kinds = law_study.METHOD_KINDS[method]
    assert [type(record).__name__ for record in study.tables.records] == [
        known[0] for known in kinds]
    assert {name for known in kinds for name in known} <= set(KINDS)


def test_a_study_says_kinds_constants_and_recipe(tmp_path):
    study = load(write_study(
        tmp_path, ("[train]", '[laws]\nelastic = "SymmetricStress"\nunit = 2e4\nalpha = 0.1\n'
                              '[set]\nbody.cube.material.E = 2e5\n[train]\nclip = 0.5'),
        ("epochs = 4", "epochs = 7")))
    elastic, plastic = study.tables.records
    assert (type(elastic).__name__, elastic.unit, plastic.alpha) == ("SymmetricStress", 2e4, 0.1)
    assert study.tables.train == Recipe(epochs=7, clip=0.5, first=5, last=10)
    assert study.scene.body[0].material.E == 2e5


def test_recipes_differ_with_the_method_unless_given(tmp_path):
    labeled = load(write_study(tmp_path, of_method("labeled"), ("epochs = 4\n", ""))).tables.train
    assert (labeled.epochs, labeled.elastic_rate) == (30, 0.1)
    assert load(write_study(tmp_path, of_method("labeled"))).tables.train.epochs == 4


def test_a_study_without_a_method_learns_laws_that_thermodynamics_admits(tmp_path):
    tables = load(write_study(tmp_path, ('method = "ours"\n', ""))).tables
    assert tables.method == "admissible"
    assert [type(record).__name__ for record in tables.records] == ["Energetic", "Contraction"]
    assert (tables.train.elastic_rate, tables.train.plastic_rate) == (0.1, 0.01)


def test_files_start_at_the_study(tmp_path):
    study = load(write_study(tmp_path, ("[train]", 'weights = "w.npz"\n[train]')))
    assert study.file("weights") == tmp_path / "w.npz"
    assert study.file("checkpoint") is None


def test_without_pytorch_one_sentence_says_so(tmp_path, without_torch):
    assert_told(train(tmp_path), 2, "laws are trained with PyTorch, which is not installed",
                "run, export and plot without it")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["cube.toml", "cubes.toml"]


@pytest.mark.parametrize(("edit", "words"), [
    (("epochs", "epocs"), "train.epocs: unknown key; did you mean `epochs`?"),
    (("epochs = 4", "epochs = 0"), "train.epochs = 0: expected at least 1"),
    (("epochs = 4", "epochs = 1.5"), "train.epochs = 1.5: expected a whole number"),
    (("epochs = 4", 'reading = "both"'), "train.reading = 'both': expected release or printed"),
    (("epochs = 4", "clip = inf"), "train.clip = inf: expected a finite number"),
    (("[train]", "[[parameter]]"), "parameter: unknown key; the keys here are scene, title,"),
    (('"ours"', '"our"'), "method = 'our': expected one of 'ours', 'labeled'"),
    (('"ours"', "3"), "method = 3: expected text"),
    (("[train]", '[laws]\nplastic = "NoFlow"\n[train]'), "laws.plastic = 'NoFlow': expected one"),
    (("[train]", "[laws]\nunit = 0.0\n[train]"), "laws.unit = 0.0: expected a positive number"),
    (("[train]", "[laws]\nstrain = 0.1\n[train]"), "laws.strain = 0.1: none of these laws has it"),
    (("[train]", '[laws]\nelastc = "Stress"\n[train]'), "laws.elastc: unknown key; did you mean"),
    (("[train]", "[set]\nbody.cub.density = 1.0\n[train]"), "set: 'body.cub.density' leads now"),
    (("cube.toml", "none.toml"), "scene = 'none.toml': there is no such file, nor a bundled"),
    (("[train]", 'start = "none.npz"\n[train]'), "start = 'none.npz': there is no such file"),
    (('method = "ours"', 'start = "a.npz"\nmethod = "spline"'),
     "start = 'a.npz': only laws of the methods ours and admissible go on"),
    (("[train]", 'start = "a.npz"\n[laws]\nunit = 2.0\n[train]'), "and no `laws`"),
    (("[train]", "[train"), "not valid TOML"),
    (('scene = "cube.toml"', ""), "scene: this key is missing"),
])
def test_what_a_study_may_not_say(tmp_path, edit, words):
    assert_told(train(tmp_path, edit), 2, "cubes.toml: ", words)


@pytest.mark.parametrize(("edit", "words"), [
    (('"mls"', '"apic"'), "scene = 'cube.toml': 'Cube': expected MLS-MPM with quadratic splines"),
    ((f"dt = {DT}", "cfl = 0.5"), "scene = 'cube.toml': expected one with `dt` and `steps`"),
    (('"separate"', '"slip"'), "expected a box of walls of kind"),
])
def test_scenes_that_training_does_not_know_are_refused(tmp_path, edit, words):
    assert_told(train(tmp_path, scene=[edit]), 2, "cubes.toml: ", words)


@pytest.mark.parametrize("material", [
    'law = "neo_hookean", E = 1e5, nu = 0.2', 'law = "fluid", lam = 1e5',
    'law = "hencky", E = 1e5, nu = 0.2, flow = { type = "snow_clamp", s_min = 0.9, s_max = 1.1 }'])
def test_constants_that_cannot_be_identified_are_refused(tmp_path, material):
    scene = [(f'law = "fixed_corotated", E = {E}, nu = 0.2', material)]
    assert_told(train(tmp_path, of_method("sys-id"), scene=scene), 2,
                'method = "sys-id": expected a material that is given by E and nu')
    load(write_study(tmp_path, scene=scene))        # other methods need to know nothing


def test_kinds_of_identified_laws_are_not_asked_for(tmp_path):
    edit = 'method = "ours"\n\n[train]', 'method = "sys-id"\n[laws]\nelastic = "Hencky"\n[train]'
    assert_told(train(tmp_path, edit), 2, "learns the constants of the scene's own laws")


@pytest.mark.parametrize(("options", "status", "words"), [
    (("--out", "laws.h5"), 2, "ends in .npz"),
    (("--out", "none/laws.npz"), 4, "there is no folder"),
    (("--out", "there.npz"), 2, "there.npz exists: add --overwrite"),
    (("--data", "run.npz"), 2, "--data run.npz: expected a name that ends in .h5 or .hdf5"),
    (("--data", "none/run.h5"), 4, "there is no folder"),
])
def test_what_a_training_needs_is_said_first(tmp_path, monkeypatch, options, status, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.npz").write_bytes(b"x")
    assert_told(mpm_ref("law", "train", write_study(tmp_path), *options), status, words)
    assert (tmp_path / "there.npz").read_bytes() == b"x"


def test_a_checkpoint_in_no_folder_is_told_before_the_run(tmp_path):
    edit = "[train]", 'checkpoint = "none/laws.pt"\n[train]'
    assert_told(train(tmp_path, edit), 4, "laws.pt: there is no folder")


@pytest.mark.parametrize(("checkpoint", "words"), [
    ("laws.npz", "laws.npz: this is the file of the weights; name another one"),
    ("../{}/cubes.toml", "cubes.toml: this is the file of the study"),
    ("run.h5", "run.h5: this is the file of the run to learn from")])
def test_a_checkpoint_takes_no_other_file_s_place(tmp_path, checkpoint, words):
    """It is removed when the weights are there."""
    edit = "[train]", f'checkpoint = "{checkpoint.format(tmp_path.name)}"\n[train]'
    assert_told(train(tmp_path, edit, options=("--data", tmp_path / "run.h5")), 2, words)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["cube.toml", "cubes.toml"]


def test_a_study_that_does_not_exist_is_told_with_those_that_do():
    assert_told(mpm_ref("law", "train", "none"), 2, "nor a bundled study", "law_jelly")


def test_the_bundled_law_studies_are_listed():
    lines = mpm_ref("law", "studies").stdout.splitlines()
    assert [line.split()[0] for line in lines] == ["law_jelly", "law_jelly_small",
                                                   "law_plasticine"]
    assert lines[1].endswith(" NCLaw: jelly, small")


def test_a_study_of_the_other_kind_is_refused_with_its_command():
    assert_told(mpm_ref("law", "train", "gravity_small"), 2, "gravity_small: a study of reduced "
                "models; `mpm-ref rom generate gravity_small` makes its runs")
    for command in ("generate", "train", "run", "evaluate", "play"):
        assert_told(mpm_ref("rom", command, "law_jelly_small"), 2, "law_jelly_small: a law study; "
                    "`mpm-ref law train law_jelly_small` trains it")
