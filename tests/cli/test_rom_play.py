"""`mpm-ref rom play`: sessions without a terminal and on one, and what is refused."""

import json
import os
import pty
import termios
from types import SimpleNamespace

import numpy as np
import pytest
from command_line import assert_told, mpm_ref
from rich.console import Console
from small_studies import modelled, session_of

from mpm_ref.cli import play_keys, play_terminal
from mpm_ref.cli.play_loop import FRAME, PlayedTime, played_time
from mpm_ref.cli.play_terminal import play_on_terminal
from mpm_ref.cli.rom_play import range_warnings, side_view
from mpm_ref.rom.study.play import PlayCommand
from mpm_ref.rom.study.study import load

DT = 0.01       # of the study's steps [s]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folder with a study, its runs and its map."""
    return modelled(tmp_path_factory.mktemp("made"))


@pytest.fixture
def session(made):
    return session_of(made)


def play(made, *options, map="map.npz"):
    return mpm_ref("rom", "play", made / "bars.toml", "--map", made / map, *options)


def facts_of(made, *options):
    done = play(made, "--json", *options)
    return done, json.loads(done.stdout)


# Without a terminal.

def test_a_session_plays_for_some_seconds_and_says_how_fast(made):
    done, found = facts_of(made, "--seconds", 0.5, "--set", "g=2.5")
    assert done.exit_code == 0, done.output
    assert (found["steps"], found["played"]) == (50, pytest.approx(0.5))
    assert found["real_time_factor"] == pytest.approx(found["played"] / found["wall"])
    assert found["slowest_second"] == pytest.approx(found["real_time_factor"])
    assert (found["points"], found["points_shown"], found["pictures"]) == (64, 64, 10)
    np.testing.assert_allclose(found["gravity"], (0.0, -2.5))
    line = play(made, "--seconds", 0.5).stdout
    assert line.startswith("bars, modes r = 3, 64 points: 50 steps, 0.5 s played in ")
    assert " x real time, in the slowest second " in line


def test_keys_of_a_script_are_pressed_at_their_times(made):
    _, found = facts_of(made, "--seconds", 0.5, "--keys", "0.1 right, 0.1 space, 0.3 space")
    assert found["steps"] == 30
    assert found["gravity"][0] > 0.0
    _, found = facts_of(made, "--seconds", 0.5, "--keys", "0.1 right, 0.2 r")
    assert (found["steps"], found["t"]) == (50, pytest.approx(0.3))
    assert found["gravity"][0] == 0.0
    _, found = facts_of(made, "--seconds", 0.5, "--keys", "0.2 q")
    assert found["steps"] == 20


def test_parameters_that_are_not_given_are_the_middle_of_the_training(made):
    bars = load(made / "bars.toml")
    _, found = facts_of(made, "--seconds", 0.05)
    trained = bars.mu[list(bars.train)]
    assert found["gravity"][1] == pytest.approx(-0.5 * (trained.min() + trained.max()))


def test_a_session_that_left_the_training_says_so(made):
    done, found = facts_of(made, "--seconds", 0.5, "--set", "g=9")
    assert done.exit_code == 0
    outside, beyond = done.stderr.splitlines()
    assert outside.startswith("mpm-ref: warning: g = 9 lies outside the range")
    assert 0 < found["pictures_beyond_training"] <= 10
    assert f"in {found['pictures_beyond_training']} of 10 pictures the latent" in beyond


def test_a_session_that_broke_down_has_status_3(made):
    done, found = facts_of(made, "--seconds", 0.3, "--set", "g=1e4")
    assert done.exit_code == 3
    assert found["breakdown"].startswith("the reduced run broke down at t = ")
    assert found["breakdown"] in done.stderr
    assert found["steps"] < 30


def test_a_breakdown_is_remembered_after_a_restart(made):
    done, found = facts_of(made, "--seconds", 0.3, "--set", "g=1e4", "--keys", "0.25 r, 0.25 space")
    assert done.exit_code == 3
    assert found["breakdown"] in done.stderr


@pytest.mark.parametrize(("options", "words"), [
    ((), "keys and pictures need a terminal, and there is none here; play there, or add --seconds"),
    (("--keys", "1 up"), "--keys without --seconds: expected a session without a terminal"),
    (("--json",), "--json without --seconds"),
    (("--seconds", 0), "--seconds 0: expected a finite number > 0"),
    (("--seconds", "nan"), "--seconds nan: expected a finite number > 0"),
    (("--seconds", 1, "--keys", "1 jump"), "--keys '1 jump': expected a time in s and a key"),
    (("--seconds", 1, "--set", "h=1"), "one of the study's parameters g"),
    (("--seconds", 1, "--view", "xx"), "--view xx: expected two different axes"),
    (("--seconds", 1, "--view", "xz"), "--view xz: the scene has 2 dimensions, expected xy or yx"),
])
def test_what_cannot_be_played_is_said(made, options, words):
    assert_told(play(made, *options), 2, words)


def test_a_map_is_needed(made):
    assert_told(play(made, "--seconds", 1, map="none.npz"), 2, "mpm-ref rom train ")


def test_a_system_without_posix_terminals_is_refused(made, monkeypatch):
    monkeypatch.setattr(play_keys, "termios", None)
    assert_told(play(made), 2, "keys are read on POSIX systems alone, not on ")


def test_a_terminal_without_braille_is_refused(monkeypatch):
    terminal = SimpleNamespace(isatty=lambda: True, encoding="latin-1")
    monkeypatch.setattr(play_keys, "sys", SimpleNamespace(stdin=terminal, stdout=terminal))
    with pytest.raises(ValueError, match="encoding is latin-1: expected UTF-8"):
        play_keys.require_terminal()


def test_the_side_is_that_on_which_gravity_points_downwards():
    assert side_view(SimpleNamespace(gravity=np.array([0.0, 0.0, -9.8]), dim=3), None) == (0, 2)
    assert side_view(SimpleNamespace(gravity=np.array([0.0, 0.0, -9.8]), dim=3), "yz") == (1, 2)


def test_the_slowest_second_is_that_of_twenty_frames():
    wall = np.concatenate([np.full(30, 0.01), np.full(20, 0.1), np.full(30, 0.01)])
    times = wall.cumsum(), 0.5 * wall.cumsum(), 0.05 * np.arange(1, 81)
    marks = [(0.0, 0.0, 0.0), *zip(*times, strict=True)]
    found = played_time(marks, ["", "far", "far"], "it broke")
    assert found.played == pytest.approx(4.0)
    assert found.factor == pytest.approx(4.0 / 2.6)
    assert found.cpu == pytest.approx(1.3)
    assert found.slowest == pytest.approx(0.5)
    assert (found.pictures, found.beyond) == (3, 2)
    assert played_time([(0.0, 0.0, 0.0)], [], "") == (0.0, 0.0, 0.0, 0.0, 0, 0, "")
    assert list(range_warnings(PlayedTime(1.0, 1.0, 1.0, 1.0, 20, 0, ""))) == []


# On a terminal.

class Clock:
    """A clock that each look and each wait for keys puts forward."""

    def __init__(self, look):
        self.look, self.time = look, 0.0

    def __call__(self):
        self.time += self.look
        return self.time


class ScriptedKeys:
    """Keys that are pressed at times of a clock; to wait for them passes its time."""

    def __init__(self, clock, *presses):
        self.clock, self.presses = clock, list(presses)

    def commands(self, seconds):
        self.clock.time += max(seconds, 0.0)
        pressed = [command for t, command in self.presses if t <= self.clock.time]
        self.presses = [one for one in self.presses if one[0] > self.clock.time]
        return pressed


def play_with(session, monkeypatch, look, *presses):
    clock = Clock(look)
    monkeypatch.setattr(play_terminal, "perf_counter", clock)
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        console = Console(file=nowhere, force_terminal=True, width=60, height=20)
        play_on_terminal(session, ScriptedKeys(clock, *presses), "Bars", console)
    return clock


def test_a_run_on_a_terminal_waits_for_the_clock(session, monkeypatch):
    clock = play_with(session, monkeypatch, 1e-5, (1.0, PlayCommand.QUIT))
    assert session.played == pytest.approx(clock.time, abs=2.0 * FRAME + DT)


def test_a_run_that_is_slower_than_the_clock_still_goes_on(session, monkeypatch):
    """With each look at the clock 0.2 s pass: a frame has one step."""
    clock = play_with(session, monkeypatch, 0.2, (10.0, PlayCommand.QUIT))
    assert 5 <= session.steps <= 20
    assert session.played < 0.1 * clock.time


def test_time_does_not_pass_in_a_pause(session, monkeypatch):
    clock = play_with(session, monkeypatch, 1e-5, (0.5, PlayCommand.PAUSE),
                      (1.5, PlayCommand.PAUSE), (2.0, PlayCommand.QUIT))
    assert session.played == pytest.approx(clock.time - 1.0, abs=4.0 * FRAME)


def test_a_keyboard_gives_the_terminal_back_as_it_was(monkeypatch):
    controller, terminal = pty.openpty()
    monkeypatch.setattr(play_keys.sys, "stdin", SimpleNamespace(fileno=lambda: terminal))
    before = termios.tcgetattr(terminal)
    with play_keys.keyboard() as keys:
        assert not termios.tcgetattr(terminal)[3] & termios.ICANON
        os.write(controller, b"\x1b[D")
        assert keys.commands(5.0) == [PlayCommand.TILT_LEFT]
    assert termios.tcgetattr(terminal) == before
    os.close(controller)
    os.close(terminal)
