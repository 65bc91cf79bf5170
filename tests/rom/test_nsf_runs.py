"""Scenes as reduced runs with inferred stress see them, and such runs beside the full ones."""

from itertools import pairwise

import numpy as np
import pytest

from mpm_ref import scene
from mpm_ref.rom.cubature import cubature
from mpm_ref.rom.fields.pod_fields import Sizes, fit_pod_fields
from mpm_ref.rom.quadrature.stencil_overlap import bases
from mpm_ref.rom.snapshots import join_histories
from mpm_ref.rom.study import samples
from mpm_ref.rom.study.dataset import simulate_history
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.run import FieldRunOptions, nsf_run, nsf_start
from mpm_ref.rom.study.samples import (
    SampleSet,
    cell_samples,
    drawn_samples,
    nsf_sampler,
    require_valid_sets,
    weighted_samples,
)
from mpm_ref.scene.overrides import with_values

TOML = """
title = "two disks"
dim = 2
dx = 0.05
dt = 1e-3
steps = 30
gravity = [0.0, -9.8]
scheme = { transfer = "apic" }

[[body]]
name = "hard"
density = 1000.0
shape = { type = "sphere", center = [0.3, 0.3], radius = 0.15 }
sampling = { type = "regular", per_cell = 2 }
material = { law = "fixed_corotated", E = 1e5, nu = 0.3 }
velocity = { linear = [2.0, 0.0] }

[[body]]
name = "soft"
density = 500.0
shape = { type = "sphere", center = [0.65, 0.32], radius = 0.15 }
sampling = { type = "regular", per_cell = 2 }
material = { law = "hencky", E = 5e4, nu = 0.3, flow = { type = "von_mises", tau_y = 2e3 } }
"""
SPEEDS = (1.6, 2.0, 2.4)


@pytest.fixture(scope="module")
def disks(tmp_path_factory):
    """The scene of a speed of the first disk [m/s]."""
    path = tmp_path_factory.mktemp("disks") / "disks.toml"
    path.write_text(TOML)
    base = scene.load(path)
    return lambda v, **changes: with_values(base, {"body.hard.velocity.linear[0]": v, **changes})


@pytest.fixture(scope="module")
def runs(disks):
    """Histories of some speeds."""
    return join_histories([simulate_history(disks(v), [v]) for v in SPEEDS])


def test_points_of_all_bodies_are_in_one_list(disks, runs):
    one = nsf_full_model(disks(2.0))
    hard, soft = (body.particles for body in one.problem.bodies)
    n = len(hard.x)
    assert len(one.X) == n + len(soft.x) == len(runs.X)
    assert np.array_equal(one.X, np.concatenate([hard.x, soft.x]))
    assert np.array_equal(one.m, np.concatenate([hard.m, soft.m]))
    assert np.array_equal(one.v[:n], np.tile([2.0, 0.0], (n, 1)))
    assert not one.v[n:].any()


def test_a_history_is_that_of_the_full_run(disks, runs):
    assert runs.x.shape == (3, 31, len(runs.X), 2)
    assert runs.mu.tolist() == [[1.6], [2.0], [2.4]]
    assert np.array_equal(runs.x[:, 0], np.tile(runs.X, (3, 1, 1)))
    v = np.diff(runs.x, axis=1) / runs.dt
    assert np.abs(v[1, 0, 0] - [2.0, -9.8e-3]).max() < 1e-9
    assert not runs.tau[:, 0].any()
    assert np.abs(runs.tau[:, -1]).max() > 100.0
    assert np.abs(runs.C[:, -1]).max() > 0.1
    single = simulate_history(disks(2.0), [2.0], np.float32)
    assert single.x.dtype == np.float32
    assert np.abs(single.x[0] - runs.x[1]).max() < 1e-6


def test_a_history_of_one_step_in_several(disks, runs):
    thin = simulate_history(disks(2.0), [2.0], every=5)
    for name in ("x", "tau", "C"):
        assert np.array_equal(getattr(thin, name)[0], getattr(runs, name)[1, ::5])
    assert thin.dt == pytest.approx(5.0 * runs.dt)
    with pytest.raises(ValueError, match="one in 7 of 30 steps: expected a divisor of the steps"):
        simulate_history(disks(2.0), [2.0], every=7)


def test_a_reduced_run_follows_the_full_one(disks, runs):
    v = 1.8
    full = simulate_history(disks(v), [v]).x[0]
    fields, xhat = fit_pod_fields(runs, Sizes(r=3, modes=6, tau=15, C=15), 0.15, follows=False)
    n = len(runs.X)

    def worst(plan):
        run = nsf_run(nsf_full_model(disks(v)), fields, plan, xhat[:, 0].mean(axis=0))
        found = [fields.place(np.arange(n), state.latent.xhat) for state in run.states()]
        return max(np.abs(x - reference).max()
                   for x, reference in zip(found, full, strict=True))

    moved = np.abs(full[-1] - full[0]).max()
    assert worst(FieldRunOptions((drawn_samples(n, n, 0),))) < 0.05 * moved
    assert worst(FieldRunOptions((drawn_samples(n, 12, 0),))) < 0.1 * moved
    assert worst(FieldRunOptions((drawn_samples(n, 12, 0),), inversion="linear")) < 0.15 * moved


def test_times_of_longer_steps(disks, runs):
    fields, xhat = fit_pod_fields(runs, Sizes(r=3, modes=6, tau=15, C=15), 0.15, follows=False)
    plan = FieldRunOptions((drawn_samples(len(runs.X), 12, 0),), dt_factor=1.5)
    run = nsf_run(nsf_full_model(disks(2.0)), fields, plan, xhat[1, 0])
    times = [state.t for state in run.states()]
    assert len(times) == 21
    assert np.allclose(np.diff(times), 1.5e-3, rtol=1e-12)


def test_samples_switch_in_time():
    early, late = drawn_samples(40, 7, 0), drawn_samples(40, 3, 1, since=0.5)
    at = nsf_sampler((early, late))
    assert at(0.0, None) is early
    assert at(0.499, None) is early
    assert at(0.5, None) is late
    assert len(late.points) == 3
    assert all(a < b for a, b in pairwise(early.points))


def test_a_run_takes_the_samples_of_its_time(disks, runs):
    """From half-way on others, and fewer; the states go on from those before."""
    fields, xhat = fit_pod_fields(runs, Sizes(r=3, modes=6, tau=15, C=15), 0.15, follows=False)
    one, n = nsf_full_model(disks(2.0)), len(runs.X)
    early, late = drawn_samples(n, 12, 0), drawn_samples(n, 9, 1, since=0.015)
    both, first = ([(state.latent.xhat, state.report)
                    for state in nsf_run(one, fields, plan, xhat[1, 0]).states()]
                   for plan in (FieldRunOptions((early, late)), FieldRunOptions((early,))))
    assert [report.samples for _, report in both[1:]] == 15 * [12] + 15 * [9]
    assert np.array_equal(both[15][0], first[15][0])
    assert not np.array_equal(both[16][0], first[16][0])


def test_the_start_is_searched(disks, runs):
    """From latent coordinates a tenth of a radius off."""
    fields, xhat = fit_pod_fields(runs, Sizes(r=3, modes=6, tau=15, C=15), 0.15, follows=False)
    one, near = nsf_full_model(disks(2.0)), xhat[1, 0] + 0.1 * np.abs(xhat).max()
    everything = np.arange(len(one.X))
    off = [np.abs(fields.place(everything, at) - one.X).max()
           for at in (near, nsf_start(one, fields, near).xhat)]
    assert off[1] < 1e-3 * off[0]


def test_weighted_samples_are_better_than_drawn_ones(disks, runs):
    """With so few, motion that the modes do not resolve disturbs those that are drawn."""
    v = 1.8
    full = simulate_history(disks(v), [v]).x[0]
    fields, xhat = fit_pod_fields(runs, Sizes(r=3, modes=6, tau=15, C=15), 0.15, follows=False)
    n = len(runs.X)

    def worst(chosen):
        run = nsf_run(nsf_full_model(disks(v)), fields, FieldRunOptions((chosen,)),
                      xhat[:, 0].mean(axis=0))
        return max(np.abs(fields.place(np.arange(n), state.latent.xhat) - x).max()
                   for state, x in zip(run.states(), full, strict=True))

    by, known = weighted_samples(fields, n, 8, 0), cubature(fields.U, 3, np.arange(n), 8)
    assert len(by.points) <= 8
    assert np.array_equal(by.weights, known.w)
    assert by.misfit == known.misfit
    assert weighted_samples(fields, n, 8, 0, since=0.5).since == 0.5
    assert worst(by) < np.median([worst(drawn_samples(n, 8, seed)) for seed in range(5)])


def test_samples_of_few_cells_have_the_nodes_of_each_other(disks, runs):
    """So that a step on them asks for fewer points than on as many that lie anywhere."""
    fields, xhat = fit_pod_fields(runs, Sizes(r=3, modes=6, tau=15, C=15), 0.15, follows=False)
    scene, n = nsf_full_model(disks(1.8)), len(runs.X)
    few = cell_samples(fields, scene.problem, n, 3, 0)
    base = bases(scene.X, scene.problem.dx, scene.problem.scheme.degree)
    assert len(np.unique(base[few.points], axis=0)) <= 3 < len(few.points)
    assert few.misfit < weighted_samples(fields, n, 3, 0).misfit
    rest = xhat[:, 0].mean(axis=0)
    points = [np.mean([state.report.points for state in list(
        nsf_run(scene, fields, FieldRunOptions((chosen,)), rest).states())[1:]])
        for chosen in (few, drawn_samples(n, len(few.points), 0))]
    assert points[0] < points[1]


def test_samples_of_cells_are_some_of_those_asked_for(disks, runs):
    fields, _ = fit_pod_fields(runs, Sizes(r=3, modes=6, tau=15, C=15), 0.15, follows=False)
    among = np.arange(10, len(runs.X), 2)
    found = cell_samples(fields, nsf_full_model(disks(1.8)).problem, among, 5, 0, since=0.5)
    assert np.isin(found.points, among).all()
    assert found.since == 0.5


def test_cells_are_those_of_random_candidates(disks, runs, monkeypatch):
    monkeypatch.setattr(samples, "MAX_CELLS", 4)
    fields, _ = fit_pod_fields(runs, Sizes(r=3, modes=6, tau=15, C=15), 0.15, follows=False)
    problem, n = nsf_full_model(disks(1.8)).problem, len(runs.X)
    base = [tuple(one) for one in bases(runs.X, problem.dx, problem.scheme.degree)]
    for seed in range(3):
        offered = {base[p] for p in drawn_samples(n, 4, seed).points}
        assert {base[p] for p in cell_samples(fields, problem, n, 4, seed).points} <= offered


def test_more_samples_than_points_are_refused():
    with pytest.raises(ValueError, match=r"41 samples of 40 points: expected 1 \.\. 40"):
        drawn_samples(40, 41, 0)


@pytest.mark.parametrize(("points", "w", "words"), [
    ([], None, "samples"), ([3, 2], None, "sorted, each once"), ([2, 2], None, "each once"),
    ([-1, 2], None, r"some of 0 \.\. 39"), ([2, 40], None, r"some of 0 \.\. 39"),
    ([2, 3], [0.0, 0.0], "not all 0"), ([2, 3], [1.0, -1.0], "none negative"),
    ([2, 3], [1.0, np.nan], "finite numbers")])
def test_samples_and_weights_that_mean_nothing_are_refused(points, w, words):
    w = None if w is None else np.array(w)
    with pytest.raises(ValueError, match=words):
        require_valid_sets((SampleSet(0.0, np.array(points, dtype=int), w),), 40)


def test_samples_are_there_from_the_start_on(disks, runs):
    fields, xhat = fit_pod_fields(runs, Sizes(r=3, modes=6, tau=15, C=15), 0.15, follows=False)
    with pytest.raises(ValueError, match="samples from a later time on: expected some"):
        nsf_run(nsf_full_model(disks(2.0)), fields,
                FieldRunOptions((drawn_samples(40, 12, 0, 0.01),)), xhat[1, 0])


@pytest.mark.parametrize(("changes", "what"), [
    ({"scheme": {"transfer": "pic"}}, "the transfer pic"),
    ({"scheme": {"transfer": "mls"}}, "the transfer mls"),
    ({"clip": {"lower": [0.0, 0.0], "upper": [1.0, 1.0]}}, "a box that clips"),
    ({"body.soft.material": {"law": "fluid", "lam": 1e5}}, "a fluid"),
    ({"integrator": "hot"}, "the implicit integrator"),
])
def test_what_reduced_runs_do_not_know_is_refused(disks, changes, what):
    with pytest.raises(ValueError, match=f"has {what}: reduced runs .* expect "):
        nsf_full_model(disks(2.0, **changes))


def test_a_history_needs_a_fixed_step(disks):
    with pytest.raises(ValueError, match="adaptive: expected a fixed dt"):
        simulate_history(disks(2.0, dt=None, steps=None, end=0.01), [2.0])
