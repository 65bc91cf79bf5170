"""Laws of unfinished trainings, run beyond the horizon of training, and laws learned from faulty
observations.
"""

from mpm_ref.nclaw.bodies import body_maker

from ..common.registry import experiment
from ..common.scenes import with_
from ..common.weights_needed import load_available
from ..nclaw.small_runs import COLUMNS, measured, seed_range
from ..nclaw.small_trainings import BASE, OF_EPOCHS, OF_FAULTS, SEEDS, bundled, small_nets
from .nclaw_extrapolation import thrown, with_time_step
from .nclaw_runs import EVERY, SHORT, Law, LawSetup, law_trials, record_silent
from .verdicts import trial_table

FACTORS = {"quick": (), "standard": (0.5, 2.0)}         # of the trained time step
THROWS = {"quick": (2.0,), "standard": (0.0, 2.0)}      # times the trained velocity
EPOCHS = {"quick": (10,), "standard": None}             # None: all that were stored


@experiment("extremes.nclaw.epochs", title="NCLaw: laws of unfinished trainings",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 800})
def epochs(run):
    """Run laws of small trainings by epoch, material, time step and throw."""
    names = run.choose(quick=list(OF_EPOCHS)[:1], standard=list(OF_EPOCHS))
    trials = [t for name, bundle in load_available(run, names, bundled).items()
              for t in training_trials(run, OF_EPOCHS[name], bundle.laws)]
    if trials:
        record_silent(run, trials, "216 particles")
        trial_table(run, trials)


def training_trials(run, net, by_epoch):
    """Return the `LawTrial`s of laws {epoch: laws} of a `Small`. The usual error is the smallest
    that any epoch has on the training run: the last may break down.
    """
    setups, trials = training_setups(run, net), {}
    for epoch in sorted({*by_epoch} & {*(EPOCHS[run.profile] or by_epoch), max(by_epoch)},
                        reverse=True):
        laws = by_epoch[epoch]
        law = Law(f"{net.environment} after {epoch}", net.environment, body_maker(laws),
                  laws.about["seen"], laws.about["dt"])
        trials[epoch] = law_trials(run, law, setups)
        record_epoch(run, f"extremes.nclaw.epochs.{net.environment}.{epoch}", trials[epoch])
    usual = min(same_epoch[0].usual for same_epoch in trials.values())
    return [t._replace(usual=usual) for same_epoch in trials.values() for t in same_epoch]


def training_setups(run, net):
    """Return the `LawSetup`s of a training's laws, the training run first."""
    scene = with_(net.scene, every=EVERY)
    if run.profile == "quick":
        scene = with_(scene, steps=SHORT)
    return [LawSetup("as trained", scene),
            *(LawSetup(f"{k:g} dt", with_time_step(scene, k)) for k in FACTORS[run.profile]),
            *(LawSetup(f"thrown {k:g} times as fast", thrown(scene, k))
              for k in THROWS[run.profile])]


def record_epoch(run, target, trials):
    """Record the error of an epoch's laws on the training run, and their runs that lost points."""
    lost = {t.what: t.end.lost for t in trials if t.end.lost >= 0}
    steps = "; ".join(f"{what}: lost in step {step}" for what, step in lost.items())
    flagged = [t for t in trials if t.end.lost >= 0 and 0 <= t.end.first < t.end.lost]
    run.record(target, trials[0].end.error, unit="m^2", comparator="info",
               scale=f"216 particles, {trials[0].end.steps} steps",
               note=f"{len(lost)} of {len(trials)} runs lost, {len(flagged)} of them flagged before"
                    + (f"; {steps}" if steps else ""))


FAULTS = ("gap", "outliers")


@experiment("extremes.nclaw.observed", title="NCLaw: gaps, outliers and a wrong density",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 100})
def observed(run):
    """Compare with trainings of other seeds on a run without faults. With a wrong density the
    learned stress is too large or too small by the same factor; its run uses the true density.
    """
    names = run.choose(quick=[BASE], standard=[*SEEDS, *OF_FAULTS])
    rows = measured(run, names, full=False)
    least, most = seed_range(rows, SEEDS)
    for row in rows:
        run.record(f"extremes.nclaw.observed.{row.name}", row.training_run, unit="m^2",
                   comparator="info", scale="216 particles, 100 epochs", note="without faults "
                   f"{least:.3g} to {most:.3g} m^2 by seed; thrown differently "
                   f"{row.thrown:.3g} m^2")
    run.table("trainings", (*COLUMNS, *FAULTS, "density"), [
        (*row, *(getattr(small_nets()[row.name].observation, key) for key in FAULTS),
         small_nets()[row.name].density) for row in rows])
