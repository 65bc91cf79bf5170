"""How a run ended, as a word for tables and the sentence that it said."""

from typing import NamedTuple

from mpm_ref.core.grid import OutOfRange
from mpm_ref.monitor import Unstable
from mpm_ref.simulate import simulate
from mpm_ref.timestep import TooLarge

# What a run says when it stops, by the beginning of its reason: the word for it.
REASONS = {"energy": "energy", "J is": "J", "a particle crosses": "CFL", "a velocity": "not finite"}
FINISHED, REFUSED, OUT_OF_RANGE = "finished", "refused", "out of range"
STOPS = (*REASONS.values(), REFUSED)       # how a run should end that cannot go on


class Outcome(NamedTuple):
    """The end of a run."""

    kind: str           # FINISHED, a word of STOPS, or OUT_OF_RANGE
    step: int           # reached
    said: str           # the sentence of the error, "" if it finished
    particle: int       # that was named, -1 if none was


def outcome(problem, on_step=None):
    """Run a problem to its end or to its error; on_step(state, dt) after every step."""
    reached = [0]

    def count(state, dt):
        reached[0] = state.step
        if on_step is not None:
            on_step(state, dt)

    try:
        for _ in simulate(problem, on_step=count):
            pass
    except TooLarge as refusal:
        return Outcome(REFUSED, reached[0], str(refusal), -1)
    except OutOfRange as lost:
        return Outcome(OUT_OF_RANGE, reached[0], str(lost), -1)
    except Unstable as stop:
        kind = next(word for start, word in REASONS.items() if stop.reason.startswith(start))
        return Outcome(kind, stop.step, str(stop), stop.particle)
    return Outcome(FINISHED, reached[0], "", -1)
