"""The end of an explicit run: its kind for tables, and the sentence of its error."""

from typing import NamedTuple

from mpm_ref.core.grid import OutOfRange
from mpm_ref.monitor import Unstable
from mpm_ref.simulate import simulate
from mpm_ref.timestep import TooLarge

# The kind of an end by the beginning of the monitor's reason.
REASONS = {"energy": "energy", "J is": "J", "a particle crosses": "CFL",
           "a position or velocity": "not finite", "no stable": "no bound"}
FINISHED, REFUSED, OUT_OF_RANGE, UNFIT = "finished", "refused", "out of range", "unfit"
STOPS = (*REASONS.values(), REFUSED)       # proper ends of a run that cannot go on


class ExplicitOutcome(NamedTuple):
    """The end of a run. UNFIT is a state that no run accepts."""

    kind: str           # FINISHED, one of STOPS, OUT_OF_RANGE or UNFIT
    step: int           # the last one
    message: str        # of the error, "" if it finished


def outcome(problem, on_step=None):
    """Run a problem to its end or to its error; on_step(state, dt) is called after every step."""
    last = [0]

    def count(state, dt):
        last[0] = state.step
        if on_step is not None:
            on_step(state, dt)

    try:
        for _ in simulate(problem, on_step=count):
            pass
    except TooLarge as refusal:
        return ExplicitOutcome(REFUSED, last[0], str(refusal))
    except OutOfRange as error:
        return ExplicitOutcome(OUT_OF_RANGE, last[0], str(error))
    except ValueError as error:
        return ExplicitOutcome(UNFIT, last[0], str(error))
    except Unstable as stop:
        kinds = (kind for start, kind in REASONS.items() if stop.reason.startswith(start))
        kind = next(kinds, OUT_OF_RANGE)        # else the grid could not follow, and says why
        return ExplicitOutcome(kind, stop.step, str(stop))
    return ExplicitOutcome(FINISHED, last[0], "")
