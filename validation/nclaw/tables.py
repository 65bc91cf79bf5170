"""Errors of NCLaw's laws: on the run they are trained on (Table 1), and on others (Table 2); of
graph networks of 1, 10 and 100 runs (Table 6).

Tables 4 and 7 have errors of one environment. Those of Table 4 (plasticine, "more recent
comparison") and of the first column of Table 7 (water, "auxiliary loss") repeat Tables 1 and 2. The
second column is of laws that were trained with a term of velocities in the loss, whose weight is
not printed; the errors are those of positions.
"""

from ..common.registry import experiment
from ..common.weights_needed import load_available
from .beats import record_beats
from .environments import ENVIRONMENTS
from .errors import (
    COLUMNS,
    OURS,
    errors,
    grouped,
    record,
    record_mean,
)
from .initial_laws import untrained
from .printed_ids import RELEASED, error_id, extended, run_variants
from .rivals import RIVALS
from .simulators import COUNTS, named
from .stand_in_bodies import has_mesh
from .tasks import TOYS
from .trained_laws import diverged, identity, nets, trained

INIT = "ours-init"
AWAY = ("time", "velocity", "geometry")     # tasks of Table 2
NOT_RUN = "Table 4: the simulator of Li & Farimani (2022) is another paper's and is not run"
WATER = "water"
TRAJECTORIES = {named(WATER, count): f"gnn.{count}" for count in COUNTS} | {WATER: "ours.1"}
REPEATED = "gnn.1", "ours.1"                # of Table 6: errors of Table 2
VELOCITY_TERM = "velocity"                  # the laws of Table 7, "with"


@experiment("nclaw.init", title="NCLaw: laws before training",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 200})
def init(run):
    """Tables 1 and 2, "ours-init": next to no stress, which checks tasks, true runs and measure to
    the printed digits; task (c) of those environments whose mesh is given. Runs of task (a) break
    down, and go on as in the release.
    """
    laws = dict.fromkeys(ENVIRONMENTS, untrained())
    tasks = run.choose(quick=("reconstruction",),
                       standard=("reconstruction", "time", "velocity"))
    rows = errors(run, {INIT: laws}, tasks, goes_on=True)
    if run.profile == "standard":
        with_mesh = {name: law for name, law in laws.items() if has_mesh(TOYS[name].name)}
        rows += errors(run, {INIT: with_mesh}, ("geometry",), goes_on=True)
    first = [row for row in rows if row.task == "reconstruction"]
    record(run, "nclaw.table1", first)
    if run.profile == "standard":
        record(run, "nclaw.table2", [row for row in rows if row not in first], AWAY)
    run.table("errors", COLUMNS, rows)


@experiment("nclaw.table1", title="NCLaw: reconstruction",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 60})
def table1(run):
    """All trained methods, compared with one true run of each environment."""
    rows = contest(run, ("reconstruction",))
    ours = [row.error for row in rows if row.method == OURS]
    if run.profile == "standard" and len(ours) == len(ENVIRONMENTS):
        run.record("nclaw.sec4_2.recon_ours_lt", max(ours), scale="the largest of four")
    run.note(NOT_RUN)


@experiment("nclaw.table2", title="NCLaw: other times, velocities and bodies",
            budget={"quick": 20, "standard": 5000, "paper": 10000})
def table2(run):
    """All trained methods, compared with one true run of each task; graph networks are not in
    task (c) (see `errors.can_run`), seeds and ablations at the paper's profile alone.
    """
    contest(run, run.choose(quick=("velocity",), standard=AWAY, paper=AWAY))


@experiment("nclaw.released", title="NCLaw: splines and stretches as released",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 600})
def released(run):
    """Tables 1 and 2, "spline" and "neural", with the bugs of the release, of which the printed
    numbers are; without task (c), whose bodies are others here.
    """
    tasks = run.choose(quick=("reconstruction",),
                       standard=("reconstruction", "time", "velocity"))
    laws = available_laws(run, names_of(as_released=True))
    rows = errors(run, laws, tasks) if laws else []
    first = [row for row in rows if row.task == "reconstruction"]
    record(run, "nclaw.table1", first)
    record(run, "nclaw.table2", [row for row in rows if row not in first], AWAY)
    record_diverged(run, tasks)
    run.table("errors", COLUMNS, rows)


def record_diverged(run, tasks):
    """Record a miss for each printed error of a reading as released whose training diverged."""
    for name in names_of(as_released=True):
        net = nets()[name]
        about = diverged(name, identity(net))
        for task in tasks if about else ():
            table = "nclaw.table1" if task == "reconstruction" else "nclaw.table2"
            words = run_variants(run.profile == "quick", net.environment, task)
            run.record(error_id(table, method_of(name, net), net.environment, task, words), None,
                       note=f"the training diverged: {about['stopped']}")


@experiment("nclaw.table6", title="NCLaw: graph networks of more and more runs",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 600})
def table6(run):
    """Errors on water with other velocities, of graph networks and of ours."""
    models = load_available(run, TRAJECTORIES, trained)
    rows = errors(run, {TRAJECTORIES[name]: {WATER: laws} for name, laws in models.items()},
                  ("velocity",))
    short = ("partial",) * (run.profile == "quick")
    for name in models:
        method = TRAJECTORIES[name]
        if method not in REPEATED:
            record_mean(run, extended(f"nclaw.table6.{method}.loss", ("narrow", *short)),
                        [row for row in rows if row.method == method], nets()[name])
    run.table("errors", COLUMNS, rows)


def contest(run, tasks):
    """Record the errors of all methods, beside their simplest rivals, and which are not trained
    yet; return their `ErrorRow`s.
    """
    laws = available_laws(run, names_of(as_released=False)) | {
        name: dict.fromkeys(ENVIRONMENTS, rival) for name, rival in RIVALS.items()}
    rows = errors(run, laws, tasks)
    record(run, run.experiment.id, rows, tasks)
    record_beats(run, run.experiment.id, rows)
    record_velocity_term(run, rows)
    run.table("errors", COLUMNS, rows)
    return rows


def record_velocity_term(run, rows):
    """Record the errors of Table 7 that Tables 1 and 2 have not, from the rows of all methods."""
    mine = [row for row in rows if (row.environment, row.method) == (WATER, VELOCITY_TERM)]
    for (name, task), group in grouped(mine).items():
        words = run_variants(run.profile == "quick", name, task)
        record_mean(run, extended(f"nclaw.table7.{task}.with", words), group,
                    nets().get(f"{WATER}-{VELOCITY_TERM}"))


def names_of(as_released):
    """Return the names in `nets` of readings as released, or of all else."""
    return [name for name in nets() if name.endswith(RELEASED) is as_released]


def available_laws(run, names=None):
    """Return {method: {environment: laws}} of those of the named nets, or of all, that are trained;
    record which are not.
    """
    names, laws_of = nets() if names is None else names, {}
    for name, laws in load_available(run, names, trained).items():
        net = nets()[name]
        laws_of.setdefault(method_of(name, net), {})[net.environment] = laws
    return laws_of


def method_of(name, net):
    """Return the method of a net: its name without that of its environment; "ours" where nothing
    else is in it.
    """
    return "-".join(word for word in name.split("-") if word != net.environment) or OURS
