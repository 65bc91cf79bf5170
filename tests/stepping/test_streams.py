"""Sources, from which particles enter a run, and sinks, where they leave."""

import numpy as np
import pytest
from problems import digest, two_disks
from stream_scenes import DX, LENGTH, SPACING, SPEED, TOP, WIDTH, gravity, problem, sink
from threads import by_threads
from variants import slow_but

from mpm_ref.body import append, change_rows, select_rows
from mpm_ref.core.levelset import half_space
from mpm_ref.energy import energy, momentum
from mpm_ref.energy_budget import EnergyBudget
from mpm_ref.explicit import Scheme
from mpm_ref.monitor import Unstable
from mpm_ref.problem import Problem
from mpm_ref.simulate import simulate
from mpm_ref.streams import ParticleSink, ParticleSource, blocks_until, total_bodies

PERIOD = LENGTH / SPEED
FREE = "hold = false"
CLOCKS = {"explicit": "end = 0.35", "fixed dt": "dt = 0.0043\nend = 0.35",
          "implicit": 'integrator = "hot"\nlongest = 0.021\nend = 0.35'}


def block_mass(d):
    """Mass of a block [kg]."""
    return 1000.0 * LENGTH * WIDTH ** (d - 1)


def run(one):
    """(t, step, bodies' ids and positions) after each step of a problem, and the last state."""
    seen = []

    def note(state, dt):
        body = state.bodies[0]
        seen.append((state.t, state.step, body.id.copy(), body.particles.x.copy()))

    *_, last = simulate(one, on_step=note)
    return seen, last.state


def rows_of(x):
    """Heights of the rows of a stream, from the lowest [m]."""
    y = np.sort(x[:, 1])
    return y[np.concatenate(([True], np.diff(y) > 0.4 * SPACING))]


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("d", [2, 3])
def test_a_stream_has_no_gaps(d, clock):
    """Without forces its rows keep the spacing of a block, also where two blocks meet, and it
    carries the momentum rho A v^2 t.
    """
    _, state = run(problem(d, FREE, CLOCKS[clock]))
    body, (q, *_) = state.bodies[0], [b.particles for b in state.bodies]
    due = int(0.35 / PERIOD) + 1
    assert len(np.unique(body.id)) == len(body.id) == due * 4 * 4 ** (d - 1)
    rows = rows_of(q.x)
    assert len(rows) == 4 * due
    assert np.diff(rows) == pytest.approx(SPACING, rel=1e-6)
    assert rows[0] == pytest.approx(TOP - LENGTH + 0.5 * SPACING - SPEED * state.t, abs=1e-7)
    assert q.m.sum() == pytest.approx(due * block_mass(d), rel=1e-12)
    assert momentum(state.bodies)[1] == pytest.approx(-due * block_mass(d) * SPEED, rel=1e-9)


@pytest.mark.parametrize("clock", CLOCKS)
def test_blocks_enter_in_time(clock):
    """Adaptive steps end at the times of blocks; with a fixed dt a block enters at the first step
    that ends not before.
    """
    seen, _ = run(problem(2, FREE, CLOCKS[clock]))
    times = np.array([t for t, *_ in seen])
    counts = np.array([len(number) for _, _, number, _ in seen])
    for k in range(1, 4):
        first = times[np.flatnonzero(counts > 16 * k)[0]]
        assert first >= k * PERIOD * (1.0 - 1e-9)
        if clock == "fixed dt":
            assert first - k * PERIOD < 0.0043
        else:
            assert first == pytest.approx(k * PERIOD, rel=1e-9)


def test_many_blocks_enter_in_one_step():
    _, state = run(problem(2, FREE + ", length = 0.005, start = 0.0", "dt = 0.011\nsteps = 3"))
    assert len(state.bodies[0].id) == 16 * (int(0.033 / 0.005) + 1)
    heights = [state.bodies[0].particles.x[state.bodies[0].id == 16 * k, 1][0] for k in range(7)]
    assert np.diff(heights) == pytest.approx(0.005, rel=0.2)


def gap_at_entry(source):
    """Distance of the second block's lowest row from the first one's highest, as it enters [m]."""
    seen, _ = run(problem(2, source, "end = 0.1\n" + gravity()))
    _, _, number, x = seen[-1]
    assert len(number) == 32
    return x[number >= 16, 1].min() - x[number < 16, 1].max()


def test_a_source_holds_what_is_in_its_shape():
    """Under gravity a block that is held moves with its velocity until it has left; one that is
    free falls away from the next one.
    """
    assert gap_at_entry("") == pytest.approx(SPACING, rel=0.02)
    fallen = 0.5 * 9.8 * PERIOD**2
    assert gap_at_entry(FREE) == pytest.approx(SPACING + fallen, rel=0.06)


def test_a_source_stops_and_lets_go():
    """Blocks enter before `stop`; the nodes are held until the last one has passed."""
    one = problem(2, "stop = 0.2", "end = 0.5\n" + gravity())
    (held,) = one.conditions.prescribed
    assert (held.since, held.until) == (0.0, pytest.approx(0.2))
    (later,) = problem(2, "stop = 0.29", "end = 0.5\n" + gravity()).conditions.prescribed
    assert later.until == pytest.approx(0.3)        # the third block enters at 0.2 s
    assert one.sources[0].blocks == 2
    _, state = run(one)
    assert len(state.bodies[0].id) == 32


@pytest.mark.parametrize("clock", slow_but(["explicit", "implicit"], "explicit"))
@pytest.mark.parametrize("d", [2, 3])
def test_mass_is_what_entered_less_what_left(d, clock):
    one = problem(d, "", CLOCKS[clock].replace("0.35", "0.5") + "\n" + gravity(d), sink(d))
    n, gone, left = one.sources[0].block.id.size, set(), set()
    seen, state = run(one)
    for t, _, number, x in seen:
        now = set(number.tolist())
        assert len(now) == len(number)
        entered = set(range(one.sources[0].due(t) * n))
        assert now <= entered
        assert gone <= entered - now                # who left does not come back
        gone, left = entered - now, left | (entered - now)
        assert (x[:, 1] > 0.72).all()
    assert 0 < len(left) < len(entered)
    body = state.bodies[0]
    assert body.particles.m.sum() == pytest.approx(
        (len(entered) - len(left)) * block_mass(d) / n, rel=1e-12)


def test_an_empty_run_waits_for_its_source():
    """All particles leave, time passes, and the next block enters in time."""
    text = ('\n[[body]]\nname = "drop"\ndensity = 1000.0\nshape = { type = "box", lower = '
            '[0.5, 0.73], upper = [0.6, 0.78] }\nvelocity = { linear = [0.0, -1.0] }\n'
            'material = { law = "fixed_corotated", E = 1e4, nu = 0.3 }\n' + sink())
    for clock in CLOCKS:
        one = problem(2, FREE + ", start = 0.2, stop = 0.25", CLOCKS[clock], text)
        seen, state = run(one)
        assert not any(len(number) for t, _, number, _ in seen if t < 0.199)
        assert [len(body.id) for body in state.bodies] == [16, 0]
        assert state.t == pytest.approx(0.35, abs=0.0043)
        y = state.bodies[0].particles.x[:, 1].max()
        assert y == pytest.approx(TOP - 0.5 * SPACING - SPEED * (state.t - 0.2), abs=1e-6)


def test_a_run_whose_particles_have_all_left_takes_its_steps():
    one = problem(2, FREE + ", stop = 0.05", "steps = 300\nlongest = 0.01", sink())
    _, state = run(one)
    assert (state.step, len(state.bodies[0].id)) == (300, 0)
    one = problem(2, FREE + ", stop = 0.05", "steps = 300", sink(height=0.99))
    assert run(one)[1].step == 300


def test_a_sink_hides_no_particle_that_runs_away():
    one = problem(2, FREE + ", stop = 0.05", "dt = 0.004\nend = 0.3", sink(height=0.89))

    def throw(state, dt):
        state.bodies[0].particles.v[:, 1] = -40.0

    with pytest.raises(Unstable, match="crosses more than"):
        list(simulate(one, on_step=throw))


def test_energy_is_accounted_for():
    """What enters and leaves enters and leaves the account: that of blocks that fall one by one is
    their energy but for the error of the steps.
    """
    errors = []
    for cfl in (0.1, 0.05):
        one = problem(2, FREE + ", length = 0.25",
                      f"end = 0.65\ncfl = {cfl}\n" + gravity(), sink())
        *_, last = simulate(one)
        now = energy(last.state.bodies, one.gravity, one.inertia)
        account = last.state.account.start
        assert account.kinetic < 0.0 < now.kinetic      # they left faster than they came
        errors.append(account.sum - now.sum)
    assert abs(errors[0]) < 0.01 * account.sum
    assert errors[1] == pytest.approx(0.5 * errors[0], rel=0.05)        # of first order in dt


def test_the_monitor_still_ends_a_run_that_gains_energy():
    one = problem(2, FREE, "end = 0.7\n" + gravity(), sink())

    def blow(state, dt):
        state.bodies[0].particles.v[:] *= 1.05

    with pytest.raises(Unstable, match="energy exceeds"):
        list(simulate(one, on_step=blow))


def test_steps_shorten_when_a_fast_block_has_entered():
    """A fast source enters a slow scene whose steps are long."""
    text = ('\n[[body]]\nname = "rest"\ndensity = 1000.0\nshape = { type = "box", lower = '
            '[0.5, 0.1], upper = [0.6, 0.2] }\nmaterial = { law = "fixed_corotated", E = 1e4, '
            'nu = 0.3 }\nvelocity = { linear = [0.001, 0.0] }\n')
    one = problem(2, FREE + ", start = 0.2, stop = 0.21",
                  'integrator = "hot"\nlongest = 0.1\nend = 0.3\nlimits = { cfl = 0.6 }', text)
    seen, state = run(one)
    assert len(state.bodies[0].id) == 16
    times = np.array([0.0, *(t for t, *_ in seen)])
    later = times[:-1] > 0.2 * (1.0 - 1e-9)
    assert np.diff(times)[~later].max() > 0.09
    assert np.diff(times)[later].max() <= 0.5 * DX / SPEED * (1.0 + 1e-9)
    assert state.rejected == 0


@pytest.mark.parametrize("clock", ["explicit", "implicit"])
def test_bits_do_not_depend_on_threads(clock):
    def last():
        keys = CLOCKS[clock].replace("0.35", "0.3") + "\n" + gravity()
        return digest(run(problem(2, "", keys, sink()))[1].bodies)

    one, two = by_threads(last)
    assert one == two


def test_a_run_goes_on_from_any_state():
    """Also from those between an entry, a removal and a sort: the same bits."""
    make = lambda: problem(2, "", "end = 0.4\n" + gravity(), sink())  # noqa: E731
    _, whole = run(make())
    for stop in range(1, whole.step, 7):
        again, state = make(), None

        class Reached(Exception):
            pass

        def halt(at, dt, stop=stop):
            nonlocal state
            if at.step == stop:
                state = at
                raise Reached

        with pytest.raises(Reached):
            list(simulate(again, on_step=halt))
        *_, last = simulate(make(), state)
        assert digest(last.state.bodies) == digest(whole.bodies)


# parts

@pytest.mark.parametrize("transfer", ["mls", "apic", "flip"])
def test_rows_of_bodies(transfer):
    body = two_disks(Scheme(transfer=transfer)).bodies[1]
    n = len(body.id)
    which = np.arange(n) % 3 == 0
    some, rest = select_rows(body, which), select_rows(body, ~which)
    for part in (some, rest, select_rows(body, np.zeros(n, dtype=bool))):
        assert (part.particles.L is part.particles.C) == (transfer == "mls")
        for a, b in zip(part.particles, body.particles, strict=True):
            assert a.ndim == b.ndim
            assert a.shape[1:] == b.shape[1:]
    both = append(some, rest)
    assert (both.particles.L is both.particles.C) == (transfer == "mls")
    order = np.argsort(both.id)
    again = change_rows(both, lambda a: a[order])
    assert digest((again,)) == digest((body,))
    assert not np.shares_memory(some.particles.x, body.particles.x)


def test_blocks_of_a_run():
    assert blocks_until((0.0, 0.1), 0.3, np.inf) == 3           # at 0, 0.1, 0.2
    assert blocks_until((0.0, 0.1), 0.31, np.inf) == 4
    assert blocks_until((0.0, 0.1), np.inf, 0.3) == 4           # the last at the end
    assert blocks_until((0.2, 0.1), 0.5, 0.35) == 2
    with pytest.raises(ValueError, match="no block enters"):
        blocks_until((0.2, 0.1), np.inf, 0.1)


def test_the_particles_of_the_whole_run_are_known():
    one = problem(3, "stop = 0.2", "end = 0.5", sink(3))
    (whole,) = total_bodies(one)
    assert len(whole.id) == one.sources[0].particles == 2 * 64
    assert whole.particles.m.sum() == pytest.approx(2 * block_mass(3), rel=1e-12)


def test_what_makes_no_stream_is_refused():
    block = two_disks().bodies[0]
    v = np.array([0.0, -1.0])
    for keys, reason in (((0.0 * v, 0.1, 0.0, 2), "speed 0 m/s"),
                         ((v, 0.1, -1.0, 2), "a time >= 0"),
                         ((v, 0.1, 0.0, 0), "at least one block"),
                         ((v, 0.1, 0.0, 10**7), "particles in all")):
        with pytest.raises(ValueError, match=reason):
            ParticleSource(0, block, *keys)


@pytest.mark.parametrize(("keys", "reason"), [
    ({"budget": EnergyBudget()}, "no term for what enters"),
    ({"bodies": None}, "no particle is there"),
])
def test_parts_that_know_no_streams_refuse_them(keys, reason):
    one = two_disks()
    if keys.get("bodies", 1) is None:
        keys = {"bodies": tuple(select_rows(b, b.id < 0) for b in one.bodies)}
    sinks = (ParticleSink(half_space((0.0, 0.0), (0.0, 1.0))),)
    with pytest.raises(ValueError, match=reason):
        Problem(**{"bodies": one.bodies, "dx": one.dx, "clock": one.clock,
                   "gravity": one.gravity, "sinks": sinks} | keys)
