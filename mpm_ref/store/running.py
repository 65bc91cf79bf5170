"""A run on files: `run(problem, "out.h5")`, to be continued bit for bit after whatever ended it."""

from dataclasses import dataclass, field, replace
from pathlib import Path

from ..monitor import check
from ..simulate import State, ended, rebound
from . import Fields, checkpoint, create, reopen, require_run
from .atomic import require_place
from .manifest import manifest, unsolved
from .results import BadResults, Results
from .session import AT_LIMIT, FINISHED, Session, Watch, checkpoint_of


class Refused(ValueError):
    """A run that was asked for would destroy, cannot find, or does not fit an earlier one."""


@dataclass(frozen=True)
class Options:
    """How a run is recorded.

    steps: stop after this many steps in all, to be continued later; checkpoint_every: steps between
    checkpoints, None for one a minute; fields: what is stored (`Fields`), None for the usual, or
    what a resumed run began with, and nothing else is taken for that; resume: go on from the
    checkpoint beside the results, or begin where there is none; overwrite: replace the results of
    an earlier run; seed: of the scene, for the manifest; facts: what else that is to say, plain
    values by name.
    """

    steps: int | None = None
    checkpoint_every: int | None = None
    fields: Fields | None = None
    resume: bool = False
    overwrite: bool = False
    seed: int | None = None
    facts: dict = field(default_factory=dict)

    def __post_init__(self):
        for name in ("steps", "checkpoint_every"):
            if getattr(self, name) is not None and getattr(self, name) < 1:
                raise ValueError(f"{name} = {getattr(self, name)}: expected a number of steps >= 1")
        if self.resume and self.overwrite:
            raise ValueError("resume and overwrite: give at most one of the two")


@dataclass(frozen=True)
class Outcome:
    """How a run ended: why ("finished", "step limit", "interrupted", "terminated"), the `State` it
    ended with, frames stored, whether it went on with the very code that began it, and how many
    implicit steps of all its parts were not solved, which unstable = "allow" lets pass.
    """

    why: str
    state: object
    frames: int
    same_code: bool
    unsolved: int


def run(problem, out, options=None, watch=None):
    """Run a `Problem` into the results file `out`, and return an `Outcome`.

    SIGINT and SIGTERM end the run after the step being made, with a checkpoint. A run that becomes
    unstable raises `Unstable` or `TooLarge`; the last checkpoint, of a state that
    passed all checks, then stands. One that cannot even begin raises them, or `OutOfRange`, before
    anything is written. Raises `Refused`, `BadCheckpoint`, `BadResults`, `InUse`
    or `NotWritten` where files stand in the way. The arrays of the problem's bodies are changed.
    """
    options, watch = options or Options(), watch or Watch()
    require_place(out)
    state, same_code = _where_to_begin(problem, out, options)
    _require_same_fields(problem, out, options)
    over = _why_over(problem, state, options)
    if over is not None:
        return _as_it_stands(problem, out, Outcome(over, state, 0, same_code, 0))
    writer = _open(problem, out, options, state)
    try:
        session = Session(problem, writer, watch, options.steps, options.checkpoint_every)
        watch.begin(problem, state)
        why = session.loop(state)
        return Outcome(why, session.state, len(writer), same_code, unsolved(writer.manifest))
    finally:
        writer.close()


def _where_to_begin(problem, out, options):
    """(state of the checkpoint or None for the start, whether this very code saved it)."""
    path = checkpoint_of(out)
    _require_leave(out, options)
    if Path(out).exists():
        _require_results(out, options)
    if options.resume and path.exists():
        if not Path(out).exists():
            raise Refused(f"{out}: there are no results beside the checkpoint {path}; "
                          "put them back, or remove the checkpoint to begin anew")
        return checkpoint.load(path, problem)
    _require_start(problem)
    return None, True


def _require_leave(out, options):
    """Raise `Refused` where results stand that are neither to be continued nor replaced."""
    if Path(out).exists() and not (options.resume or options.overwrite):
        raise Refused(f"{out} exists: add --resume to continue it, --overwrite to replace it, "
                      "or name another file")


def _require_results(out, options):
    """Raise `Refused` or `BadResults` for a file that no run wrote: what it holds would be lost."""
    try:
        Results(out).close()
    except BadResults as fault:
        if options.resume:
            raise
        raise Refused(f"{out} is not a results file, or not a whole one, and only those are "
                      "overwritten; remove it yourself, or name another file") from fault


def _require_same_fields(problem, out, options):
    """Raise `Refused` if a run that goes on is to store something else than it began with."""
    if not options.resume or options.fields is None or not Path(out).exists():
        return
    with Results(out) as results:
        for body in problem.bodies:
            if body.name not in results.bodies:
                return                  # of another scene, which `reopen` refuses
            stored, gzip = results.fields(body.name), results.gzip(body.name)
            asked = list(options.fields.of(body))
            if set(asked) != set(stored) or options.fields.gzip != gzip:
                raise Refused(
                    f"{out} was begun with the fields {','.join(stored)} and gzip {gzip}, not with "
                    f"{','.join(asked)} and gzip {options.fields.gzip}: leave fields and gzip out "
                    "to continue it, or write to another file")


def _why_over(problem, state, options):
    """Why a state needs no further step, or None."""
    if state is None:
        return None
    if ended(problem.clock, state):
        return FINISHED
    return AT_LIMIT if options.steps is not None and state.step >= options.steps else None


def _as_it_stands(problem, out, outcome):
    """The `Outcome` of a run that needs no further step, with what its results hold."""
    with Results(out) as results:
        require_run(results.h5, out, problem, outcome.state.frame)
        return replace(outcome, frames=len(results), unsolved=unsolved(results.manifest))


def _require_start(problem):
    """What a run finds of its first state, before anything is written: raises `Unstable` for a
    state that is not sound, `OutOfRange` where no grid covers it, `TooLarge` for a dt past its
    bound.
    """
    stepper, state = problem.stepper(), State(problem.bodies)
    stepper.start(state.bodies)
    check(problem, state, 0.0)
    stepper.storage.cover([body.particles.x for body in state.bodies])
    rebound(problem, stepper, state)


def _open(problem, out, options, state):
    """`Writer` of the results, new ones or those of the run that goes on."""
    if options.resume and Path(out).exists():
        return reopen(out, problem, state.frame if state else 0)
    _require_leave(out, options)        # another run may have begun there meanwhile
    facts = manifest(problem, options.seed) | options.facts
    return create(out, problem, options.fields or Fields(), facts, beside=checkpoint_of(out))
