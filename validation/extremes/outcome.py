"""How a run ended, as a word for tables and the sentence that it said."""

from typing import NamedTuple

from mpm_ref.core.grid import OutOfRange
from mpm_ref.monitor import Unstable
from mpm_ref.simulate import simulate
from mpm_ref.timestep import TooLarge

# What a run says when it stops, by the beginning of its reason: the word for it.
REASONS = {"energy": "energy", "J is": "J", "a particle crosses": "CFL",
           "a position or velocity": "not finite", "no stable": "no bound"}
FINISHED, REFUSED, OUT_OF_RANGE, UNFIT = "finished", "refused", "out of range", "unfit"
STOPS = (*REASONS.values(), REFUSED)       # how a run should end that cannot go on


class Outcome(NamedTuple):
    """The end of a run. UNFIT is a state that no run accepts."""

    kind: str           # FINISHED, a word of STOPS, OUT_OF_RANGE or UNFIT
    step: int           # reached
    said: str           # the sentence of the error, "" if it finished


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
        return Outcome(REFUSED, reached[0], str(refusal))
    except OutOfRange as lost:
        return Outcome(OUT_OF_RANGE, reached[0], str(lost))
    except ValueError as misfit:
        return Outcome(UNFIT, reached[0], str(misfit))
    except Unstable as stop:
        words = (word for start, word in REASONS.items() if stop.reason.startswith(start))
        kind = next(words, OUT_OF_RANGE)        # else the grid could not follow, and says why
        return Outcome(kind, stop.step, str(stop))
    return Outcome(FINISHED, reached[0], "")
