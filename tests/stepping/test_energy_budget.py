"""The energy budget of explicit steps: it closes, its terms mean what they say, no bit changes."""

from dataclasses import replace

import numpy as np
import pytest
from variants import slow_but

from mpm_ref.energy import energy
from mpm_ref.energy_budget import EnergyBudget, Terms
from mpm_ref.scene import build, loads
from mpm_ref.simulate import simulate

MATERIALS = {
    "elastic": '{ law = "fixed_corotated", E = 1e4, nu = 0.3 }',
    "plastic": '{ law = "hencky", E = 1e4, nu = 0.3, flow = { type = "von_mises", sigma_y = 50 } }',
    "fluid": '{ law = "fluid", lam = 1e4 }',
}
TRANSFERS = ('transfer = "mls"', 'transfer = "mls"\nmass_eps = 0.1',
             'transfer = "apic"', 'transfer = "apic"\nrpic = 0.5',
             'transfer = "apic"\nrelaxation = 0.01', 'transfer = "mls"\nrelaxation = 0.01',
             'transfer = "flip"\nflip = 0.9', 'transfer = "pic"', 'transfer = "apic"\nf_bar = true',
             'transfer = "flip"\nflip = 0.9\ngimp = 2')


def scene_text(material="elastic", transfer='transfer = "mls"', extra="", cfl=0.4, end=0.2):
    """A block that falls on a floor with friction."""
    return f"""
dim = 2
dx = 0.1
end = {end}
cfl = {cfl}
gravity = [1.0, -9.8]
[scheme]
{transfer}
[[body]]
name = "block"
density = 1000.0
shape = {{ type = "box", lower = [0.0, 0.02], upper = [0.4, 0.42] }}
velocity = {{ linear = [0.5, -1.0] }}
material = {MATERIALS[material]}
[[collider]]
name = "floor"
kind = "separate"
friction = 0.3
shape = {{ type = "half_space", point = [0.0, 0.0], normal = [0.0, 1.0] }}
{extra}
"""


def run(text, budget=None):
    """The last frame of a scene, and its budget."""
    budget = EnergyBudget() if budget is None else budget
    *_, last = simulate(replace(build(loads(text)), budget=budget))
    return last, budget


@pytest.mark.parametrize("transfer", TRANSFERS)
@pytest.mark.parametrize("material", slow_but(MATERIALS, "elastic"))
def test_the_terms_add_up_to_the_change_of_the_energy(material, transfer):
    _, budget = run(scene_text(material, transfer))
    assert abs(budget.last - budget.first) > 1.0
    assert abs(budget.gap) < 1e-12 * sum(map(abs, budget.terms))


def test_the_run_has_the_same_bits():
    text = scene_text("plastic")
    *_, plain = simulate(build(loads(text)))
    counted, _ = run(text)
    for a, b in zip(plain.state.bodies[0].particles, counted.state.bodies[0].particles,
                    strict=True):
        assert np.asarray(a).tobytes() == np.asarray(b).tobytes()


def test_pic_loses_more_in_the_transfer_than_apic_and_flip_least():
    lost = {kind: -run(scene_text(transfer=f'transfer = "{kind}"'))[1].terms.transfer
            for kind in ("pic", "apic", "flip")}
    assert lost["pic"] > 2.0 * lost["apic"] > 0.0
    assert abs(lost["flip"]) < lost["apic"]


def test_what_a_body_does_not_have_is_zero():
    _, budget = run(scene_text())
    assert budget.terms.plastic == 0.0
    assert budget.terms.clip == pytest.approx(0.0, abs=1e-10)
    _, free = run(scene_text().split("[[collider]]")[0])
    assert free.terms.walls == 0.0


def test_return_maps_and_walls_at_rest_take_energy():
    terms = run(scene_text("plastic"))[1].terms
    assert terms.plastic < 0.0
    assert terms.walls < 0.0


def test_the_error_of_the_time_integration_falls_with_the_step():
    errors = [abs(run(scene_text(cfl=cfl).split("[[collider]]")[0])[1].terms.time)
              for cfl in (0.4, 0.2, 0.1)]
    assert errors[0] > 1.7 * errors[1] > 2.8 * errors[2] > 0.0


def test_a_moving_wall_does_the_work_of_its_force():
    """A sticky floor that lifts a block: weight times height, less what the block brings to it."""
    text = scene_text(extra='motion = { translation = { type = "steady", rate = [0.0, 0.5] } }',
                      end=0.6).replace('kind = "separate"\nfriction = 0.3', 'kind = "sticky"')
    text = text.replace("linear = [0.5, -1.0]", "linear = [0.0, 0.5]").replace("[1.0, ", "[0.0, ")
    last, budget = run(text)
    q = last.state.bodies[0].particles
    gain = 9.8 * q.m.sum() * 0.5 * 0.6
    assert 0.8 < budget.terms.walls / gain < 1.05


def test_the_box_of_positions_has_its_own_term():
    text = scene_text(extra="").replace("[scheme]", "clip = { lower = [-9.0, 0.03], upper = [9.0,"
                                                    " 9.0] }\n[scheme]")
    _, budget = run(text)
    assert budget.terms.clip > 0.0
    assert abs(budget.gap) < 1e-12 * sum(map(abs, budget.terms))


def test_a_step_that_is_tried_again_counts_once():
    problem = replace(build(loads(scene_text())), budget=EnergyBudget())
    stepper = problem.stepper()
    stepper.start(problem.bodies)
    stepper.advance_grid(problem.bodies, 0.0, 0.01)
    stepper.step(problem.bodies, 0.0, 0.005)
    budget = problem.budget
    now = energy(problem.bodies, problem.gravity, problem.inertia).sum
    assert budget.last == now
    assert abs(budget.gap) < 1e-12 * sum(map(abs, budget.terms))


def test_a_resumed_run_begins_its_own_budget():
    problem = build(loads(scene_text()))
    states = simulate(problem)
    next(states)
    *_, last = states
    budget = EnergyBudget()
    later = replace(problem, budget=budget, clock=replace(problem.clock, end=0.3))
    state = last.state
    *_, end = simulate(later, state)
    assert budget.first != 0.0
    assert budget.terms != Terms()
    assert end.t == pytest.approx(0.3)


def test_implicit_steps_are_refused():
    problem = build(loads('integrator = "hot"\n' + scene_text(
        transfer='transfer = "apic"').replace("friction = 0.3", "")))
    with pytest.raises(ValueError, match="energy budget with the integrator"):
        replace(problem, budget=EnergyBudget())
