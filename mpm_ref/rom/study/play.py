"""A reduced run that is played: it goes on without an end, under a gravity that commands change.

The load of such a run is known only while it runs, so that nothing can be computed in advance. A
`PlaySession` obeys commands, makes steps, and checks its state as often as it is shown; it knows no
clock and no terminal.
"""

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from ..extrapolation import BEYOND, evenly
from ..step import BREAKDOWNS
from .display import tabulated
from .monitor import MESSAGES
from .record import supported_model
from .run import RunState

SHOWN = 2000                # points of the body that are drawn, at most
TILT = np.radians(10.0)     # of gravity, by a command
PART = 0.1                  # of the scene's gravity, by which a command changes its strength
WITHOUT = 1.0               # ... where the scene has none [m/s^2]


class PlayCommand(Enum):
    """A command to a session."""

    TILT_LEFT = "tilt to the left"
    TILT_RIGHT = "tilt to the right"
    STRENGTHEN = "strengthen"
    WEAKEN = "weaken"
    PAUSE = "pause"         # or go on
    RESTART = "restart"
    QUIT = "quit"


class Load(NamedTuple):
    """Gravity by its strength and tilt in the plane of a view; across it, gravity stays."""

    initial: np.ndarray     # (d,) of the scene [m/s^2]
    view: tuple             # (right, up), numbers of two axes
    strength: float         # in the plane [m/s^2]
    tilt: float             # from downwards to the right [rad]

    @property
    def gravity(self):
        """The gravity (d,) [m/s^2]."""
        right, up = self.view
        g = self.initial.copy()
        g[right] = self.strength * np.sin(self.tilt)
        g[up] = -self.strength * np.cos(self.tilt)
        return g

    def after(self, command):
        """Return the `Load` after a `PlayCommand`; the strength is never below 0."""
        change = PART * initial_load(self.initial, self.view).strength or WITHOUT
        match command:
            case PlayCommand.TILT_LEFT:
                return self._replace(tilt=self.tilt - TILT)
            case PlayCommand.TILT_RIGHT:
                return self._replace(tilt=self.tilt + TILT)
            case PlayCommand.STRENGTHEN:
                return self._replace(strength=self.strength + change)
            case PlayCommand.WEAKEN:
                return self._replace(strength=max(self.strength - change, 0.0))
        return self


def initial_load(gravity, view):
    """Return the `Load` of a scene's gravity (d,) [m/s^2] in the plane of a view (right, up); one
    of strength 0 points downwards.
    """
    g = np.array(gravity, dtype=float)
    right, up = view
    strength = float(np.hypot(g[right], g[up]))
    return Load(g, tuple(view), strength, float(np.arctan2(g[right], -g[up])) if strength else 0.0)


class ShownPoints(NamedTuple):
    """An even part of a body's points, to be drawn."""

    field: object           # of the run, `tabulated` at these points
    points: np.ndarray      # as the field takes them
    count: int              # of all points of the body

    def positions(self, xhat):
        """Return their positions (n, d) [m] at latent coordinates xhat (r,)."""
        return self.field.place(self.points, xhat)


@dataclass
class PlaySession:
    """A reduced run that obeys commands; it starts when it is made."""

    run: object             # `ReducedRun`
    monitor: object         # of `monitor`
    load: Load
    shown: ShownPoints
    steps: int = 0          # made in all, over restarts
    is_paused: bool = False
    has_ended: bool = False
    breakdown: str = ""     # the sentence about the breakdown of the run, which then stands still

    def __post_init__(self):
        self._start = self.run.find_start()
        self.restart()

    @property
    def is_running(self):
        """Return whether the run takes steps now."""
        return not (self.is_paused or self.has_ended or self.breakdown)

    @property
    def dt(self):
        """The length of a step [s]."""
        return self.run.dt

    @property
    def played(self):
        """The time that was simulated in all, over restarts [s]."""
        return self.steps * self.dt

    def restart(self):
        """Go back to the start of the run, its gravity included."""
        self.load = initial_load(self.load.initial, self.load.view)
        self.run.stepper.gravity = self.load.gravity
        self._sampler, self._step = self.run.make_sampler(self._start.xhat), 0
        self.state, self.breakdown, self.is_paused = RunState(0.0, self._start), "", False

    def obey(self, command):
        """Perform a `PlayCommand`."""
        match command:
            case PlayCommand.QUIT:
                self.has_ended = True
            case PlayCommand.RESTART:
                self.restart()
            case PlayCommand.PAUSE:
                self.is_paused = not self.is_paused
            case _:
                self.load = self.load.after(command)
                self.run.stepper.gravity = self.load.gravity

    def step(self):
        """Make a step under the present gravity; where the run breaks down, keep the state before
        it and the sentence.
        """
        t, latent = self.state.t, self.state.latent
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                samples = self._sampler(t, latent)
                latent, report = self.run.stepper.step(latent, samples.points, t, self.dt,
                                                       samples.weights)
        except BREAKDOWNS as fault:
            self._break_down(getattr(fault, "reason", fault))
            return
        self._step += 1
        self.steps += 1
        self.state = RunState(self._step * self.dt, latent, report, samples)

    def check(self):
        """Check the present state, and break the run down where it has no body; return the sentence
        about latent coordinates beyond those of the training, or "". Samples, and steps since the
        last check, are not judged.
        """
        check = self.monitor.check(RunState(self.state.t, self.state.latent))
        if check.nonsense and not self.breakdown:
            self._break_down(f"no body is left, {check.nonsense}")
        return MESSAGES["beyond"].format(**check._asdict()) if check.beyond > BEYOND else ""

    def warm_up(self):
        """Make a step that does not count, so that kernels are compiled and read; then restart."""
        self.step()
        self.check()
        self.restart()
        self.steps = 0

    def _break_down(self, reason):
        self.breakdown = f"the reduced run broke down at t = {self.state.t:.6g} s: {reason}"


def play_session(study, model, mu, view):
    """Return the `PlaySession` of a study's reduced run with parameters mu, its gravity in the
    plane of a view (right, up), and the warnings before it. Raises ValueError as `record.recording`
    does.
    """
    full, method = supported_model(study, mu), study.method
    field = method.field_of_run(model.field, full, mu)
    facts = {"parameters": dict(zip(study.names, mu, strict=True))}
    plan = method.recording(study, full, field, model, facts, None)
    points = evenly(method.point_names(full), SHOWN)
    shown = ShownPoints(tabulated(field, points), points, len(full.X))
    load = initial_load(plan.run.stepper.gravity, view)
    return PlaySession(plan.run, plan.monitor, load, shown), plan.warnings


def middle_parameters(study):
    """Return {name: value} of the middle of the range of each parameter in the training runs."""
    trained = study.mu[list(study.train)]
    middle = 0.5 * (trained.min(axis=0) + trained.max(axis=0))
    return dict(zip(study.names, middle.tolist(), strict=True))
