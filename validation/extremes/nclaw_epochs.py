"""Laws of unfinished trainings, run freely: in training they are only ever run for a horizon."""

from mpm_ref.nclaw.bodies import body_maker

from ..common.registry import experiment
from ..common.scenes import with_
from ..common.weights_needed import load_available
from ..nclaw.small_trainings import OF_EPOCHS, bundled
from .nclaw_runs import EVERY, SHORT, Law, Setup, record_silent, table_of, trials
from .nclaw_strain import thrown
from .nclaw_time_step import longer

FACTORS = {"quick": (), "standard": (0.5, 2.0)}         # of the trained time step
THROWS = {"quick": (2.0,), "standard": (0.0, 2.0)}      # times the trained velocity
EPOCHS = {"quick": (10,), "standard": None}             # None: all that were kept


@experiment("extremes.nclaw.epochs", title="NCLaw: laws of unfinished trainings",
            profiles=("quick", "standard"), budget={"quick": 10, "standard": 800})
def epochs(run):
    """How far runs go by epoch, material, time step and throw; small trainings."""
    names = run.choose(quick=list(OF_EPOCHS)[:1], standard=list(OF_EPOCHS))
    found = [t for name, bundle in load_available(run, names, bundled).items()
             for t in of_training(run, OF_EPOCHS[name], bundle.laws)]
    if found:
        record_silent(run, found, "216 particles")
        table_of(run, found)


def of_training(run, net, kept):
    """`Trial`s of laws {epoch: laws} of a `Small`; what is usual is the error of the last one."""
    setups, found = tried(run, net), {}
    for epoch in sorted({*kept} & {*(EPOCHS[run.profile] or kept), max(kept)}, reverse=True):
        laws = kept[epoch]
        law = Law(f"{net.environment} after {epoch}", net.environment, body_maker(laws),
                  laws.about["seen"], laws.about["dt"])
        usual = found[max(kept)][0].usual if found else None
        found[epoch] = trials(run, law, setups, usual)
        record_epoch(run, f"extremes.nclaw.epochs.{net.environment}.{epoch}", found[epoch])
    return [t for own in found.values() for t in own]


def tried(run, net):
    """The runs of a training's laws, the trained one first."""
    scene = with_(net.scene, every=EVERY)
    if run.profile == "quick":
        scene = with_(scene, steps=SHORT)
    return [Setup("as trained", scene),
            *(Setup(f"{k:g} dt", longer(scene, k)) for k in FACTORS[run.profile]),
            *(Setup(f"thrown {k:g} times as fast", thrown(scene, k))
              for k in THROWS[run.profile])]


def record_epoch(run, target, found):
    """Record how far the runs of an epoch's laws went."""
    lost = {t.what: t.end.lost for t in found if t.end.lost >= 0}
    words = "; ".join(f"{what}: lost in step {step}" for what, step in lost.items())
    told = [t for t in found if t.end.lost >= 0 and 0 <= t.end.first < t.end.lost]
    run.record(target, found[0].end.error, unit="m^2", comparator="info",
               scale=f"216 particles, {found[0].end.steps} steps",
               note=f"{len(lost)} of {len(found)} runs lost, {len(told)} of them flagged before"
                    + (f"; {words}" if words else ""))
