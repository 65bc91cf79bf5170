"""The monitor of a reduced run: each check by itself, and the run that leaves no body."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
import rom_toys

from mpm_ref.rom.extrapolation import LATENTS, extent, trained_paths
from mpm_ref.rom.fields.pod import basis
from mpm_ref.rom.integrity import DamagedModel
from mpm_ref.rom.latent import start_state
from mpm_ref.rom.step import StepReport
from mpm_ref.rom.study import monitor as monitoring
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.monitor import (
    DEPARTURE,
    MEMORY,
    OFF,
    MapMonitor,
    NoBodyLeft,
    StateCheck,
    checked_states,
    coverage,
    map_monitor,
)
from mpm_ref.rom.study.run import RunOptions, RunState, ldm_run
from mpm_ref.rom.study.samples import SampleSet
from validation.common.scenes import with_
from validation.ldm.studies import GRAVITY

WELL = StateCheck(beyond=0.3, off=0.01, coverage=0.9, blind=0, lost=0.0, J=0.8, inverted=0.0,
                  far=0.9)
DX, DT = 0.1, 0.02


def report(map, residual=0.0, rank=None, lost=0):
    return StepReport(9, 30, map.r if rank is None else rank, residual, 1, True, {"lost": lost})


@pytest.fixture
def toy(d, rng):
    """`MapMonitor` of an affine map with two runs of training latents, and coordinates of one."""
    map, xhat = rom_toys.affine(d)
    runs = map.rest + 0.1 * rng.normal(size=(2, 5, map.r))
    runs[0, 0] = xhat
    X = rom_toys.cloud(d, 20)
    return MapMonitor(map, X, extent(runs, np.eye(map.r)), DX, DT, X,
                      monitoring.principal_axes(X), {}), xhat


def look(monitor, latent, report=None, samples=None, last=None):
    """The check of a state that was reached with samples at these points."""
    if samples is None:
        return monitor.check(RunState(0.0, latent))
    numbers = SampleSet(0.0, np.arange(len(samples)))
    return monitor._replace(all_points=samples).check(RunState(DT, latent, report, numbers), last)


# What samples see.

def test_points_see_all_of_their_own_motion(d, rng):
    G = rng.normal(size=(8, d, 4))
    assert coverage(G, G) == pytest.approx(1.0, rel=1e-12)
    assert coverage(G, 0.3 * G) == pytest.approx(0.3, rel=1e-12)
    assert coverage(G, np.concatenate([G, G])) == pytest.approx(1.0, rel=1e-12)


def test_the_least_counts_whatever_the_coordinates(rng):
    G = rng.normal(size=(30, 3, 4))
    A = np.diag([1.0, 1e-3, 30.0, 2.0]) @ np.linalg.qr(rng.normal(size=(4, 4)))[0]
    shares = np.array([0.8, 0.2, 0.5, 1.5])
    assert coverage(G @ A, G @ np.diag(shares) @ A) <= 0.2 * (1.0 + 1e-9)
    assert coverage(G @ A, G[:3] @ A) == pytest.approx(coverage(G, G[:3]), rel=1e-8)
    orthogonal = np.linalg.qr(G.reshape(-1, 4))[0].reshape(G.shape)
    assert coverage(orthogonal, orthogonal * shares) == pytest.approx(0.2, rel=1e-9)


def test_a_motion_that_no_sample_makes_is_not_seen(rng):
    G = rng.normal(size=(8, 3, 4))
    still = G.copy()
    still[..., 1] = 0.0
    assert coverage(G, still) < 1e-12
    assert coverage(G, G[:1]) == 0.0                    # three equations for four coordinates


def test_directions_that_move_nothing_need_not_be_seen(rng):
    G = rng.normal(size=(8, 3, 2))
    wide = np.concatenate([G, G[..., :1], np.zeros((8, 3, 1))], axis=2)
    assert coverage(wide, wide[:2]) == pytest.approx(coverage(G, G[:2]), rel=1e-9)


@pytest.mark.parametrize("broken", [np.nan, np.inf])
def test_what_is_not_finite_is_not_seen(rng, broken):
    G = rng.normal(size=(8, 3, 2))
    assert coverage(np.where(G > 1.0, broken, G), G) == 0.0


# A look.

def test_a_state_of_the_training_is_well(toy):
    monitor, xhat = toy
    found = look(monitor, start_state(xhat), report(monitor.g),
                 rom_toys.cloud(monitor.g.dim, 30, 1), WELL)
    J = np.linalg.det(monitor.g.derivatives(monitor.X, xhat)[1])
    assert found.beyond < 1e-12
    assert found.J == pytest.approx(J.min())
    assert (found.off, found.blind, found.lost, found.inverted) == (0.0, 0, 0.0, 0.0)
    assert found.out_of_bounds == ()
    assert found.message == ""


def test_at_the_start_the_body_must_be_where_it_is_at_rest(toy):
    monitor, xhat = toy
    assert look(monitor, start_state(monitor.g.rest)).off < 1e-12
    moved = np.linalg.norm(monitor.g.place(monitor.X, xhat) - monitor.X, axis=1)
    found = look(monitor, start_state(xhat))
    assert found.off == pytest.approx(np.sqrt(np.mean(moved**2)) / DX)
    assert found.out_of_bounds == ("off",)
    assert found.coverage == 1.0


def test_reports_are_read(toy):
    monitor, xhat = toy
    samples = rom_toys.cloud(monitor.g.dim, 30, 1)
    known = report(monitor.g, 0.4, monitor.g.r - 2, 10)
    found = look(monitor, start_state(xhat), known, samples, WELL)
    assert found.off == pytest.approx(0.4 * DT / DX)
    assert found.blind == 2
    assert found.lost == pytest.approx(10 / 40)
    assert found.out_of_bounds == ("blind", "lost")      # off has a bound at the start alone


def test_a_poor_draw_is_forgiven_and_many_are_not(toy):
    """What strays from the training counts by the share of it that the samples show."""
    monitor, xhat = toy
    runs = np.stack([xhat + 0.01 * np.outer(np.arange(5), np.ones(monitor.g.r)) + k
                     for k in (0.0, 1.0)])
    inside = extent(runs, np.eye(monitor.g.r))
    monitor = monitor._replace(extent=inside, paths=trained_paths(inside, runs))
    one, sight, count = monitor.X[:1], WELL, 0
    latent = start_state(xhat).advance(xhat + 0.03)     # a step three times as long as the trained
    first = look(monitor, latent, report(monitor.g), one, WELL)
    assert first.coverage == pytest.approx(MEMORY * WELL.coverage)     # one point shows nothing
    assert first.spread == pytest.approx(MEMORY * WELL.spread)
    bare = monitor.paths.distance(xhat, xhat + 0.03)
    assert first.departure == pytest.approx(bare / (first.coverage * first.spread))
    assert first.out_of_bounds == ()
    while "departure" not in sight.out_of_bounds:
        sight, count = look(monitor, latent, report(monitor.g), one, sight), count + 1
    assert 3 <= count <= 20
    assert sight.sum_squares == pytest.approx(count * bare**2)
    assert sight.departure == pytest.approx(bare / (sight.coverage * sight.spread))


def test_samples_that_show_nothing_leave_any_departure(toy):
    monitor, xhat = toy
    found = look(monitor, start_state(xhat), report(monitor.g), monitor.X[:1],
                 WELL._replace(coverage=0.0))
    assert found.departure == np.inf
    assert found.out_of_bounds == ("departure",)


def test_samples_in_one_place_are_within_a_small_part_of_the_body(toy, rng):
    """Whatever the body's axes; the spread of many random samples is that of the body."""
    monitor, xhat = toy
    d = monitor.g.dim
    X = rng.normal(size=(4000, d)) * np.array([3.0, 1.0, 0.5])[:d]
    Q = np.linalg.qr(rng.normal(size=(d, d)))[0]
    for turn in (np.eye(d), Q):
        axes = monitoring.principal_axes(X @ turn)
        assert monitoring.spread(X @ turn, axes) == pytest.approx(1.0)
        near = np.abs(X[:, 0]) < 0.3
        assert monitoring.spread(X[near] @ turn, axes) == pytest.approx(0.058, abs=0.01)
    flat = X * (np.arange(d) != 1)
    assert monitoring.principal_axes(flat).shape == (d, d - 1)
    monitor, together = monitor._replace(axes=monitoring.principal_axes(X)), X[near][:30]
    found = look(monitor, start_state(xhat), report(monitor.g), together, WELL)
    assert found.spread == pytest.approx(
        MEMORY * WELL.spread + 0.2 * monitoring.spread(together, monitor.axes))


def test_far_latents_and_inverted_points_are_told(toy):
    monitor, xhat = toy
    map = monitor.g
    far = xhat.copy()
    far[map.dim] += 10.0                            # a shift along the first axis
    found = look(monitor, start_state(far), report(map), rom_toys.cloud(map.dim, 30, 1), WELL)
    assert found.beyond > 5.0
    assert found.out_of_bounds == ("beyond",)
    assert found.nonsense == ""
    far[map.dim] *= 1000.0
    assert "times as far from the trained mean" in look(monitor, start_state(far)).nonsense
    turned = xhat.copy()
    turned[:map.dim] *= -1.0                        # a mirror
    found = look(monitor, start_state(turned), report(map), rom_toys.cloud(map.dim, 30, 1), WELL)
    assert found.inverted == 1.0
    assert found.J < 0.0
    assert found.nonsense == "100% of the points looked at have no det F > 0"
    assert "inverted" in found.out_of_bounds


@pytest.mark.parametrize("broken", [np.nan, np.inf])
def test_latents_that_are_no_numbers_are_nonsense(toy, broken):
    monitor, xhat = toy
    found = look(monitor, start_state(np.where(xhat == xhat[0], broken, xhat)),
                       report(monitor.g, broken), monitor.X[:9], WELL)
    assert found.nonsense
    assert "beyond" in found.out_of_bounds


@pytest.mark.parametrize(("changes", "name", "said"), [
    ({"beyond": 1.6}, "beyond", "1.6 times as far from the training runs"),
    ({"off": 0.05, "most_off": OFF}, "off", "0.05 cells from the body at rest"),
    ({"coverage": 0.25, "least_coverage": 0.3}, "coverage", "saw only 25%"),
    ({"departure": 2.0 * DEPARTURE}, "departure",
     f"{2.0 * DEPARTURE:.3g} times as far from those of the training runs as these are from each "
     f"other, above {DEPARTURE:g}: take more samples"),
    ({"departure": 2.0, "most_departure": 0.5}, "departure", "above 0.5"),
    ({"blind": 1}, "blind", "1 of the latent coordinates"), ({"lost": 0.02}, "lost", "2.0%"),
    ({"inverted": 0.03, "J": -0.1}, "inverted", "det F down to -0.1"),
    ({"beyond": np.nan}, "beyond", "nan times"),
])
def test_each_bound_is_told_by_itself(changes, name, said):
    found = WELL._replace(**changes)
    assert found.out_of_bounds == (name,)
    assert said in found.message
    assert WELL.out_of_bounds == ()
    assert found.nonsense == ""


def test_a_look_costs_few_points_however_many_there_are(d, rng):
    map, xhat = rom_toys.affine(d)
    asked = []

    class Counted(NamedTuple):
        dim: int = d
        r: int = map.r

        def derivatives(self, X, xhat):
            asked.append(len(X))
            return map.derivatives(X, xhat)

    runs = map.rest + 0.1 * rng.normal(size=(2, 300, map.r))
    scene = with_(GRAVITY.scene(1.0), steps=1)
    body = ldm_full_model(scene)._replace(X=rom_toys.cloud(d, 5000))
    made = map_monitor(body, Counted(), runs)
    assert sum(asked) <= LATENTS * monitoring.CHECKED
    asked.clear()
    look(made, start_state(xhat), report(map), rom_toys.cloud(d, 3000), WELL)
    assert sum(asked) <= 2 * monitoring.CHECKED


def test_training_latents_that_do_not_differ_are_refused(d):
    map, xhat = rom_toys.affine(d)
    with pytest.raises(ValueError, match="do not differ"):
        map_monitor(ldm_full_model(GRAVITY.scene(1.0))._replace(X=rom_toys.cloud(d, 30)), map,
              np.tile(xhat, (2, 3, 1)))


# A run.

@pytest.fixture(scope="module")
def fall():
    """`Case` of a short fall, and the `Basis` of two modes of two such."""
    short = GRAVITY._replace(scene=lambda g: with_(GRAVITY.scene(g), steps=4))
    full = short.run([20, 29])
    made = basis(full.X, *full.flat(), 2)
    return ldm_full_model(short.scene(*short.mu[29])), made.modes, made.xhat.reshape(2, 5, 2)


class Turned(NamedTuple):
    """A map whose far end is inverted wherever the body has moved."""

    map: object

    @property
    def dim(self):
        return self.map.dim

    @property
    def r(self):
        return self.map.r

    def place(self, X, xhat):
        return self.map.place(X, xhat)

    def velocity(self, X, xhat, vhat):
        return self.map.velocity(X, xhat, vhat)

    def derivatives(self, X, xhat):
        x, F, G = self.map.derivatives(X, xhat)
        if np.abs(xhat).max() > 0.5:
            F[X[:, 0] > 0.3] *= -1.0
        return x, F, G


def test_a_checked_run_is_the_run_and_is_well(fall):
    one, modes, xhat = fall
    run = ldm_run(one, modes, RunOptions(points=20), np.zeros(2), seed=3)
    checked = list(checked_states(run, map_monitor(one, modes, xhat)))
    for plain, (state, check) in zip(run.states(), checked, strict=True):
        assert np.array_equal(plain.latent.xhat, state.latent.xhat)
        assert plain.report == state.report
        assert check.out_of_bounds == ()
        assert check.beyond < 1.0


def test_a_run_among_trained_states_that_moves_otherwise_is_out_of_bounds(fall):
    """Steps twice as long: each state is one that training has, and no other check sees it."""
    one, modes, xhat = fall
    clock = one.problem.clock
    longer = one._replace(problem=replace(one.problem, clock=replace(
        clock, dt=2.0 * clock.dt, steps=clock.steps // 2)))
    ends = {}
    for name, full in (("trained", one), ("longer", longer)):
        run = ldm_run(full, modes, RunOptions(points=50), np.zeros(2))
        *_, (_, ends[name]) = checked_states(run, map_monitor(full, modes, xhat))
    assert ends["longer"].beyond < 1.0
    assert ends["trained"].departure < 1.0
    assert ends["longer"].departure > 5.0 * ends["trained"].departure


def test_a_run_whose_map_is_damaged_meanwhile_says_so_at_its_end(fall):
    one, modes, xhat = fall
    modes = modes._replace(U=modes.U.copy())
    run = ldm_run(one, modes, RunOptions(points=20), np.zeros(2), seed=3)
    states = checked_states(run, map_monitor(one, modes, xhat))
    for _ in range(5):
        next(states)
    modes.U[-1, -1, -1] = np.nextafter(modes.U[-1, -1, -1], 1.0)
    with pytest.raises(DamagedModel, match="changed in memory: U;"):
        next(states)


def test_samples_of_others_choice_are_taken_and_looked_at(fall):
    one, modes, xhat = fall
    near = SampleSet(0.0, np.argsort(one.X[:, 0])[:20])     # all at the end that is held
    run = ldm_run(one, modes, RunOptions(points=20), np.zeros(2))
    run = run._replace(make_sampler=lambda xhat: lambda t, latent: near)
    states = list(checked_states(run, map_monitor(one, modes, xhat)))
    assert [state.report.samples for state, _ in states[1:]] == [20] * 4
    shares = [check.coverage for _, check in states]
    assert shares[0] == 1.0
    assert (np.diff(shares) < -0.05).all()              # far less is seen in each step


def test_where_no_body_is_left_the_run_stops_and_says_where_when_and_why(fall):
    one, modes, xhat = fall
    looked, states = map_monitor(one, Turned(modes), xhat), []
    with pytest.raises(NoBodyLeft) as stop:
        states.extend(checked_states(ldm_run(one, looked.g, RunOptions(points=20), np.zeros(2)),
                                     looked))
    said, k = str(stop.value), len(states)
    assert 1 <= k <= 4
    assert said.startswith(f"step {k}, t = {k * looked.dt:.6g} s: no body is left, ")
    assert "\n" not in said
    assert float(said.split("X = ")[1].split(",")[0]) > 0.3
    assert f"out of bounds since step {k}: " in said
    assert "are inverted, det F down to -" in said
