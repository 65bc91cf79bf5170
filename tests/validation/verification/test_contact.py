"""The measures of verification.contact see what they are for."""

import numpy as np
import pytest

import mpm_ref.body_contact
from mpm_ref.plain.spline import bspline
from validation.verification import contact
from validation.verification.contact import SPEED, disk, graze, half_width, hold, impact, stack


def test_a_disk_has_the_mass_of_the_circle():
    one = disk("disk", (0.3, -0.2), 0.5, 0.025)
    assert one.particles.m.sum() == pytest.approx(contact.RHO * np.pi * 0.25)
    x = np.average(one.particles.x, axis=0, weights=one.particles.m)
    assert x == pytest.approx([0.3, -0.2])


@pytest.mark.parametrize("center", [0.0, 0.37])
def test_the_half_width_of_hertz_loads_is_found(center):
    """Loads that splines spread over the nodes."""
    dx, b = 0.1, 0.32
    x = np.linspace(-b, b, 4001)
    nodes = dx * np.arange(-10, 11)
    w = bspline((x[:, None] + center * dx - nodes) / dx + 1.5, 2)
    load = np.sqrt(b**2 - x**2) @ w
    assert half_width(nodes, load, dx) == pytest.approx(b, rel=1e-4)


def test_disks_bounce_and_glued_ones_feel_each_other_early():
    free, glued = impact(4), impact(4, "stick")
    assert 0.8 < free.restitution < 1.0
    assert abs(free.gap) < 0.2 < 1.0 < glued.gap
    assert 0.1 < free.duration * SPEED / 0.06 < 10.0


def test_impulses_that_are_not_opposite_are_seen(monkeypatch):
    assert max(graze(4)) < 1e-12
    apply = mpm_ref.body_contact.apply_contact
    monkeypatch.setattr(mpm_ref.body_contact, "apply_contact", lambda one, two, *others: apply(
        one, (two[0]._replace(m=1.01 * two[0].m), two[1]), *others))
    assert min(graze(4)) > 1e-3


def test_a_block_that_goes_uphill_is_seen(monkeypatch):
    """Its slope turned under it while it rests."""
    upon_block = contact.upon_block

    def turned(*args):
        bodies, stepper = upon_block(*args)
        stepper.gravity = stepper.gravity * [-3.0, 1.0]
        return bodies, stepper

    monkeypatch.setattr(contact, "upon_block", turned)
    assert hold(4) > 0.1


def test_a_stack_that_acts_at_a_distance_is_seen(monkeypatch):
    assert abs(stack(3, 0.5).gap) < 0.05
    monkeypatch.setattr(contact, "touching", distant(contact.touching))
    assert stack(3, 0.5).gap > 0.3


def distant(touching):
    """A stepper whose bodies stick."""
    def stick(*args, **keys):
        stepper = touching(*args, **keys)
        rule = contact.BodyContact(("lower", "upper"), kind="stick")
        stepper.contacts = (rule,)
        return stepper
    return stick
