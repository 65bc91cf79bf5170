"""Cost of NSF's fields before the first reduced run, and the number of runs that pays it back."""

from typing import NamedTuple

import numpy as np

from mpm_ref.rom.snapshots import join_histories
from mpm_ref.rom.study.dataset import simulate_history

from ..common.registry import experiment
from ..common.weights_needed import Untrained, load_available
from ..ldm.timing import timed
from ..nsf.networks import fields_of, nets, trained
from ..nsf.reduced_runs import FittedStudy, refit
from ..nsf.studies import jelly, metal
from .nsf import full_cpu, reduced_cpu

INFO = {"comparator": "info", "unit": "s"}
MANY = 1000.0       # reduced runs: a study that has not paid after so many does not pay
COLUMNS = ("scene", "fields", "runs", "making", "full", "reduced", "pays_after")


class OfflineCosts(NamedTuple):
    """CPU seconds of one kind of fields."""

    runs: float         # of all training runs
    making: float       # of the fields of them
    full: float         # of a full-order run
    reduced: float      # of a reduced run; infinite where it broke down

    @property
    def pays_after(self):
        """Number of runs after which the reduced ones, with all preparation, have cost less;
        infinite where a reduced run takes longer.
        """
        saved = self.full - self.reduced
        return (self.runs + self.making) / saved if saved > 0.0 else np.inf


def studies(run):
    """Return {name: `Study`}, at the standard profile with the printed resolution and all runs."""
    return run.choose(quick=lambda: {"jelly": jelly(4), "metal": metal(4, train=4)},
                      standard=lambda: {"jelly": jelly(), "metal": metal()})()


@experiment("trade.nsf.offline", title="NSF: the cost before the first reduced run",
            profiles=("quick", "standard"), budget={"quick": 15, "standard": 400})
def offline(run):
    """Compare fields of modes and, at the standard profile, the jelly cube's trained networks,
    whose file stores the time of training; the usual number of random samples.
    """
    rows = []
    for name, study in run.progress(studies(run).items(), "scenes"):
        one, bill = mode_costs(study, run.choose(quick=1, standard=3))
        rows.append(record_costs(run, name, "modes", one, bill))
        if run.profile == "standard" and name == "jelly":
            rows += network_costs(run, name, one, bill)
    run.table("bills", COLUMNS, rows)
    record_trainings(run)


def mode_costs(study, repeats):
    """Return the `FittedStudy` of a study on fields of modes, and their `OfflineCosts`."""
    def simulated(value):
        return simulate_history(study.run(value), [value], np.float32, study.spacing)

    tests = {study.test[0]: simulated(study.test[0])}       # first, since it compiles
    runs, spent = timed(lambda: join_histories(map(simulated, study.train), len(study.train)))
    bare = FittedStudy(study, None, None, runs, tests)
    one, made_in = timed(lambda: refit(bare, study.sizes, study.follows))
    return one, OfflineCosts(spent.cpu, made_in.cpu, full_cpu(one),
                     reduced_cpu(one, study.samples, False, repeats))


def network_costs(run, name, one, bill):
    """Record the costs of a scene's trained networks, of the same runs. Returns one row, or none
    where they are not trained.
    """
    try:
        model = trained(name)
    except Untrained as fault:
        run.note(str(fault))
        return []
    other = one._replace(fields=fields_of(model, one.study), xhat=model.xhat)
    training = sum(model.about["cpu_seconds"].values())
    return [record_costs(run, name, "networks", other, bill._replace(
        making=training, reduced=reduced_cpu(other, one.study.samples, False, 1)))]


def record_trainings(run):
    """Record the shortest and the longest training of the seven scenes' networks with features."""
    names = [name for name in nets() if name.endswith("-waves")]
    hours = {name: sum(model.about["cpu_seconds"].values()) / 3600.0
             for name, model in load_available(run, names, trained).items()}
    for word, end in (("lo", min), ("hi", max)):
        name = end(hours, key=hours.get, default=None)
        if name is not None:
            run.record(f"nsf.sec7.train_time_{word}", hours[name], unit="h",
                       note=f"{name}, CPU hours stored with its weights; printed: hours of wider "
                            "networks on a graphics processor")


def record_costs(run, name, kind, one, bill):
    """Record `OfflineCosts`. Returns their row."""
    target, scale = f"trade.nsf.offline.{name}.{kind}", f"{one.size}, {one.study.samples} samples"
    for word, value in bill._asdict().items():
        run.record(f"{target}.{word}", value, scale=scale, note="CPU seconds", **INFO)
    run.record(f"{target}.pays_after", bill.pays_after, unit="1", comparator="<=", bound=MANY,
               scale=scale,
               note="reduced runs until training runs and fields are paid back; infinite where a "
                    "reduced run takes longer than the full one")
    return (name, kind, *bill, bill.pays_after)
