"""Time of NSF's reduced runs beside the full-order run, on a clock that the tests wind: none of
them depends on how long anything takes.
"""

from itertools import islice

import numpy as np
import pytest

from mpm_ref.rom.fields.pod_fields import Sizes
from mpm_ref.rom.step import ReducedStepper
from mpm_ref.rom.study.full_model import nsf_full_model
from mpm_ref.rom.study.run import FieldRunOptions, nsf_run
from mpm_ref.simulate import simulate
from validation.common import targets
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.nsf import reduced_runs, speed
from validation.nsf.studies import jelly
from validation.trade.nsf_sizes import particle_bytes

STUDY = jelly(4)._replace(train=(0.3, 0.5), test=(0.35, 0.4), samples=40,
                          sizes=Sizes(r=3, modes=8, tau=12, C=12, smoothing=1e-4))
SPENT = dict(zip(speed.STAGES, (1.0, 2.0, 4.0, 8.0), strict=True))      # [s] each time
FULL, MLS, DEFORM = 64.0, 32.0, 16.0    # [s] of a step with APIC, with MLS-MPM, of a body's update
BODIES = 2
N, FEW = 156, 2                     # particles of both, and so few samples that some are left out


@pytest.fixture(scope="module")
def one():
    """The small study."""
    return reduced_runs.fit_study(STUDY._replace(test=STUDY.test[1:]))


@pytest.fixture
def clock(monkeypatch):
    """Time that passes in stages of a reduced step, in full-order runs and in updates of bodies
    alone.
    """
    now = [0.0]

    def passing(work, spent):
        def done(*given):
            now[0] += spent
            return work(*given)
        return done

    def run(problem):
        now[0] += (MLS if problem.scheme.transfer == "mls" else FULL) * problem.clock.steps
        yield from simulate(problem)

    for stage, spent in SPENT.items():
        method = speed.STAGES[stage]
        monkeypatch.setattr(ReducedStepper, method, passing(getattr(ReducedStepper, method), spent))
    monkeypatch.setattr(speed, "deform_body", passing(speed.deform_body, DEFORM))
    monkeypatch.setattr(speed, "simulate", run)
    monkeypatch.setattr(speed, "perf_counter", lambda: now[0])


@pytest.mark.usefixtures("clock")
@pytest.mark.parametrize("inversion", ["nonlinear", "linear"])
def test_stages_add_up_to_the_step(one, inversion):
    """Exactly: whole seconds are added. Steps of the warm-up are in neither."""
    found = speed.reduced_steps(one, 40, inversion, 5)
    assert {stage: found[stage] for stage in SPENT} == SPENT
    assert found["reduced"] == sum(SPENT.values())


def test_stages_are_parts_of_the_step(one):
    """On the real clock, up to the round-off of their sums."""
    found = speed.reduced_steps(one, 40, "nonlinear", 5)
    assert all(found[stage] > 0.0 for stage in speed.STAGES)
    assert sum(found[stage] for stage in speed.STAGES) <= found["reduced"] * (1.0 + 1e-9)


@pytest.mark.parametrize("steps", [1, 5])
def test_integration_points_are_those_of_the_reduced_run(one, steps):
    """The mean over all steps, of the warm-up too; with all particles, all."""
    scene = nsf_full_model(one.study.run(0.4))
    options = FieldRunOptions(one.study.chosen(scene, FEW, 0))
    run = nsf_run(scene, one.fields_of_run(0.4), options, one.rest).states()
    reports = [report.points for _, _, report, _ in islice(run, 1, 1 + speed.WARM + steps)]
    assert FEW < min(reports) < max(reports) <= N
    for count, points in ((FEW, np.mean(reports)), (N, N)):
        assert speed.reduced_steps(one, count, "nonlinear", steps)["points"] == points


@pytest.mark.usefixtures("clock")
def test_a_full_step_and_its_update_of_bodies(one):
    assert speed.full_steps(STUDY, 10) == (FULL, BODIES * DEFORM)


def test_full_steps_are_all_from_the_start(monkeypatch):
    """Not from where the last repeat ended."""
    begun = []

    def run(problem):
        begun.append([body.particles.x.copy() for body in problem.bodies])
        yield from simulate(problem)

    monkeypatch.setattr(speed, "simulate", run)
    speed.full_steps(STUDY, 5)
    rest = [body.particles.x for body in nsf_full_model(STUDY.run(STUDY.test[0])).problem.bodies]
    assert len(begun) == 1 + speed.REPEATS
    for bodies in begun:
        for x, X in zip(bodies, rest, strict=True):
            assert np.array_equal(x, X)


@pytest.fixture
def recorded(request, one, clock, tmp_path, monkeypatch):
    """{id: `Record`} and the table of the experiment on the small study, with all particles and
    with few; the parameter is the error of MLS-MPM.
    """
    monkeypatch.setattr(speed, "mls_error", lambda one: request.param)
    asked = []

    def small(coarser, train):
        asked.append((coarser, train))
        return STUDY

    def made(study):
        asked.append(study)
        return one

    monkeypatch.setattr(speed, "STUDIES", {"metal": (small, (N, FEW))})
    monkeypatch.setattr(speed, "sand", small)
    monkeypatch.setattr(speed, "fit_study", made)
    assert not run_all([speed.speed.experiment], RunSetting("quick", tmp_path,
                                                              targets=targets.load()))
    assert asked == [(3, 3), STUDY._replace(test=STUDY.test[1:]),
                     (3, 3), STUDY._replace(test=STUDY.test[:1], steps=speed.SAND_STEPS)]
    results = ProfileResults(tmp_path)
    return ({r.target: r for r in results.records("nsf.speed") if r.target != "nsf.speed"},
            results.table("nsf.speed", "times"))


CHOICES = [(0.03, ("mls", MLS)), (0.31, ("full", FULL))]    # the printed error of 30 samples is 0.3


@pytest.mark.parametrize(("recorded", "choice"), CHOICES, indirect=["recorded"])
def test_records_are_ratios_and_shares_of_the_table(one, recorded, choice):
    """The judged ones over the fastest transfer that is near enough to the scene's own."""
    (records, table), (baseline, best) = recorded, choice
    assert {*table["baseline"]} == {baseline}
    assert (table["mls"] == MLS).all()
    assert [*zip(table["samples"], table["inversion"], strict=True)] == [
        (N, "nonlinear"), (N, "linear"), (FEW, "nonlinear"), (FEW, "linear")]
    for name, spent in {**SPENT, "full": FULL, "deform": BODIES * DEFORM}.items():
        assert (table[name] == spent).all()
    reduced = sum(SPENT.values())
    assert (table["reduced"] == reduced).all()
    names = {f"nsf.speed.metal.{inversion}.{count}": FULL / reduced
             for count in (N, FEW) for inversion in ("nonlinear", "linear")}
    fields = sum(a.nbytes for a in (one.fields.X, one.fields.U, one.fields.tau.modes,
                                    one.fields.C.modes))
    particles = particle_bytes(STUDY)
    held = {name: value for scene in ("metal", "sand") for name, value in (
        (f"nsf.speed.{scene}.bytes.fields", fields),
        (f"nsf.{scene}.mem_reduced.modes", 1e-9 * fields),
        (f"nsf.speed.{scene}.bytes.particles", particles),
        (f"nsf.{scene}.mem_full", 1e-9 * particles))}
    found = {target: one.value for target, one in records.items()}
    assert found == pytest.approx(names | held | {
        "nsf.appC.metal.speedup_per_step.modes": best / reduced,
        "nsf.metal.speedup.modes": 1.5 * best / reduced,
        "nsf.appC.metal.full": 100.0 * FULL,
        "nsf.appC.metal.reduced_mpm.modes": 100.0 * SPENT["moved"],
        "nsf.appC.metal.network.modes": 100.0 * (reduced - SPENT["moved"]),
        "nsf.appC.metal.particle_share.modes": 100.0,
        "nsf.appC.metal.runtime_share.modes": 100.0 * SPENT["moved"] / best,
        "nsf.speed.metal.over.full": FULL / reduced, "nsf.speed.metal.over.mls": MLS / reduced,
        "nsf.speed.metal.mls_error": 0.03 if baseline == "mls" else 0.31,
        "nsf.speed.metal.deform": 100.0 * BODIES * DEFORM / FULL})
    assert {r.comparator for r in records.values()} == {"info", "printed"}
    points = table["points"][2]
    assert f"{FEW} samples, {points:.0f} integration points" in (
        records[f"nsf.speed.metal.nonlinear.{FEW}"].note)
    assert FEW < points < N == table["points"][0]


@pytest.mark.parametrize(("times", "error", "baseline"), [
    ((2.0, 1.0, 0.5), 0.2, "mls"), ((2.0, 1.0, 0.5), 0.4, "full"),
    ((1.0, 2.0, 0.5), 0.2, "full"), ((2.0, 1.0, 0.5), np.inf, "full")])
def test_the_baseline_is_the_fastest_within_the_error(times, error, baseline):
    assert speed.FullTimes(*times).baseline(error, 0.3) == baseline


def test_full_and_reduced_runs_are_in_turn(one, monkeypatch):
    order = []

    def full_run(scene, steps):
        order.append(scene.scheme.transfer)
        return 1.0, None

    monkeypatch.setattr(speed, "full_run", full_run)
    monkeypatch.setattr(speed, "deform_seconds", lambda *_: 1.0)
    monkeypatch.setattr(speed, "reduced_steps", lambda one, count, kind, steps: (
        order.append((count, kind)) or {"reduced": float(len(order))}))
    ways = [(40, "nonlinear"), (30, "linear")]
    _, found = speed.times_in_turn(one, ways, 5)
    assert order == ["apic", "mls"] + ["apic", "mls", *ways] * speed.REPEATS
    assert found == {ways[0]: {"reduced": 9.0}, ways[1]: {"reduced": 10.0}}


def test_mls_is_compared_on_a_training_run(one, monkeypatch):
    """The first; of the scene's own transfer the error is that of stored single precision."""
    assert 1e-4 < speed.mls_error(one) < 5.0
    monkeypatch.setattr(speed, "mls", lambda scene: scene)
    assert speed.mls_error(one) < 1e-4
