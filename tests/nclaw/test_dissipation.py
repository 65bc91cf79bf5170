"""Energy that laws take away or create: the balance of paths, and the experiment."""

from itertools import pairwise
from types import SimpleNamespace

import admissible_toys as toys
import neural_toys
import numpy as np
import pytest
from record_verdicts import verdict

from mpm_ref.materials import FixedCorotated, Fluid, FluidProjection, Hencky, NoFlow, VonMises
from mpm_ref.materials.learned import network, response
from mpm_ref.nclaw.dissipation import balance, first_piola, loops, returned, work
from tests.nclaw.test_admissible import energies, strained
from validation.common.results import ProfileResults
from validation.common.run import RunSetting, run_all
from validation.common.weights_needed import Untrained
from validation.nclaw import dissipation, trained_laws
from validation.nclaw.dissipation import CREATED, MaterialLaws
from validation.nclaw.environments import ENVIRONMENTS

JELLY, CLAY = FixedCorotated(4e4, 3e4), Hencky(1.2e5, 1.2e5)
YIELD = VonMises(5e3, 0.05)
WATER = Fluid(5e4), FluidProjection()


@pytest.fixture
def closed(rng):
    """Cycles that plasticine flows in."""
    return loops(30, 0.1, 100, rng)


def test_loops_are_closed_and_as_large_as_asked(rng):
    G = loops(50, 0.1, 40, rng)
    assert G.shape == (41, 50, 3, 3)
    assert G[0] == pytest.approx(np.tile(np.eye(3), (50, 1, 1)), abs=1e-15)
    assert G[-1] == pytest.approx(G[0], abs=1e-15)
    assert np.linalg.norm(G[10] - 0.5 * (G[20] - G[0]) - G[0], axis=(1, 2)) == pytest.approx(0.1)
    assert np.linalg.norm(G[20] - G[0], axis=(1, 2)) == pytest.approx(0.1)


def test_work_is_the_difference_of_the_energy(rng):
    F, (law, _) = strained(rng, 0.1), toys.deployed()
    after = F + 1e-2 * rng.normal(size=F.shape)
    assert work(law, F, after) == pytest.approx(energies(law, after) - energies(law, F), rel=1e-6)


def test_stresses_of_a_fluid_are_those_of_all_of_f(rng):
    """tau = lam J (J - 1) I, P = tau F^-T."""
    F = strained(rng)
    J = np.linalg.det(F)[:, None, None]
    expected = 5e4 * J * (J - 1.0) * np.linalg.inv(F).swapaxes(1, 2)
    assert first_piola(WATER[0], F) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("pair", [(JELLY, NoFlow()), WATER], ids=["jelly", "water"])
def test_of_elastic_matter_nothing_is_left(pair, closed):
    """Water too: its pressure knows J alone, which the projection keeps."""
    found = balance(*pair, closed)
    assert abs(found.share).max() < 1e-9
    assert found.exchanged.min() > 1.0


@pytest.mark.parametrize("pair", [(CLAY, YIELD), toys.deployed(shift=2.0)],
                         ids=["plasticine", "admissible"])
def test_work_is_energy_and_what_returns_take(pair, closed):
    """sum of w = psi(end) + D, and no return adds any."""
    (law, flow), F = pair, np.tile(np.eye(3), (30, 1, 1))
    found = balance(law, flow, closed)
    for before, after in pairwise(closed):
        F = returned(law, flow, after @ np.linalg.inv(before) @ F)
    expected = energies(law, F) + found.taken
    assert found.work == pytest.approx(expected, rel=1e-4)
    assert found.taken.min() > 1.0
    assert found.least.min() > -1e-9 * found.taken.min()
    assert found.share.min() > 0.0


def test_a_stress_without_energy_creates_some():
    """What a loop takes it gives back the other way round: half of them create."""
    law = network.build_law(neural_toys.trained(response.Stress(1e4), 3))
    G = loops(30, 0.1, 100, np.random.default_rng(0))
    one, other = balance(law, NoFlow(), G), balance(law, NoFlow(), G[::-1])
    assert one.work == pytest.approx(-other.work, rel=1e-6, abs=1e-9 * one.exchanged.max())
    assert one.share.min() < -100.0 * CREATED
    assert 0.2 < np.mean(one.share < -CREATED) < 0.8


def test_a_return_that_adds_strain_is_told(closed):
    """D < 0 of a map that stretches what has yielded."""
    grown = neural_toys.trained(response.Correction(), 3, hidden=())
    W = np.zeros((13, 9))
    W[[3, 7, 11], [0, 4, 8]] = 20.0         # F' = F + alpha R diag(20 (C - I)): more of the same
    flow = network.build_flow(grown._replace(layers=((W, np.zeros(9)),)))
    found = balance(CLAY, flow, closed)
    assert found.taken.max() < 0.0
    assert found.share.min() < -CREATED


# The experiment.

def results(tmp_path, monkeypatch, laws):
    monkeypatch.setattr(dissipation, "tested_laws", lambda run: laws)
    monkeypatch.setattr(dissipation, "SIZES", (0.1,))
    failed = run_all([dissipation.dissipation.experiment],
                     RunSetting("quick", tmp_path))
    assert not failed
    found = ProfileResults(tmp_path)
    return {r.target: r for r in found.records("nclaw.dissipation")}, found


def test_the_experiment_tells_laws_apart(tmp_path, monkeypatch):
    stress = network.build_law(neural_toys.trained(response.Stress(1e4), 3))
    records, found = results(tmp_path, monkeypatch, {
        ("true", "jelly"): MaterialLaws(JELLY, NoFlow()),
        ("ours", "jelly"): MaterialLaws(stress, NoFlow()),
        ("admissible", "plasticine"): MaterialLaws(*toys.deployed(shift=2.0))})
    name = "nclaw.dissipation.{}.cycles.0.1.creating".format
    assert records[name("true.jelly")].value == 0.0
    assert verdict(records[name("true.jelly")]) == "pass"
    assert records[name("ours.jelly")].value > 0.2
    assert verdict(records[name("ours.jelly")]) == "info"
    assert verdict(records[name("admissible.plasticine")]) == "pass"
    assert verdict(records["nclaw.dissipation.admissible.plasticine.run.created"]) == "pass"
    assert records["nclaw.dissipation.admissible.plasticine.run.taken"].value > 0.0
    assert [row[0] for row in found.rows("nclaw.dissipation", "cycles")[1]] == [
        "true", "ours", "admissible"]


def test_laws_that_must_not_create_energy_miss_if_they_do(tmp_path, monkeypatch):
    stress = network.build_law(neural_toys.trained(response.Stress(1e4), 3))
    records, _ = results(tmp_path, monkeypatch, {
        ("admissible", "jelly"): MaterialLaws(stress, NoFlow())})
    assert verdict(records["nclaw.dissipation.admissible.jelly.cycles.0.1.creating"]) == "miss"


def test_known_laws_are_true_and_trained_ones(monkeypatch):
    def trained(name):
        if name == "sand-admissible":
            raise Untrained("no weights sand-admissible.npz: train")
        return trained_laws.trained("jelly")

    run, said = SimpleNamespace(experiment=dissipation.dissipation.experiment), []
    run.record = lambda target, value, **more: said.append((target, value, more["note"]))
    monkeypatch.setattr(dissipation, "trained", trained)
    laws = dissipation.tested_laws(run)
    assert laws.keys() == {(method, name) for method in ("true", "ours", "admissible")
                           for name in ENVIRONMENTS} - {("admissible", "sand")}
    assert said == [("nclaw.dissipation.untrained", 1, "no weights sand-admissible.npz: train")]
    assert laws["true", "water"] == (Fluid(laws["true", "water"].law.lam), FluidProjection())


def test_old_weights_keep_their_identity():
    """Those of jelly were written before there were admissible laws."""
    assert trained_laws.trained("jelly").about["environment"] == "jelly"
    for name in ("jelly-admissible", "water-admissible"):
        told = trained_laws.identity(trained_laws.nets()[name])
        assert (told["elastic"], told["plastic"]) == ("Energetic", "Contraction")
        assert (told["elastic_rate"], told["plastic_rate"]) == (0.1, 0.01)
