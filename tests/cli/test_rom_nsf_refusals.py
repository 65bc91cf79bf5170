"""What studies with model = "nsf" may not say, and what `mpm-ref rom` refuses of them; the bundled
study beside the experiment.
"""

import pytest
from command_line import assert_told, mpm_ref
from small_nsf_studies import SCENE, modelled, write

from mpm_ref.cli.catalogue import bundled_scenes, bundled_studies
from mpm_ref.rom.study.study import load
from validation.nsf.studies import jelly


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with a study, its runs and its fields."""
    return modelled(tmp_path_factory.mktemp("made"))


def reduced(made, out, *options, study="pairs.toml"):
    """What is answered where a reduced run is asked for."""
    return mpm_ref("rom", "run", made / study, "--map", made / "fields.npz", "--out", out,
                   "--set", "v=2", *options)


@pytest.mark.parametrize(("edit", "words"), [
    (('model = "nsf"', 'model = "nfs"'), "model = 'nfs': expected one of 'ldm', 'nsf'"),
    (('model = "nsf"', "model = [1]"), "model = [1]: expected one of"),
    (('model = "nsf"', ""), 'map.tau: unknown key; it is one of model = "nsf"'),
    (("r = 3", "r = 3\ndegree = 2"), 'map.degree: unknown key; it is one of model = "ldm"'),
    (("r = 3", "r = 6"), "modes = 5: expected at least r = 6"),
    (("modes = 5", "modes = 28"), "map.modes = 28: the 3 training runs keep 27 states, which hold "
     "no more modes"),
    (("tau = 8", "tau = 28"), "map.tau = 28: the 3 training runs keep 27 states"),
    (("C = 8", "C = 28"), "map.C = 28: the 3 training runs keep 27 states"),
    (('kind = "modes"', 'kind = "curved"'), "kind = 'curved': expected one of"),
    (('kind = "modes"', 'kind = "network"'), 'map.C: given, but the kind is "network"'),
    (("r = 3", "r = 3\nbeta = [8, 8, 8]"), 'map.beta: given, but the kind is "modes"'),
    (("smoothing = 1e-6", "smoothing = -1.0"), "smoothing"),
    (("points = 20", "weighted = true"), "weighted = true: expected `points` beside it"),
    (("points = 20", "points = 20\ncells = 5"), "cells = 5: samples are points of this many cells"),
    (("points = 20", "cells = 5\nweighted = true"), "neither `points` nor `weighted`"),
    (("points = 20", "points = 20\nweighted = true\ncells = 5"), "neither `points` nor `weighted`"),
    (("points = 20", "cells = 0"), "cells"),
    (("points = 20", 'inversion = "newton"'), "inversion = 'newton': expected one of"),
    (("points = 20", "inversion_tolerance = 0.0"), "run.inversion_tolerance = 0.0: expected"),
    (("points = 20", 'inversion = "linear"\ninversion_tolerance = 1e-6'),
     "inversion_tolerance = 1e-06: expected none with inversion = 'linear'"),
    (("points = 20", 'precision = "half"'), "run.precision = 'half': expected one of"),
    (('kind = "modes"\nr = 3\nmodes = 5\ntau = 8\nC = 8\nsmoothing = 1e-6\n\n[run]',
      'kind = "network"\nr = 3\n\n[run]\nprecision = "single"'),
     "run.precision = 'single': expected 'double' for fields of kind 'network'"),
    (("points = 20", 'samples = "kept"'), "run.samples: unknown key"),
    (("points = 20", "dt_factor = 0.0"), "dt_factor"),
    (("points = 20", "dt_factor = 16.5"), "run.dt_factor = 16.5: expected at most 16, the steps"),
    (("smoothing = 1e-6", "weights = 1.0"), "map.weights: unknown key; did you mean `weight`?"),
    (("points = 20", "dt_factor = 1e-9"), "run.dt_factor = 1e-09: expected a number >= 0.01"),
    (('kind = "modes"\nr = 3\nmodes = 5\ntau = 8\nC = 8\nsmoothing = 1e-6',
      'kind = "network"\nr = 3\noctaves = 100000'), "octaves"),
    (('kind = "modes"\nr = 3\nmodes = 5\ntau = 8\nC = 8\nsmoothing = 1e-6',
      'kind = "network"\nr = 3\nbeta = [100000, 8, 8]'), "beta"),
    (("[map]", "[set]\nevery = 0\n[map]"),
     "every = 0: expected 1 or more steps from one kept state"),
    (("[map]", "[set]\nevery = 3\n[map]"), "every = 3: expected a divisor of steps = 16"),
    (("[map]", "[set]\ninterval = 0.01\n[map]"), "interval = 0.01: expected `every`"),
    (('key = "body.hard.velocity.linear[0]"', 'key = "body.hard.density"'),
     "runs differ in `body[0].density` of the scene, but all need the same particles, grid and "
     "steps; vary gravity, a material, a motion or a velocity at the start"),
])
def test_a_study_with_a_fault_is_refused_in_a_sentence(tmp_path, edit, words):
    for command in (("info",), ("rom", "generate"), ("rom", "evaluate")):
        assert_told(mpm_ref(*command, write(tmp_path, edit)), 2, "pairs.toml: ", words)
    assert not (tmp_path / "pairs-data").exists()


@pytest.mark.parametrize(("before", "after", "words"), [
    ('transfer = "apic"', 'transfer = "pic"', "has the transfer pic"),
    ('transfer = "apic"', 'transfer = "apic", f_bar = true', "has averaged volumes"),
    ('transfer = "apic"', 'transfer = "apic", precision = "single"', "has single precision"),
    ('transfer = "apic"', 'transfer = "apic", relaxation = 0.01', "has scheme.relaxation"),
    ('transfer = "apic"', 'transfer = "apic", rpic = 0.1', "has scheme.rpic"),
    ('transfer = "apic"', 'transfer = "apic", mass_eps = 0.1', "has scheme.mass_eps"),
    ('law = "fixed_corotated", E = 1e5, nu = 0.3', 'law = "fluid", lam = 1e5', "has a fluid"),
])
def test_scenes_that_reduced_runs_do_not_know_are_refused_before_any_run(
        tmp_path, before, after, words):
    assert before in SCENE
    study = write(tmp_path, scene=SCENE.replace(before, after))
    assert_told(mpm_ref("rom", "generate", study, "--out", tmp_path / "data"), 2, words)
    assert not (tmp_path / "data").exists()


@pytest.mark.parametrize(("edit", "words"), [
    (("points = 20", "points = 1"), "points = 1: expected 2 .. "),
    (("points = 20", "points = 999"), "points = 999: expected 2 .. "),
    (("points = 20", "dt_factor = 99.0"), "dt_factor = 99: expected at most 16"),
    (("points = 20", "points = 20\ndt_factor = 20.0"), "dt_factor = 20: expected at most 16"),
    (("to = 2.4", "to = 2.5"), "is a map of another study"),
])
def test_what_a_run_cannot_be_made_with_is_refused(made, tmp_path, edit, words):
    study = write(tmp_path, edit)
    assert_told(reduced(made, tmp_path / "run.h5", study=study), 2, words)
    if "points" in words or "dt_factor" in words:      # known before data are made
        for command in (("info",), ("rom", "generate")):
            assert_told(mpm_ref(*command, study), 2, words)
        assert not (tmp_path / "pairs-data").exists()
    assert not (tmp_path / "run.h5").exists()


def test_fields_of_modes_are_shown_at_their_own_points(made, tmp_path):
    done = reduced(made, tmp_path / "run.h5", "--points-out", 100)
    assert_told(done, 2, "--points-out 100: reduced runs with inferred stress ", "leave it out")
    assert not (tmp_path / "run.h5").exists()


def test_more_modes_than_the_runs_hold_are_refused(made, tmp_path):
    study = write(tmp_path, ("tau = 8", "tau = 27"))
    done = mpm_ref("rom", "train", study, "--data", made / "data", "--out", tmp_path / "f.npz")
    assert_told(done, 2, "tau = 27: expected 1 .. ")
    assert not (tmp_path / "f.npz").exists()


# Bundled studies.

def test_the_papers_study_has_the_runs_of_the_experiment():
    bundled, experiment = load(bundled_studies()["jelly"], bundled_scenes()), jelly()
    assert bundled.mu[list(bundled.train), 0].tolist() == list(experiment.train)
    assert bundled.mu[list(bundled.test), 0].tolist() == list(experiment.test)
    assert bundled.tables.reduced_model.sizes == experiment.sizes
    assert bundled.tables.reduced_model.stress_sees_parameters == experiment.follows
    assert bundled.tables.run.points == experiment.samples
    for value in (0.3, 0.45):
        assert bundled.scene([value]) == experiment.run(value)
