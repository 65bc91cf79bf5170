"""A reduced run that gives no body breaks down, with a sentence; a mistake in the code does not
pass for it.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from mpm_ref.core.grid import OutOfRange
from mpm_ref.materials import FixedCorotated
from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.kinematics import NoBody, guesses
from mpm_ref.rom.latent import start_state
from mpm_ref.rom.quadrature.lagrangian import lagrangian
from mpm_ref.rom.step import ldm_stepper
from mpm_ref.rom.study import record
from mpm_ref.rom.study.evaluate import (
    NEAREST,
    REDUCED,
    HeldOutRun,
    ReferenceRun,
    breakdown_warnings,
    path_errors,
)
from mpm_ref.rom.study.full_model import ldm_full_model
from mpm_ref.rom.study.monitor import checked_states, map_monitor
from mpm_ref.rom.study.run import RunOptions, ldm_run
from validation.common.scenes import with_
from validation.extremes import ldm_runs
from validation.ldm import references
from validation.ldm.studies import GRAVITY
from validation.ldm.timing import SteppedReducedRun

FAULTS = [NoBody("no body"), OutOfRange("nowhere"), np.linalg.LinAlgError("singular")]
X = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


def broken(fault, *states):
    """Yield states, then raise."""
    yield from states
    raise fault


@pytest.fixture(scope="module")
def one():
    return ldm_full_model(with_(GRAVITY.scene(5.0), steps=2))


# each place where runs are made: a function of what the run raises -> the sentence, or what stands
# for it

class Shifted:
    """A field whose latent coordinates are shifts of all points."""

    def place(self, points, xhat):
        return points + xhat


def compared(shifts, levels=3):
    """`PathErrors` of states that are shifted, of a body that is shifted by 2."""
    reference = ReferenceRun(X, np.stack(levels * [X + 2.0]), None)
    return path_errors(Shifted(), reference, enumerate(shifts), X)


def of_path(one, monkeypatch, fault):
    return compared(broken(fault, 1.0)).breakdown


def of_compared(one, monkeypatch, fault):
    monkeypatch.setattr(references, "ldm_run",
                        lambda *_: SimpleNamespace(states=lambda: broken(fault)))
    return references.run_errors([one], [one.X[None]], None, None, None).origin == np.inf


def of_race(one, monkeypatch, fault):
    run = object.__new__(SteppedReducedRun)
    run.ended, run.states = False, broken(fault)
    run.step(X)
    return run.ended


def of_record(one, monkeypatch, fault):
    monkeypatch.setattr(record, "checked_states", lambda *_: broken(fault))
    recording = record.Recording(None, None, None, one.problem, SimpleNamespace(seed=0), {},
                                 record.LDM_SERIES, None)
    with pytest.raises(record.BrokenRun, match="broke down in step 0: ") as lost:
        list(record.shown_states(recording))
    return str(lost.value)


def of_extremes(one, monkeypatch, fault):
    net, options = ldm_runs.trained_reduction("gravity-r4"), RunOptions(points=20)
    run = ldm_run(one, net.field, options, net.rest)
    start = next(checked_states(run, map_monitor(one, net.field, net.xhat)))
    monkeypatch.setattr(ldm_runs, "checked_states", lambda *_, **__: broken(fault, start))
    return ldm_runs.reduced_end(one, [one.X], net, options).message


PLACES = [of_path, of_compared, of_race, of_record, of_extremes]


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: type(fault).__name__)
def test_a_breakdown_ends_a_run(one, monkeypatch, place, fault):
    said = place(one, monkeypatch, fault)
    assert said
    assert said is True or str(fault) in said


@pytest.mark.parametrize("place", PLACES)
def test_a_mistake_does_not_pass_for_a_breakdown(one, monkeypatch, place):
    with pytest.raises(ValueError, match="shapes differ"):
        place(one, monkeypatch, ValueError("shapes differ"))


def test_states_and_levels_of_different_numbers_are_a_mistake():
    with pytest.raises(ValueError, match="2 states compared with 3 time levels: expected as many"):
        compared([1.0, 1.0])


def test_a_path_that_broke_down_is_infinitely_off_and_says_when_and_why():
    found = compared(broken(NoBody("no\n  body"), 1.0))
    assert found.breakdown == "step 1: no body"
    assert np.isinf([*found.errors, *found.sums]).all()
    assert np.isfinite(found.levels).tolist() == [True, False, False]
    sound = compared(3 * [1.0])
    assert sound.breakdown == ""
    assert np.isfinite(sound.errors).all()


@pytest.mark.parametrize("far", [np.nan, np.inf, 1e200])
def test_positions_that_are_no_numbers_are_a_breakdown(far):
    with np.errstate(all="ignore"):
        found = compared([0.0, far, 0.0])
    assert found.breakdown == "step 1: the positions, or their squares, are not finite"


def test_a_breakdown_is_told_with_the_parameters_of_its_run():
    good, bad = (compared(states, 1) for states in ([0.0], broken(NoBody("no body"))))
    found = [HeldOutRun(2, np.array([3.0, 0.5]), {REDUCED: good, NEAREST: good}),
             HeldOutRun(7, np.array([4.0, 0.5]), {REDUCED: bad, NEAREST: good})]
    said = list(breakdown_warnings(SimpleNamespace(names=("g", "E")), found))
    assert said == ["run 7 (g = 4, E = 0.5): the reduced run broke down in step 0: no body"]


@pytest.mark.parametrize("far", [0.0, np.inf])
def test_a_map_that_is_inverted_or_nowhere_at_all_seeds_gives_no_body(far):
    class Bad:
        def derivatives(self, X, xhat):
            F = np.tile(np.eye(2) if far else np.diag([1.0, -1.0]), (len(X), 1, 1))
            return X + far, F, None

    with pytest.raises(NoBody, match="all 3 material points asked are inverted"):
        guesses(Bad(), None, X, X)


def test_a_body_that_has_blown_up_does_not_ask_for_all_memory():
    points = np.random.default_rng(0).uniform(size=(20, 2))
    V0 = np.full(20, 0.05)
    g = Affine(2)
    stepper = ldm_stepper(g, lagrangian(points, 800.0 * V0, V0, 0.17, 2), FixedCorotated(3e3, 4e3),
                          np.zeros(2))
    stepper.step(start_state(g.rest), np.arange(20), 0.0, 1e-3)
    xhat = 1700.0 * g.rest
    assert np.ptp(g.place(points, xhat), axis=0).min() > 1000.0
    with pytest.raises(NoBody, match="have the latent coordinates left the range"):
        stepper.step(start_state(xhat), np.arange(20), 0.0, 1e-3)
    assert stepper.storage._buffer.nbytes < 1e6
