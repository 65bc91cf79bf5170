"""Implement `mpm-ref rom play`: a reduced run in the terminal, whose gravity the keys change."""

from math import isfinite
from typing import Annotated

import typer

from .. import plotting
from ..rom.study import reduce
from ..rom.study.play import middle_parameters, play_session
from ..store.text import counted
from .errors import UNSTABLE, end, options
from .options import Json, MapFile, StudyName, load_map, open_study, parse_assignments
from .play_keys import keyboard, parse_script, require_terminal
from .play_loop import play_script
from .play_terminal import play_on_terminal
from .terminal import as_json, compiling, warn
from .view import View, view_axes


def play(
    name: StudyName,
    values: Annotated[list[str] | None, typer.Option(
        "--set", help="NAME=VALUE for a parameter of the study (default: the middle of its range "
        "in the training runs); repeat it for each one.")] = None,
    map_file: MapFile = None,
    view: View = None,
    seconds: Annotated[float | None, typer.Option(
        help="Play this long without a terminal and as fast as possible, then print the real-time "
        "factor.")] = None,
    keys: Annotated[str | None, typer.Option(
        help="Keys to press with --seconds, each after a time, such as '0.5 right, 1 up, 2 "
        "space'.")] = None,
    json: Json = False,
):
    """Play the reduced model of a study in the terminal.

    Arrow keys tilt gravity (left, right) and change its strength (up, down), space pauses, r
    restarts, q quits. The body is shown from the side at true speed, without an end. Nothing is
    written. Exit status: 0 success, 2 bad input, 3 a run with --seconds broke down, 130 Ctrl-C.
    """
    with open_study(name) as study:
        with options():
            script = parsed_script(seconds, keys, json)
            if seconds is None:
                require_terminal()
            mu = start_parameters(study, values or [])
            _, model = load_map(name, study, map_file)
            axes = side_view(study.scene(mu), view)
            session, warnings = play_session(study, model, mu, axes)
        warn([*study.range_warnings(mu), *warnings])
        with compiling():
            session.warm_up()
        if seconds is None:
            with keyboard() as pressed:
                play_on_terminal(session, pressed, title_of(study, session))
            return
        time = play_script(session, script, seconds)
        what = description(study, model, session)
        print(as_json(facts(what, session, time)) if json else summary(what, session, time))
        if time.breakdown:
            end(time.breakdown, UNSTABLE)
        warn(range_warnings(time))


def parsed_script(seconds, keys, json):
    """Return the `TimedCommand`s of the options for a session without a terminal. Raises
    ValueError for a time that is none, and for the others without it.
    """
    if seconds is None:
        for option in [name for name, given in (("--keys", keys), ("--json", json)) if given]:
            raise ValueError(f"{option} without --seconds: expected a session without a terminal; "
                             "add --seconds S")
        return []
    if not (isfinite(seconds) and seconds > 0.0):
        raise ValueError(f"--seconds {seconds:g}: expected a finite number > 0")
    return parse_script(keys) if keys else []


def start_parameters(study, texts):
    """Return the parameters [..] of texts NAME=VALUE; the others are the middle of their ranges.
    Raises SceneError.
    """
    given = parse_assignments(texts)
    names = {text.partition("=")[0] for text in given}
    return study.parse_parameters([*given, *(
        f"{name}={value!r}" for name, value in middle_parameters(study).items()
        if name not in names)])


def side_view(scene, view):
    """Return the axes (right, up) of a view of a scene, by default that of its pictures. Raises
    ValueError for an axis that the scene has not.
    """
    axes = view_axes(view) or plotting.view_of(scene)
    if max(axes) >= scene.dim:
        raise ValueError(f"--view {view}: the scene has {scene.dim} dimensions, expected xy or yx")
    return axes


def title_of(study, session):
    """Return the title of a session's picture."""
    shown = session.shown
    return (f"{study.tables.title or study.path.stem}: {len(shown.points)} of "
            f"{counted(shown.count, 'point')}")


def description(study, model, session):
    """Return what was played as plain values."""
    return {"study": study.path.stem, "kind": reduce.kind_of(model), "r": model.field.r,
            "points": session.shown.count, "points_shown": len(session.shown.points),
            "dt": session.dt}


def facts(what, session, time):
    """Return a session of this description that was played without a terminal, as plain values."""
    return what | {
        "steps": session.steps, "played": time.played, "wall": time.wall, "cpu": time.cpu,
        "real_time_factor": time.factor, "slowest_second": time.slowest,
        "pictures": time.pictures, "pictures_beyond_training": time.beyond,
        "t": session.state.t, "gravity": session.load.gravity.tolist(),
        "breakdown": time.breakdown or None}


def summary(what, session, time):
    """Return the line about a session of this description without a terminal."""
    return (f"{what['study']}, {what['kind']} r = {what['r']}, {counted(what['points'], 'point')}: "
            f"{counted(session.steps, 'step')}, {time.played:.4g} s played in {time.wall:.3g} s "
            f"({time.cpu:.3g} s of CPU time), {time.factor:.3g} x real time, in the slowest second "
            f"{time.slowest:.3g} x")


def range_warnings(time):
    """Yield the warning about latent coordinates beyond the training in a `PlayedTime`."""
    if time.beyond:
        yield (f"in {time.beyond} of {counted(time.pictures, 'picture')} the latent coordinates "
               "were out of the range of training: the motion there is not to be trusted")
