"""The parts of `mpm-ref rom play`: keys, braille, pace, and the lines below the picture."""

import os
import unicodedata
from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.cli.braille import Region, characters, dots, region_around
from mpm_ref.cli.pace import SPAN, RealTimePace
from mpm_ref.cli.play_keys import Keyboard, parse_keys, parse_script
from mpm_ref.cli.play_screen import Screen, gravity_text, status_line, warning_line
from mpm_ref.rom.study.play import PlayCommand, initial_load

# Keys.

@pytest.mark.parametrize(("data", "names", "rest"), [
    (b"", [], b""),
    (b" rqRQ", ["space", "r", "q", "r", "q"], b""),
    (b"\x1b[A\x1b[B\x1b[C\x1b[D", ["up", "down", "right", "left"], b""),
    (b"\x1bOA", ["up"], b""),               # of a terminal in application mode
    (b"xy\x00\xc3\xa9r", ["r"], b""),
    (b"\x1b[Zr", ["r"], b""),               # of another key
    (b"\x1b[1;2Q\x1b[1;2Rq", ["q"], b""),   # of Shift-F2 and Shift-F3
    (b"r\x1b[1;", ["r"], b"\x1b[1;"),
    (b"\x1br", ["r"], b""),                 # escape by itself
    (b"r\x1b", ["r"], b"\x1b"),
    (b"r\x1b[", ["r"], b"\x1b["),
])
def test_bytes_of_a_terminal_are_keys(data, names, rest):
    assert parse_keys(data) == (names, rest)


def test_a_keyboard_does_not_wait_and_joins_bytes_of_one_key():
    out, into = os.pipe()
    keys = Keyboard(out)
    try:
        assert keys.commands() == []
        os.write(into, b" \x1b[")
        assert keys.commands(5.0) == [PlayCommand.PAUSE]
        assert keys.commands() == []
        os.write(into, b"C")
        assert keys.commands(5.0) == [PlayCommand.TILT_RIGHT]
    finally:
        os.close(into)
    assert keys.commands() == [PlayCommand.QUIT]        # the terminal is gone
    os.close(out)


def test_a_script_is_in_order_of_time():
    assert parse_script("2 q, 0.5 right,1e0 space") == [
        (0.5, PlayCommand.TILT_RIGHT), (1.0, PlayCommand.PAUSE), (2.0, PlayCommand.QUIT)]


@pytest.mark.parametrize("text", ["", "right", "1 jump", "x right", "-1 up", "nan up", "1 up 2",
                                  "1 up,"])
def test_a_script_that_cannot_be_read_is_refused(text):
    with pytest.raises(ValueError, match="expected a time in s and a key"):
        parse_script(text)


# Braille.

UNIT = Region(np.zeros(2), np.ones(2))


def test_points_are_dots_where_they_are():
    region = Region(np.zeros(2), np.array([4.0, 4.0]))     # of 2 x 1 characters, a dot each m
    picture = dots(np.array([[0.5, 0.5], [3.5, 0.5], [0.5, 3.5], [2.5, 2.5]]), region, 2, 1)
    assert np.argwhere(picture).tolist() == [[0, 0], [1, 2], [3, 0], [3, 3]]
    assert characters(picture) == [chr(0x2800 + 0x01 + 0x40) + chr(0x2800 + 0x02 + 0x80)]


@pytest.mark.parametrize(("row", "column", "number"), [
    (0, 0, 1), (1, 0, 2), (2, 0, 3), (0, 1, 4), (1, 1, 5), (2, 1, 6), (3, 0, 7), (3, 1, 8)])
def test_each_dot_of_a_character_has_its_number_in_unicode(row, column, number):
    one = np.zeros((4, 2), dtype=bool)
    one[row, column] = True
    assert unicodedata.name(characters(one)[0]) == f"BRAILLE PATTERN DOTS-{number}"


def test_one_scale_holds_for_both_axes_with_the_region_in_the_middle():
    square = np.array([[0.12, 0.12], [0.87, 0.12], [0.12, 0.87], [0.87, 0.87]])
    rows, columns = (np.unique(a) for a in np.nonzero(dots(square, UNIT, 30, 5)))
    assert columns.tolist() == [22, 37]         # of 60, with 20 m^-1
    assert rows.tolist() == [2, 17]             # of 20


def test_points_outside_and_not_finite_have_no_dots():
    away = np.array([[5.0, 0.5], [0.5, -5.0], [np.nan, 0.5], [0.5, np.inf]])
    assert not dots(away, UNIT, 4, 4).any()


def test_the_ends_of_a_region_are_in_its_picture():
    assert dots(np.array([[0.0, 0.0], [1.0, 1.0]]), UNIT, 2, 1).sum() == 2
    rng = np.random.default_rng(0)
    for low, side in zip(rng.normal(size=(300, 2)), rng.random((300, 2)), strict=True):
        region = Region(low, low + side)
        assert dots(np.array(region), region, 40, 20).sum() == 2    # rounded as it may be


def test_a_region_grows_with_the_points_that_are_finite():
    region = region_around(np.array([[0.0, 0.0], [4.0, 1.0]]))
    assert (region.low.tolist(), region.high.tolist()) == ([-2.0, -3.5], [6.0, 4.5])
    larger = region.including(np.array([[7.0, 0.0], [np.nan, 9.0], [np.inf, 0.0]]))
    assert (larger.low.tolist(), larger.high.tolist()) == ([-2.0, -3.5], [7.0, 4.5])


# RealTimePace.

def test_steps_are_due_when_the_clock_has_passed_them():
    pace = RealTimePace(0.1, 0.0, 0.0)
    assert not pace.is_due(0.0)
    pace.allow(0.25)
    assert [pace.is_due(played) for played in (0.0, 0.1, 0.2)] == [True, True, False]
    pace.allow(0.05)
    assert pace.is_due(0.2)                 # the sum of ten roundings


def test_time_that_is_lacking_is_counted_and_not_made_up_for():
    pace = RealTimePace(0.1, 0.0, 0.0)
    pace.allow(1.0)
    pace.mark(1.0, 0.4)
    assert pace.behind == pytest.approx(0.6)
    assert not pace.is_due(0.4)
    pace.allow(0.1)
    pace.mark(1.1, 0.5)
    assert pace.behind == pytest.approx(0.6)
    pace.reset(9.0, 0.5)
    assert (pace.behind, pace.factor) == (0.0, None)


def test_the_factor_is_that_of_the_last_second():
    pace = RealTimePace(0.01, 0.0, 0.0)
    factors = []
    for k in range(1, 41):                  # a second at full speed, another at half
        played = 0.1 * min(k, 20) + 0.05 * max(k - 20, 0)
        pace.allow(0.1)
        pace.mark(0.1 * k, played)
        factors.append(pace.factor)
    assert factors[:9] == [None] * 9
    assert factors[19] == pytest.approx(1.0)
    assert factors[24] == pytest.approx(0.75, abs=0.06)
    assert factors[39] == pytest.approx(0.5)
    assert pace.behind == pytest.approx(1.0)


def test_a_step_that_takes_longer_than_a_second_has_a_factor():
    pace = RealTimePace(0.1, 0.0, 0.0)
    pace.mark(3.0 * SPAN, 0.1)
    assert pace.factor == pytest.approx(0.1 / 3.0)


# Lines.

def session(**changes):
    return SimpleNamespace(**{
        "state": SimpleNamespace(t=1.25), "load": initial_load((0.0, -9.81), (0, 1)),
        "is_paused": False, "is_running": True, "breakdown": ""} | changes)


def test_what_is_left_after_a_breakdown_does_not_change_the_view():
    square = np.array([[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    far = SimpleNamespace(positions=lambda xhat: xhat * square)
    one = session(shown=far)
    one.state.latent = SimpleNamespace(xhat=1.0)
    screen = Screen(one)
    before = screen.picture(20, 10)
    one.state.latent.xhat, one.breakdown = 500.0, "it broke"
    screen.picture(20, 10)
    one.state.latent.xhat, one.breakdown = 1.0, ""
    assert screen.picture(20, 10) == before
    one.state.latent.xhat = 500.0
    screen.picture(20, 10)
    one.state.latent.xhat = 1.0
    assert screen.picture(20, 10) != before


def test_the_line_has_time_gravity_and_pace():
    pace = SimpleNamespace(factor=None, behind=0.0)
    assert status_line(session(), pace) == "t = 1.25 s | gravity 9.81 m/s^2"
    pace.factor, pace.behind = 0.618, 2.04
    assert status_line(session(), pace) == (
        "t = 1.25 s | gravity 9.81 m/s^2 | 0.62 x real time | 2.0 s behind")
    pace.behind = 0.01
    assert status_line(session(), pace).endswith("| 0.62 x real time")
    stopped = session(is_paused=True, is_running=False)
    assert status_line(stopped, pace) == "t = 1.25 s | gravity 9.81 m/s^2 | paused"
    assert status_line(session(is_running=False), pace) == "t = 1.25 s | gravity 9.81 m/s^2"


def test_a_tilt_is_named_by_its_side():
    load = initial_load((0.0, -2.0), (0, 1))
    right = load.after(PlayCommand.TILT_RIGHT)
    assert gravity_text(right) == "gravity 2 m/s^2, 10 degrees to the right"
    for _ in range(3):
        right = right.after(PlayCommand.TILT_LEFT)
    assert gravity_text(right) == "gravity 2 m/s^2, 20 degrees to the left"


def test_a_breakdown_stands_before_a_warning():
    assert warning_line(session(), "") == ""
    assert warning_line(session(), "far away") == "warning: far away"
    assert warning_line(session(breakdown="it broke"), "far away") == "it broke; press r to restart"
