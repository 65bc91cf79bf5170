"""A session of `mpm-ref rom play`: its load, its commands, its steps and its end."""

import numpy as np
import pytest
from small_studies import modelled, session_of

from mpm_ref.rom.study import play, reduce
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.play import (
    PART,
    SHOWN,
    TILT,
    WITHOUT,
    PlayCommand,
    initial_load,
    middle_parameters,
    play_session,
)
from mpm_ref.rom.study.run import RunOptions, ldm_run
from mpm_ref.rom.study.study import load

G = 2.5


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with a study, its runs and its map."""
    return modelled(tmp_path_factory.mktemp("made"))


@pytest.fixture
def session(made):
    return session_of(made, G)


def obey(session, *commands):
    for command in commands:
        session.obey(command)
    return session.run.stepper.gravity


# Load.

def test_gravity_is_tilted_and_strengthened_in_the_plane_of_the_view():
    start = initial_load((0.5, 2.0, -8.0), (1, 2))
    np.testing.assert_allclose(start.gravity, (0.5, 2.0, -8.0), rtol=1e-15)
    tilted = start.after(PlayCommand.TILT_RIGHT)
    assert tilted.gravity[0] == 0.5
    assert np.hypot(*tilted.gravity[1:]) == pytest.approx(np.hypot(2.0, 8.0))
    before, after = (np.arctan2(one.gravity[1], -one.gravity[2]) for one in (start, tilted))
    assert after - before == pytest.approx(TILT)
    np.testing.assert_allclose(tilted.after(PlayCommand.TILT_LEFT).gravity, start.gravity)
    stronger = start.after(PlayCommand.STRENGTHEN)
    np.testing.assert_allclose(stronger.gravity[1:], (1.0 + PART) * start.gravity[1:])
    np.testing.assert_allclose(stronger.after(PlayCommand.WEAKEN).gravity, start.gravity)


def test_gravity_begins_downwards_where_there_was_none_and_does_not_turn_round():
    nothing = initial_load((0.0, 0.0), (0, 1))
    assert nothing.after(PlayCommand.WEAKEN).strength == 0.0
    np.testing.assert_allclose(nothing.after(PlayCommand.STRENGTHEN).gravity, (0.0, -WITHOUT))


@pytest.mark.parametrize("command", [PlayCommand.PAUSE, PlayCommand.RESTART, PlayCommand.QUIT])
def test_other_commands_leave_gravity(command):
    start = initial_load((0.0, -3.0), (0, 1))
    assert start.after(command) == start


# Session.

def test_a_session_without_commands_is_the_reduced_run_and_goes_on(made, session):
    bars = load(made / "bars.toml")
    model, full = reduce.load(made / "map.npz", bars), ldm_full_model(bars.scene([G]))
    for k, state in enumerate(ldm_run(full, model.field, RunOptions(), model.rest).states()):
        assert session.state.t == k * session.dt
        np.testing.assert_array_equal(session.state.latent.xhat, state.latent.xhat)
        session.step()
    assert session.steps == full.problem.clock.steps + 1
    assert session.played == pytest.approx(session.steps * session.dt)


def test_a_command_changes_the_motion_from_the_next_step_on(session):
    np.testing.assert_allclose(session.run.stepper.gravity, (0.0, -G))
    for _ in range(3):
        session.step()
    start = session.state
    session.step()
    plain = session.state.latent.vhat
    session.state = start
    g = obey(session, PlayCommand.TILT_RIGHT)
    np.testing.assert_allclose(g, (G * np.sin(TILT), -G * np.cos(TILT)))
    session.step()
    assert np.abs(session.state.latent.vhat - plain).max() > 1e-3 * np.abs(plain).max()


def test_a_restart_is_the_same_run_again_with_its_own_gravity(session):
    def states():
        for _ in range(4):
            session.step()
            yield session.state.latent.xhat

    first = list(states())
    obey(session, PlayCommand.STRENGTHEN, PlayCommand.PAUSE)
    np.testing.assert_allclose(obey(session, PlayCommand.RESTART), (0.0, -G))
    assert (session.state.t, session.is_running) == (0.0, True)
    np.testing.assert_array_equal(list(states()), first)
    assert session.steps == 8


def test_a_session_pauses_goes_on_and_ends(session):
    obey(session, PlayCommand.PAUSE)
    assert not session.is_running
    obey(session, PlayCommand.PAUSE)
    assert session.is_running
    obey(session, PlayCommand.QUIT)
    assert session.has_ended
    assert not session.is_running


def test_a_step_that_breaks_down_leaves_its_sentence_and_the_state_before(session):
    session.step()
    before = session.state
    session.run.stepper.gravity = np.array([0.0, -1e9])
    for _ in range(3):
        if session.is_running:
            before = session.state
            session.step()
    assert session.breakdown.startswith(f"the reduced run broke down at t = {before.t:.6g} s: ")
    assert not session.is_running
    assert session.state is before
    obey(session, PlayCommand.RESTART)
    assert (session.breakdown, session.is_running) == ("", True)


def test_coordinates_out_of_the_range_of_training_are_named(session):
    session.step()
    assert session.check() == ""
    latent = session.state.latent
    far = latent._replace(xhat=latent.xhat + 10.0)
    session.state = session.state._replace(latent=far)
    assert "times as far from the training runs" in session.check()


def test_a_state_without_a_body_breaks_the_run_down(session):
    latent = session.state.latent
    session.state = session.state._replace(latent=latent._replace(xhat=1e6 + latent.xhat))
    session.check()
    assert session.breakdown.startswith("the reduced run broke down at t = 0 s: no body is left, ")


def test_a_step_to_warm_up_does_not_count(session):
    start = session.state
    session.warm_up()
    assert (session.steps, session.state.t) == (0, 0.0)
    np.testing.assert_array_equal(session.state.latent.xhat, start.latent.xhat)


def test_some_points_of_the_body_are_shown_where_they_are(made, session, monkeypatch):
    model = reduce.load(made / "map.npz", load(made / "bars.toml"))
    full = ldm_full_model(load(made / "bars.toml").scene([G]))
    xhat = np.linspace(-0.1, 0.1, model.field.r)
    x = session.shown.positions(xhat)
    np.testing.assert_allclose(x, model.field.place(full.X, xhat), atol=1e-14)
    assert (len(x), session.shown.count) == (64, 64)
    assert len(x) <= SHOWN
    monkeypatch.setattr(play, "SHOWN", 10)
    some = play_session(load(made / "bars.toml"), model, [G], (0, 1))[0].shown
    assert (len(some.points), some.count) == (10, 64)
    np.testing.assert_allclose(some.positions(xhat), x[::7], atol=1e-14)


def test_parameters_are_the_middle_of_the_training(made):
    bars = load(made / "bars.toml")
    low, high = bars.mu[list(bars.train), 0].min(), bars.mu[list(bars.train), 0].max()
    assert middle_parameters(bars) == {"g": 0.5 * (low + high)}
