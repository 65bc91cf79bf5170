"""Errors of NCLaw's laws: on the run they are trained on (Table 1), and away from it (Table 2)."""

from ..common.registry import experiment
from ..common.weights_needed import load_available
from .environments import ENVIRONMENTS
from .errors import COLUMNS, OURS, RELEASED, as_printed, errors, record, to_the_digits
from .excerpts import NOT_RUN, record_excerpts
from .initial_laws import untrained
from .stand_in_bodies import has_mesh
from .tasks import TOYS
from .trained_laws import nets, trained

INIT = "ours-init"
AWAY = ("time", "velocity", "geometry")     # tasks of Table 2


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
    record(run, "nclaw.table1", first, to_the_digits)
    if run.profile == "standard":
        record(run, "nclaw.table2", [row for row in rows if row not in first], to_the_digits,
               AWAY)
    run.table("errors", COLUMNS, rows)


@experiment("nclaw.table1", title="NCLaw: reconstruction",
            profiles=("quick", "standard"), budget={"quick": 20, "standard": 60})
def table1(run):
    """All methods that are trained, beside one true run of each environment. Tables 4 and 7 have
    some of these errors, and some of Table 2's (see `excerpts`).
    """
    rows = contest(run, ("reconstruction",))
    ours = [row.error for row in rows if row.method == OURS]
    if run.profile == "standard" and len(ours) == len(ENVIRONMENTS):
        run.record("nclaw.sec4_2.recon_ours_lt", max(ours), scale="the largest of four")
    run.note(NOT_RUN)


@experiment("nclaw.table2", title="NCLaw: other times, velocities and bodies",
            budget={"quick": 20, "standard": 5000, "paper": 10000})
def table2(run):
    """All methods that are trained, beside one true run of each task; graph networks are not in
    task (c) (see `errors.fits`), seeds and ablations at the paper's profile alone.
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
    laws = known(run, names_of(as_released=True))
    rows = errors(run, laws, tasks) if laws else []
    first = [row for row in rows if row.task == "reconstruction"]
    record(run, "nclaw.table1", first, as_printed)
    record(run, "nclaw.table2", [row for row in rows if row not in first], as_printed, AWAY)
    run.table("errors", COLUMNS, rows)


def contest(run, tasks):
    """Record the errors of all methods, and what is not trained yet; returns their `Row`s."""
    laws = known(run, names_of(as_released=False))
    rows = errors(run, laws, tasks) if laws else []
    record(run, run.experiment.id, rows, as_printed, tasks)
    record_excerpts(run, rows)
    run.table("errors", COLUMNS, rows)
    return rows


def names_of(as_released):
    """The names in `nets` of readings as released, or of all else."""
    return [name for name in nets() if name.endswith(RELEASED) is as_released]


def known(run, names=None):
    """{method: {environment: laws}} of those of the named nets, or of all, that are trained;
    records which are not.
    """
    names, found = nets() if names is None else names, {}
    for name, laws in load_available(run, names, trained).items():
        net = nets()[name]
        found.setdefault(method_of(name, net), {})[net.environment] = laws
    return found


def method_of(name, net):
    """The method of a net: its name without that of its environment; "ours" where nothing else is
    in it.
    """
    return "-".join(word for word in name.split("-") if word != net.environment) or OURS
