"""Study files: what one says, and what is refused of it, in one sentence."""


import numpy as np
import pytest
from small_studies import STEPS, study, write

from mpm_ref.cli.catalogue import bundled_scenes, bundled_studies
from mpm_ref.rom.study.reduce import size_ratios
from mpm_ref.rom.study.run import RunOptions
from mpm_ref.rom.study.study import load
from mpm_ref.rom.study.tables import KEYS, MapRunTable, MapTable
from mpm_ref.scene import SceneError, canonical
from mpm_ref.scene.overrides import flat, with_values
from validation.ldm.studies import STUDIES


def told(folder, *edits, **scene):
    """The one sentence with which a study is refused, without its file's name."""
    with pytest.raises(SceneError) as fault:
        study(folder, *edits, **scene)
    name, _, sentence = str(fault.value).partition(": ")
    assert name.endswith("bars.toml")
    assert "\n" not in sentence
    return sentence


# What a file says.

@pytest.mark.parametrize("name", ["gravity", "torsion"])
def test_bundled_studies_are_the_experiments(name):
    ours, theirs = load(bundled_studies()[name], bundled_scenes()), STUDIES[name]
    assert np.array_equal(ours.mu, theirs.mu)
    assert (ours.test, ours.train) == (theirs.test, theirs.train)
    for mu in ours.mu[[0, 7, -1]]:
        assert canonical(ours.scene(mu)) == canonical(theirs.scene(*mu))


def test_all_bundled_studies_load():
    assert {"gravity", "gravity_small", "torsion"} <= set(bundled_studies())
    small = load(bundled_studies()["gravity_small"], bundled_scenes())
    assert small.base.steps == 15
    assert small.base.body[0].sampling.count == 400


def test_runs_differ_by_their_parameters_and_show_every_step(tmp_path):
    bars = study(tmp_path)
    assert bars.mu.tolist() == [[1.0], [2.0], [3.0], [4.0]]
    assert bars.scene([2.5]).gravity == (0.0, -2.5)
    assert (bars.base.every, bars.base.steps) == (1, STEPS)
    assert len(bars.test) == 1
    assert sorted((*bars.test, *bars.train)) == [0, 1, 2, 3]


def test_a_network_may_have_more_latent_coordinates_than_there_are_states(tmp_path):
    bars = study(tmp_path, ('kind = "modes"\nr = 3', 'kind = "network"\nr = 100'))
    assert bars.tables.reduced_model.r == 100


def test_two_parameters_make_every_pair_the_last_one_fastest(tmp_path):
    second = '[[parameter]]\nname = "E"\nkey = "body.bar.material.E"\nvalues = [1e4, 3e4]\n\n[map]'
    bars = study(tmp_path, ("[map]", second), ("count = 4", "count = 2"))
    assert bars.mu.tolist() == [[1.0, 1e4], [1.0, 3e4], [4.0, 1e4], [4.0, 3e4]]
    assert bars.scene(bars.mu[1]).body[0].material.E == 3e4


def test_a_latin_hypercube_has_one_run_in_each_part_of_each_range(tmp_path):
    second = '[[parameter]]\nname = "E"\nkey = "body.bar.material.E"\nfrom = 1e4\nto = 2e4\n\n[map]'
    edits = [("[map]", second), ("count = 4\n", ""),
             ("test = 1", 'test = 1\nsampling = "latin"\ncount = 10')]
    mu = study(tmp_path, *edits).mu
    for column, low, high in zip(mu.T, (1.0, 1e4), (4.0, 2e4), strict=True):
        parts = np.floor((column - low) / (high - low) * 10).astype(int)
        assert sorted(parts) == list(range(10))
    assert np.array_equal(study(tmp_path, *edits).mu, mu)
    assert not np.array_equal(study(tmp_path, *edits, ("test = 1", "test = 1\nseed = 1")).mu, mu)
    orders = np.argsort(mu, axis=0).T
    assert not np.array_equal(*orders)
    assert all((np.diff(order) != 1).any() for order in orders)


@pytest.mark.parametrize(("path", "value", "get"), [
    ("dx", 0.2, lambda scene: scene.dx),
    ("gravity[0]", 3.0, lambda scene: scene.gravity[0]),
    ("gravity.0", 3.0, lambda scene: scene.gravity[0]),
    ("body[0].material.nu", 0.1, lambda scene: scene.body[0].material.nu),
    ("body.bar.shape.upper[1]", 0.4, lambda scene: scene.body[0].shape.upper[1]),
    ("fixed[wall].until", 0.5, lambda scene: scene.fixed[0].until),
    ("fixed.wall.motion.translation.rate[1]", 0.5,
     lambda scene: scene.fixed[0].motion.translation.rate[1]),
])
def test_a_path_sets_one_value(tmp_path, path, value, get):
    base = study(tmp_path).base
    changed = with_values(base, {path: value})
    assert get(changed) == value != get(base)
    assert with_values(changed, {path: get(base)}) == base


@pytest.mark.parametrize(("path", "words"), [
    ("gravty[1]", "did you mean `gravity`?"),
    ("gravity[2]", "there is no `2`; there are 0, 1"),
    ("body.beam.density", "there is no `beam`; there are bar"),
    ("body.bar.velocity.linear[0]", "there is no `0`; the scene does not give what is before it"),
    ("dx.dy", "there is no `dy`"),
    ("gravity[", "is no path"),
    ("", "is no path"),
])
def test_a_path_that_leads_nowhere_is_refused(tmp_path, path, words):
    with pytest.raises(SceneError) as fault:
        with_values(study(tmp_path).base, {path: 1.0})
    assert repr(path) in str(fault.value)
    assert words in str(fault.value)


def test_nested_tables_are_paths_too():
    assert flat({"a": {"b": {"c": 1}, "d[0]": 2}, "e": [3]}) == {"a.b.c": 1, "a.d[0]": 2, "e": [3]}


def test_what_is_set_is_set_in_all_runs(tmp_path):
    bars = study(tmp_path, ("[map]", '[set]\nsteps = 3\n"body[0]".density = 500.0\n\n[map]'))
    assert {bars.scene(mu).steps for mu in bars.mu} == {3}
    assert bars.scene([1.0]).body[0].density == 500.0


# What is refused.

@pytest.mark.parametrize(("before", "after", "words"), [
    ("test = 1", "tests = 1", "tests: unknown key; did you mean `test`?"),
    ("r = 3", "r = 3\nepoch = 2", "map.epoch: unknown key; did you mean `epochs`?"),
    ("scale", "scales", "parameter[0].scales: unknown key"),
    ("[map]", "[run]\nquadratur = 1\n[map]", "run.quadratur: unknown key"),
    ("r = 3", "", "map.r: this key is missing"),
    ("r = 3", "r = 0", "map.r = 0: expected a whole number >= 1"),
    ("r = 3", "r = 3.5", "map.r = 3.5: expected a whole number"),
    ("r = 3", "r = 100", f"map.r = 100: the 3 training runs keep {3 * (STEPS + 1)} states, which "
     "hold no more modes than that; set `r` to less"),
    ("r = 3", "r = 3\nweight = 1.0", "map.weight: unknown key; did you mean `weights`?"),
    ("r = 3", "r = 3\ntau = 8", 'map.tau: unknown key; it is one of model = "nsf": say so at the '
     "top of the study, or remove it"),
    ("r = 3", "r = 3\nepochs = 2", "map.epochs: given, but the kind is \"modes\""),
    ('"modes"', '"mode"', "map.kind = 'mode': expected one of 'modes', 'curved', 'network'"),
    ("r = 3", "r = 3\ndegree = 2", 'map.degree: given, but the kind is "modes"; remove it, or take '
     'kind = "curved"'),
    ('"modes"', '"network"\nmodes = 5', 'map.modes: given, but the kind is "network"'),
    ('"modes"', '"curved"', "map.modes = none: expected more than r = 3 of a curved map"),
    ('"modes"', '"curved"\nmodes = 3', "map.modes = 3: expected more than r = 3"),
    ('"modes"', '"curved"\nmodes = 5\ndegree = 1', "map.degree = 1: expected a whole number >= 2"),
    ('kind = "modes"\nr = 3', 'kind = "curved"\nr = 3\nmodes = 5\nepochs = 2\n[run]\n'
     'projection = "nonlinear"', 'map.epochs: given, but the kind is "curved"'),
    ('"modes"', '"curved"\nmodes = 5', "run.projection = 'linear': expected 'nonlinear' for a "
     "curved map"),
    ("[map]", '[run]\nprecision = "half"\n[map]', "run.precision = 'half': expected one of"),
    ("[map]", '[run]\nboundary_cells = "a"\n[map]', "run.boundary_cells = 'a': expected one of "
     "'whole', 'cut'"),
    ("[map]", '[run]\npreimage_tolerance = 0\n[map]', "run.preimage_tolerance = 0"),
    ('"modes"', '"network"\nlatent = "a"', "map.latent = 'a': expected one of"),
    ('"modes"', '"network"\nweights = "a"', "map.weights = 'a': expected one of"),
    ("[map]", '[run]\nvelocity = "a"\n[map]', "run.velocity = 'a': expected one of"),
    ("[map]", '[run]\nprojection = "a"\n[map]', "run.projection = 'a': expected one of"),
    ("[map]", '[run]\nquadrature = "a"\n[map]', "run.quadrature = 'a': expected one of"),
    ("[map]", '[run]\nsamples = "a"\n[map]', "run.samples = 'a': expected one of"),
    ("[map]", "[run]\npoints = 0\n[map]", "run.points = 0: expected a whole number >= 1"),
    ("test = 1", "test = 4", "test = 4: expected fewer than the 4 runs"),
    ("test = 1", 'sampling = "sobol"', "sampling = 'sobol': expected one of 'grid', 'latin'"),
    ("test = 1", "count = 3", "count: expected with sampling = \"latin\""),
    ("test = 1", 'sampling = "latin"', "count: expected with sampling = \"latin\""),
    ("test = 1", 'sampling = "latin"\ncount = 3', "parameter[0]: expected `from` and `to` alone"),
    ("count = 4", "", "parameter[0]: `count` is missing"),
    ("to = 4.0", "to = 0.5", "parameter[0]: a parameter without `values` needs"),
    ("to = 4.0", "to = 4.0\nvalues = [1.0]", "parameter[0]: a parameter needs `values`, or"),
    ("from = 1.0\nto = 4.0\ncount = 4", "values = [1, 1]", "parameter[0].values = [1.0, 1.0]"),
    ("from = 1.0", 'from = "a"', "parameter[0].from = 'a': expected a number"),
    ("from = 1.0", "from = nan", "parameter[0].from = nan: expected a finite number"),
    ("gravity[1]", "gravity", "parameter: gravity = -1.0: expected a list"),
    ("gravity[1]", "grav[1]", "parameter: 'grav[1]' leads nowhere"),
    ("gravity[1]", "body.bar.density", "parameter: body[0].density = -1.0"),
    ('"bar.toml"', '"beam.toml"', "scene = 'beam.toml': there is no such file, nor a bundled"),
    ("[map]", "[set]\nsteps = 0.5\n[map]", "set: steps = 0.5: expected a whole number"),
    ("[map]", "[set]\nstep = 5\n[map]", "set: 'step' leads nowhere"),
    ("[map]", "[map", "not valid TOML"),
])
def test_a_study_is_refused_in_one_sentence(tmp_path, before, after, words):
    assert told(tmp_path, (before, after)).startswith(words)


@pytest.mark.parametrize(("key", "name"), [
    ("body.bar.density", "body[0].density"), ("body[0].shape.upper[0]", "body[0].shape"),
    ("dt", "dt"), ("dx", "dx"),
])
def test_parameters_that_change_the_particles_or_steps_are_refused(tmp_path, key, name):
    values = "values = [0.1, 0.2]"
    said = told(tmp_path, ("gravity[1]", key), ("scale = -1.0\nfrom = 1.0\nto = 4.0\ncount = 4",
                                                values))
    assert f"differ in `{name}`" in said
    assert said.endswith("a motion or a velocity at the start")


def test_two_parameters_of_one_name_or_place_are_refused(tmp_path):
    for second, word in (('name = "g"\nkey = "gravity[0]"', "name"),
                         ('name = "h"\nkey = "gravity[1]"', "key")):
        said = told(tmp_path, ("[map]", f"[[parameter]]\n{second}\nvalues = [1]\n[map]"))
        assert f"two have the same {word}" in said


def test_a_scene_without_equal_steps_is_refused(tmp_path):
    for change in ("dt = 0.01", f"steps = {STEPS}"):
        text = write(tmp_path).with_name("bar.toml").read_text()
        scene = text.replace(change, "" if change.startswith("dt") else "end = 0.1")
        assert "expected one with `dt` and `steps`" in told(tmp_path, scene=scene)


def test_a_file_that_is_not_there_is_said(tmp_path):
    with pytest.raises(SceneError, match="cannot be read"):
        load(tmp_path / "none.toml")


@pytest.mark.parametrize(("texts", "words"), [
    (["h=1"], "h=1: expected NAME=VALUE with one of the study's parameters g"),
    (["g"], "g: expected a finite number"), (["g=one"], "not 'one'"), (["g=inf"], "not 'inf'"),
    ([], "the parameter g is not given: add --set g=VALUE"),
])
def test_parameters_that_are_not_given_well_are_refused(tmp_path, texts, words):
    with pytest.raises(SceneError, match=words):
        study(tmp_path).parse_parameters(texts)


def test_parameters_are_given_by_name_and_known_to_be_outside(tmp_path):
    bars = study(tmp_path)
    assert bars.parse_parameters(["g=2.5"]) == [2.5]
    low, high = bars.mu[list(bars.train)].min(), bars.mu[list(bars.train)].max()
    assert not list(bars.range_warnings([low])) + list(bars.range_warnings([high]))
    assert [f"g = {high + 0.1:g}" in said for said in bars.range_warnings([high + 0.1])] == [True]
    assert len(list(bars.range_warnings([low - 0.1]))) == 1


def test_the_digest_is_of_scenes_and_of_what_is_held_out(tmp_path):
    bars = study(tmp_path)
    assert study(tmp_path, ("r = 3", "r = 2"), ("Bars", "Beams")).digest == bars.digest
    others = [study(tmp_path, edit).digest for edit in (
        ("to = 4.0", "to = 5.0"), ("test = 1", "test = 2"), ("test = 1", "test = 1\nseed = 5"))]
    assert study(tmp_path, ("test = 1", "test = 1\nseed = 5")).test != bars.test
    assert len({bars.digest, *others}) == 4


def test_a_run_is_made_as_the_study_says(tmp_path):
    way = study(tmp_path, ("[map]", '[run]\npoints = 9\nprojection = "nonlinear"\n[map]'))
    assert way.tables.run.options == RunOptions(projection="nonlinear", points=9)
    assert study(tmp_path).tables.run.options == RunOptions()
    assert set(RunOptions._fields) == set(MapRunTable.__struct_fields__) - {"seed"}


def test_every_key_of_a_map_belongs_to_one_kind():
    keys = [key for kind in KEYS.values() for key in kind]
    assert sorted(("kind", "r", *keys)) == sorted(MapTable.__struct_fields__)


def test_a_study_may_scale_the_weights_to_its_body_and_steps(tmp_path):
    """Without a network or PyTorch: LDM's own studies need no other weights."""
    own = load(bundled_studies()["gravity"], bundled_scenes()).base
    assert size_ratios(own) == pytest.approx((1.0, 1.0))
    assert size_ratios(study(tmp_path).base) == pytest.approx((0.8 / 0.4, 0.01 * 144.0))
    network = '"network"\nlatent = "modes"\nweights = "scaled"'
    assert study(tmp_path, ('"modes"', network)).tables.reduced_model.weights == "scaled"
    assert "weights = 'tower': expected one of 'code', 'printed', 'scaled'" in told(
        tmp_path, ('"modes"', '"network"\nweights = "tower"'))
