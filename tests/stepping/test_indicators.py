"""Indicators of error against plain loops and closed forms, and when runs give warnings."""

import numpy as np
import pytest
from sweep_scenes import BOUNCE, scene_of

from mpm_ref.energy import Energy, energy
from mpm_ref.indicators import (
    INDICATORS,
    SAMPLES,
    IndicatorWatch,
    at_rest,
    conserves_energy,
    deformation_share,
    energy_lost,
    is_due,
    nearest,
    phase_error,
    sentence_of,
    widest_gap,
)
from mpm_ref.problem import Clock
from mpm_ref.scene import build, loads
from mpm_ref.simulate import State, simulate
from mpm_ref.store import checkpoint

BAR = """
dim = {dim}
dx = 0.1
end = 0.2
gravity = {zero}
{more}
[[body]]
name = "bar"
density = 1000.0
shape = {{ type = "box", lower = {low}, upper = {high} }}
sampling = {{ type = "regular", per_cell = 2 }}
material = {{ law = "{law}", {keys} }}
velocity = {{ {velocity} }}
"""
SOFT = "E = 1e3, nu = 0.3"


def bar(dim=2, law="fixed_corotated", keys=SOFT, velocity="", more=""):
    """Return the problem of a bar of 0.4 x 0.2 (x 0.2) m without gravity."""
    return build(loads(BAR.format(dim=dim, zero=[0.0] * dim, low=[0.0] * dim, more=more,
                                  high=[0.4] + [0.2] * (dim - 1), law=law, keys=keys,
                                  velocity=velocity)))


def warnings_of(problem):
    """Run a problem and return the names of its warnings, the worst values, and all sentences."""
    watch, sentences = IndicatorWatch(problem), []
    for _ in simulate(problem, on_step=lambda state, dt: sentences.extend(watch.news(state, dt))):
        pass
    return [text.split(":")[0] for text in sentences], watch.values(), sentences


# formulas

@pytest.mark.parametrize("dim", [2, 3])
def test_widest_gap_is_that_of_all_neighbours(dim):
    rng = np.random.default_rng(dim)
    X, x = rng.random((40, dim)), rng.random((40, dim))
    widest = 0.0
    for p in range(40):
        order = np.argsort([np.linalg.norm(X[q] - X[p]) for q in range(40)])
        for q in order[1:1 + 2 * dim]:
            widest = max(widest, np.linalg.norm(x[q] - x[p]) - np.linalg.norm(X[q] - X[p]))
    assert widest_gap(X, x, nearest(X, 2 * dim)) == pytest.approx(widest, rel=1e-14)
    assert widest_gap(X, 0.5 * X, nearest(X, 2 * dim)) == 0.0


def test_one_particle_has_no_gap():
    x = np.zeros((1, 2))
    assert widest_gap(x, x, nearest(x, 4)) == 0.0


@pytest.mark.parametrize("dim", [2, 3])
def test_rigid_motion_deforms_nothing(dim):
    rng = np.random.default_rng(dim)
    X = rng.random((30, dim))
    Q, _ = np.linalg.qr(rng.standard_normal((dim, dim)))
    Q[:, 0] *= np.sign(np.linalg.det(Q))
    assert deformation_share(X, X @ Q + 3.0) < 1e-14
    assert deformation_share(X, X) == 0.0
    flip = np.eye(dim)
    flip[0, 0] = -1.0                                   # a mirror image is no rigid motion
    assert deformation_share(X, X @ flip) > 0.1


@pytest.mark.parametrize("dim", [2, 3])
def test_share_of_a_stretch_is_objective(dim):
    """A stretch about the centre deforms alone; with a shift b it is its share of the motion."""
    rng = np.random.default_rng(0)
    X = rng.random((50, dim))
    X -= X.mean(axis=0)
    assert deformation_share(X, 1.1 * X) == pytest.approx(1.0)
    stretch, shift = np.mean(np.sum((0.1 * X) ** 2, axis=1)), 0.3**2
    share = deformation_share(X, 1.1 * X + np.array([0.3] + [0.0] * (dim - 1)))
    assert share == pytest.approx(np.sqrt(stretch / (stretch + shift)))


def test_energy_lost_is_a_share_of_what_could_move():
    start = Energy(kinetic=2.0, elastic=1.0, gravity=10.0)
    assert energy_lost(start, least=12.0, lowest=8.0) == pytest.approx(1.0 / 5.0)
    assert energy_lost(Energy(0.0, 0.0, 5.0), least=5.0, lowest=5.0) == 0.0


@pytest.mark.parametrize("dim", [2, 3])
def test_phase_error_counts_crossings_over_cells(dim):
    rest = at_rest(bar(dim).bodies[0])
    assert (rest.length, rest.thickness) == pytest.approx((0.4, 0.2))
    modulus = 1e3 * (1.0 - 0.3) / (1.3 * 0.4)
    assert rest.speed == pytest.approx(np.sqrt(modulus / 1e3))
    t = 5.0 * rest.length / rest.speed
    assert phase_error(rest, 0.5, 0.1, t) == pytest.approx(0.5 * 5.0 / 4.0)


@pytest.mark.parametrize(("problem", "conserves"), [
    (bar(), True),
    (bar(law="fluid", keys="lam = 1e4"), True),
    (bar(law="hencky", keys=SOFT + ', flow = { type = "von_mises", sigma_y = 1e3 }'), False),
    (build(scene_of(BOUNCE)), True),
    (build(loads(BOUNCE + 'kind = "separate"\nfriction = 0.1\n')), False),
    (build(loads(BOUNCE + 'motion = { translation = { type = "steady", rate = [0.0, 1.0] } }\n')),
     False),
    (bar(more="walls = { low = [0, 0], high = [9, 9], friction = 0.2 }"), False),
])
def test_energy_is_to_be_kept_where_nothing_drives_rubs_or_flows(problem, conserves):
    assert conserves_energy(problem) == conserves


# when states are measured

@pytest.mark.parametrize("clock", [Clock(dt=1e-3, end=0.2), Clock(end=0.2), Clock(dt=1e-3,
                                                                                steps=200)])
def test_a_run_is_measured_sixteen_times(clock):
    due = [is_due(clock, State((), step=k, t=k * 1e-3), 1e-3) for k in range(1, 201)]
    assert due[-1]
    assert sum(due) in (SAMPLES, SAMPLES + 1)
    short = [is_due(Clock(dt=0.1, steps=3), State((), step=k, t=0.1 * k), 0.1) for k in (1, 2, 3)]
    assert short == [True] * 3


# in runs

@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("integrator", ["explicit", "pn-pcg"])
def test_a_body_that_is_torn_gives_a_warning(dim, integrator):
    more = "" if integrator == "explicit" else (
        f'integrator = "{integrator}"\nlongest = 0.01\nscheme = {{ transfer = "apic" }}')
    velocity = "angular = 40.0" if dim == 2 else "angular = [0.0, 0.0, 40.0]"
    names, values, sentences = warnings_of(bar(dim, velocity=velocity, more=more))
    assert "gap" in names
    assert values["gap"] > INDICATORS["gap"].bound
    assert "neighbours of body 'bar' are" in sentences[names.index("gap")]
    slow = warnings_of(bar(dim, velocity=velocity.replace("40", "1"), more=more))
    assert "gap" not in slow[0]
    assert slow[1]["gap"] < 0.1


def test_what_flows_may_part():
    plastic = "E = 1e3, nu = 0.3, flow = { type = \"von_mises\", sigma_y = 1e2 }"
    for law, keys in (("fluid", "lam = 1e2"), ("hencky", plastic)):
        assert "gap" not in warnings_of(bar(law=law, keys=keys, velocity="angular = 40.0"))[1]


def test_a_stiff_body_vibrates_too_often_for_its_grid():
    text = BAR.format(dim=2, zero=[0.0, 0.0], low=[0.0, 0.0], high=[0.4, 0.2], more="",
                      law="fixed_corotated", keys="E = 1e4, nu = 0.3",
                      velocity="linear = [0.0, 0.1]").replace("end = 0.2", "end = 4.0")
    clamp = '[[fixed]]\nregion = { type = "box", lower = [-1.0, -1.0], upper = [0.05, 1.0] }\n'
    problem = build(loads(text + clamp))
    names, values, _ = warnings_of(problem)
    assert "dispersion" in names
    assert values["dispersion"] > INDICATORS["dispersion"].bound


@pytest.mark.parametrize(("velocity", "low", "high"), [("angular = 40.0", 0.3, 0.6),
                                                       ("linear = [1.0, 0.0]", -1e-9, 1e-9)])
def test_lost_energy_is_that_of_the_whole_run(velocity, low, high):
    problem = bar(velocity=velocity)
    start = energy(problem.bodies, problem.gravity, problem.inertia)
    _, values, _ = warnings_of(problem)
    end = energy(problem.bodies, problem.gravity, problem.inertia)
    assert low < values["dissipation"] < high
    assert values["dissipation"] >= (start.sum - end.sum) / start.kinetic - 1e-12


def test_each_indicator_is_reported_once_and_finite():
    names, values, _ = warnings_of(bar(velocity="angular = 40.0"))
    assert len(names) == len(set(names))
    assert set(names) <= set(values) <= set(INDICATORS)
    assert np.isfinite(list(values.values())).all()


def test_sentences_name_number_bound_and_what_to_try():
    for name, one in INDICATORS.items():
        text = sentence_of(name, 3.25, "bar", 0.5)
        assert text.startswith(f"{name}: ")
        assert "\n" not in text
        assert "3" in text
        assert "bound" in text
        assert text.endswith(f"; {one.advice}")


def test_watching_changes_no_bit():
    def last(watched):
        problem = bar(velocity="angular = 20.0")
        watch = IndicatorWatch(problem)
        *_, frame = simulate(problem, on_step=watch.news if watched else None)
        return checkpoint.digest(frame.state)
    assert last(True) == last(False)
