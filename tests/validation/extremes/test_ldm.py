"""The judge of reduced runs at their extremes: it must notice what is wrong, and only that."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.rom.fields.pod import basis
from mpm_ref.rom.model_file import load
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.monitor import DEPARTURE, StateCheck
from mpm_ref.rom.study.run import RunOptions
from mpm_ref.rom.study.samples import SampleSet
from validation.common.scenes import with_
from validation.extremes import ldm_calibration
from validation.extremes import ldm_extrapolation as extrapolation
from validation.extremes import ldm_files as files
from validation.extremes import ldm_rank as rank_study
from validation.extremes.ldm_extrapolation import record_largest_steps, with_usual_errors
from validation.extremes.ldm_rank import MU, ReductionBench
from validation.extremes.ldm_runs import (
    BAD,
    TOLERABLE,
    ReducedEnd,
    ReducedTrial,
    full_positions,
    pod_reduction,
    record_silent,
    reduced_end,
    summarize_checks,
    trained_reduction,
)
from validation.extremes.verdicts import (
    FINE,
    FLAGGED,
    SILENT,
    STOPPED,
    rates_at,
    record_bound,
)
from validation.ldm.studies import GRAVITY, TORSION

GOOD = ReducedEnd(0.3, 30, -1, "", 0.4, 0.01, 0.9, 4, 0.0, 0.7, 2.0, "")
WELL = StateCheck(beyond=0.3, off=0.01, coverage=0.9, blind=0, lost=0.0, J=0.8, inverted=0.0,
                  far=0.9)


class Records(dict):
    """What an experiment records: {target: (value, note, rule)}."""

    def record(self, target, value, note="", **rule):
        self[target] = value, note, rule


def trial(end, usual=0.3, **changes):
    return ReducedTrial("map", "what", "scheme", 10, usual, end._replace(**changes))


# The four ends.

@pytest.mark.parametrize(("changes", "kind"), [
    ({}, FINE), ({"error": 0.999 * BAD * 0.3}, FINE), ({"error": 1.001 * BAD * 0.3}, SILENT),
    ({"error": np.nan}, SILENT), ({"error": np.inf}, SILENT),
    ({"error": 50.0, "flags": "beyond"}, FLAGGED),
    ({"error": 50.0, "flags": "beyond", "message": "no body"}, STOPPED),
    ({"error": 50.0, "message": "no body"}, STOPPED), ({"flags": "coverage"}, FLAGGED)])
def test_a_run_ends_in_one_of_four_ways(changes, kind):
    assert trial(GOOD, **changes).kind == kind


def test_small_errors_are_not_bad_however_good_the_map_is():
    assert trial(GOOD, 0.001, error=0.99 * TOLERABLE).kind == FINE
    assert trial(GOOD, 0.001, error=1.01 * TOLERABLE).kind == SILENT


def test_the_extremes_of_a_run_are_kept():
    sights = [WELL, WELL._replace(off=0.05, most_off=0.03, J=0.5, departure=2.0),
              WELL._replace(beyond=4.0, coverage=0.2, least_coverage=0.3, blind=1),
              WELL]
    end = summarize_checks(sights, 4, 0.7, "gone")
    assert end == ReducedEnd(0.7, 3, 1, "off beyond coverage blind", 4.0, 0.05, 0.2, 3, 0.0, 0.5,
                             2.0, "gone")
    assert summarize_checks([WELL], 4, 0.7, "").first == -1


def test_silent_runs_are_counted_named_and_a_miss():
    found = Records()
    record_silent(found, "x", [trial(GOOD), trial(GOOD, error=9.0), trial(GOOD, flags="off"),
                               trial(GOOD, error=9.0, flags="off"),
                               trial(GOOD, error=9.0, message="no")], "some")
    value, note, rule = found["x.silent"]
    assert (value, rule["paper"], rule["comparator"]) == (1, 0, "=")
    assert "1 stopped, 2 flagged, 1 fine" in note
    assert "map, what, scheme with 10: 9 %" in note
    assert found["x.misses"][0] == pytest.approx(1.0 / 3.0)


# Runs.

def test_a_full_order_run_that_breaks_down_is_kept_as_far_as_it_went():
    scene = GRAVITY.scene(50.0)
    x, said = full_positions(ldm_full_model(scene).problem)
    assert 5 < len(x) < scene.steps
    assert said.startswith("unstable at step")
    whole, nothing = full_positions(ldm_full_model(with_(GRAVITY.scene(1.0), steps=3)).problem)
    assert (len(whole), nothing) == (4, "")


@pytest.fixture(scope="module")
def net():
    return trained_reduction("gravity-r4")


def fallen(net, g, options=None, sampler=None):
    full = ldm_full_model(GRAVITY.scene(g))
    return reduced_end(full, full_positions(full.problem)[0], net, options or RunOptions(points=50),
                       sampler)


def test_the_watch_knows_the_trained_range(net):
    inside, outside = fallen(net, MU["gravity"][0]), fallen(net, 20.0)
    assert trial(inside).kind == FINE
    assert inside.error < 0.5
    assert inside.beyond < 1.0
    assert trial(outside).kind == FLAGGED
    assert outside.error > 2.0
    assert "beyond" in outside.flags


def test_samples_in_one_place_are_told(net):
    near = np.argsort(ldm_full_model(GRAVITY.scene(1.0)).X[:, 0])[:50]
    found = fallen(net, 7.5, sampler=lambda t, latent: SampleSet(t, near))
    assert found.error > 5.0
    assert found.flags == "departure"
    assert found.departure > 2.0 * DEPARTURE


def test_too_few_samples_are_refused_before_the_first_step(net):
    found = fallen(net, 5.0, RunOptions(points=1))
    assert (trial(found).kind, found.steps) == (STOPPED, 0)
    assert "expected at least 2 samples" in found.message


def test_the_map_of_another_body_is_told_at_the_start(net):
    one = ldm_full_model(with_(TORSION.scene(0.3, 1.0), steps=2))
    found = reduced_end(one, full_positions(one.problem)[0], net, RunOptions(points=50))
    assert found.first == 0
    assert "off" in found.flags


def test_modes_are_a_reduction_with_the_latents_of_their_runs():
    short = GRAVITY._replace(scene=lambda g: with_(GRAVITY.scene(g), steps=3)).run([9, 20])
    pod = pod_reduction(short, 2)
    found = basis(short.X, *short.flat(), 2)
    assert np.array_equal(pod.xhat[1, 3], found.xhat[-1])
    back = pod.field.place(short.X, pod.xhat[1, 3])
    assert np.linalg.norm(back - short.x[1, 3]) < 0.05 * np.linalg.norm(short.x[1, 3] - short.X)


def test_a_run_is_made_once_for_each_way(net, monkeypatch):
    made = []
    monkeypatch.setattr("validation.extremes.ldm_rank.full_order_run", lambda *_: (
        SimpleNamespace(X=np.zeros((99, 3))), None, ""))
    monkeypatch.setattr("validation.extremes.ldm_rank.reduced_end",
                        lambda full, x, net, options: made.append(options) or GOOD)
    bench = ReductionBench(net)
    assert bench.trial("few", RunOptions(points=7)).points == 7
    assert bench.trial("all", RunOptions()).points == 99
    assert bench.trial("all", RunOptions()).usual == GOOD.error
    assert made == [RunOptions(), RunOptions(points=7)]


def test_clustered_samples_are_the_set_of_points_nearest_to_a_place(net, monkeypatch):
    X, samplers = np.zeros((9, 3)), []
    X[:, 0] = np.arange(9) * 0.05
    monkeypatch.setattr("validation.extremes.ldm_rank.full_order_run",
                        lambda *_: (SimpleNamespace(X=X), None, ""))
    monkeypatch.setattr("validation.extremes.ldm_rank.reduced_end",
                        lambda *given: samplers.append(given[-1]) or GOOD)
    ReductionBench(net, usual=1.0).clustered_trial("tip", 2)
    chosen = samplers[0](0.5, None)
    assert (chosen.since, chosen.points.tolist()) == (0.5, [7, 8])


# Time steps.

def test_what_is_usual_is_the_trained_step_s_worst():
    found = with_usual_errors([(1, trial(GOOD, error=0.2)), (1, trial(GOOD, error=0.4)),
                        (2, trial(GOOD, error=0.9))])
    assert [t.usual for _, t in found] == [0.4] * 3


def test_how_far_runs_go_ends_at_the_first_that_does_not():
    found = Records()
    runs = [(1, trial(GOOD)), (2, trial(GOOD)), (3, trial(GOOD, flags="off")), (5, trial(GOOD)),
            (10, trial(GOOD, message="no"))]
    record_largest_steps(found, runs, {(1.0, 1): True, (1.0, 2): False, (1.0, 3): True})
    assert found["extremes.ldm.dt.fine"][0] == 2
    value, note, rule = found["extremes.ldm.dt.going"]
    assert (value, rule["bound"]) == (5, 1.0)
    assert "full-order runs do up to 1" in note


# Long runs.

def test_energy_is_that_of_the_state_and_distance_that_of_the_points(net):
    one = ldm_full_model(with_(GRAVITY.scene(2.0), steps=6))
    states, X = [], one.X
    reduced_end(one, full_positions(one.problem)[0], net, RunOptions(points=50), states_out=states)
    E = extrapolation.energies(one, net.field, RunOptions(), [latent for latent, _ in states])
    height = 2.0 * one.m @ states[0][1][:, 2]
    assert E[0] == pytest.approx(height, abs=0.05)          # no motion, hardly any strain
    assert (np.diff(E)[1:] < 0.0).all()                     # PIC loses energy
    assert extrapolation.rms_displacement(X + np.array([0.3, 0.0, 0.4]), X) == pytest.approx(0.5)


# Singular maps.

def test_redundant_maps_do_what_the_sound_one_does(net, rng):
    X = ldm_full_model(GRAVITY.scene(1.0)).X[::50]
    short = GRAVITY._replace(scene=lambda g: with_(GRAVITY.scene(g), steps=3)).run([9, 20])
    pod = pod_reduction(short, 4)
    made = rank_study.redundant_maps(net, pod, rank_study.NEAR["standard"], rng)
    for reduction, rank in made:
        of = pod if hasattr(reduction.field, "U") else net
        for xhat, wide in zip(of.xhat[0], reduction.xhat[0], strict=True):
            assert np.allclose(reduction.field.place(X, wide), of.field.place(X, xhat), atol=1e-15)
        G = reduction.field.derivatives(X, reduction.rest)[2].reshape(-1, 5)
        s = np.linalg.svd(G, compute_uv=False)
        assert np.sum(s > rank_study.RANKED * s[0]) == rank
    assert {rank for _, rank in made} == {4, 5}


def test_lacking_maps_do_not(net):
    X = ldm_full_model(GRAVITY.scene(1.0)).X[::50]
    for reduction in rank_study.deficient_maps(net):
        G = reduction.field.derivatives(X, net.rest)[2].reshape(-1, 4)
        assert np.linalg.matrix_rank(G, tol=1e-12) == 3


# Files.

@pytest.fixture(scope="module")
def readers(tmp_path_factory):
    """{kind: (file, its reader)} of the maps that are damaged."""
    found = files.write_models(tmp_path_factory.mktemp("maps"), np.random.default_rng(0))
    return {kind: (path, load) for kind, path in
            zip(("network", "modes", "curved"), found, strict=True)}


@pytest.fixture(params=["network", "modes", "curved"])
def reader(request, readers):
    return readers[request.param]


def test_maps_are_sound_before_they_are_damaged(readers):
    models = {kind: read(path) for kind, (path, read) in readers.items()}
    assert {kind: model.field.r for kind, model in models.items()} == {
        "network": 4, "modes": 4, "curved": 2}
    assert [type(model.field).__name__ for model in models.values()] == [
        "Decoder", "PodModes", "Curved"]


@pytest.mark.parametrize(("kind", "name"), [("network", "net.W"), ("modes", "slope"),
                                            ("curved", "C")])
def test_every_byte_of_a_file_is_of_one_class(readers, kind, name):
    path, _ = readers[kind]
    ranges = sorted(files.byte_ranges(path).values())
    assert ranges[0][0] == 0
    assert ranges[-1][1] == path.stat().st_size
    assert all(a[1] == b[0] for a, b in pairwise(ranges))
    begin, end = files.byte_ranges(path)[f"{name}.npy, numbers"]
    stored = files.load_arrays(path)[name].ravel()
    numbers = np.frombuffer(path.read_bytes()[begin:end], dtype=stored.dtype)
    assert np.array_equal(np.sort(numbers), np.sort(stored))


def test_one_bit_is_flipped():
    content = bytes(range(40))
    damaged = files.flip_bit(content, 7, 3)
    changed = [a ^ b for a, b in zip(content, damaged, strict=True)]
    assert changed[7] == 8
    assert sum(map(bool, changed)) == 1


@pytest.mark.parametrize(("error", "clear"), [
    (ValueError("map.npz is damaged; train again"), True), (ValueError("is damaged; again"), False),
    (ValueError("map.npz is damaged"), False), (ValueError("map.npz\nis damaged; again"), False),
    (KeyError("map.npz; W"), False), (None, False)])
def test_a_refusal_is_one_sentence_with_name_and_advice(tmp_path, error, clear):
    def read():
        if error:
            raise error

    assert files.read_refusal(read, tmp_path / "map.npz")[0] is clear


def test_unfit_files_are_those_that_the_loader_must_find(reader, tmp_path):
    (path, read), copy = reader, tmp_path / "copy.npz"
    made = list(files.invalid_contents(files.load_arrays(path)))
    assert {"not finite", "wrong sizes"} <= {kind for kind, *_ in made}
    for _, what, content in made:
        copy.write_bytes(content)
        ok, said = files.read_refusal(lambda: read(copy), copy)
        assert ok, what
        assert "checksum" not in said       # the seal is sound


def test_files_with_the_seal_of_another_one_are_refused_for_it(readers, tmp_path):
    copy = tmp_path / "copy.npz"
    for path, read in readers.values():
        for other, _ in readers.values():
            copy.write_bytes(files.with_other_seal(path, other)[2])
            ok, said = files.read_refusal(lambda read=read: read(copy), copy)
            assert (ok, "checksum" in said) == (2 * (other != path,))


# Calibration.

def test_the_rates_of_a_bound_are_of_wrong_and_of_good_runs():
    trials = [trial(GOOD, departure=1.0), trial(GOOD, departure=4.0),
              trial(GOOD, departure=np.inf), trial(GOOD, error=50.0, departure=2.0),
              trial(GOOD, error=50.0, departure=7.0)]

    def measure(t):
        return t.end.departure

    assert rates_at(trials, measure, 3.0) == (0.5, 2 / 3, 2, 3)
    assert rates_at(trials[:1], measure, 3.0) == (0.0, 0.0, 0, 1)
    tables, found = {}, Records()
    found.table = lambda name, columns, rows: tables.update({name: rows})
    record_bound(found, "bound", trials, measure, 3.0)
    assert found["bound.misses"][0] == 0.5
    assert found["bound.false_alarms"][0] == 2 / 3
    assert tables["curve"] == [(2.0, 0.5, 2 / 3, 2, 3), (7.0, 1.0, 1 / 3, 2, 3)]


def test_calibration_runs_are_none_that_the_bound_is_judged_by():
    values = ldm_calibration.VALUES
    for study in (GRAVITY, TORSION):
        tests = [tuple(study.mu[k]) for k in study.test]
        assert not {*values[study.name]} & {*tests, MU[study.name]}
        assert {*values[study.name]} <= {tuple(study.mu[k]) for k in study.train}
    assert not {*rank_study.OTHERS[::2]} & {*ldm_calibration.MAPS["standard"]}
