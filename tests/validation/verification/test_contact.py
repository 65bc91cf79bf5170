"""The measures of verification.contact see what they are for."""

import numpy as np
import pytest

from mpm_ref.plain.spline import bspline
from validation.verification import contact
from validation.verification.contact import SPEED, disk, half_width, impact, stack


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
    assert free.drift < 1e-13
    assert 0.8 < free.restitution < 1.0
    assert abs(free.gap) < 0.2 < 1.0 < glued.gap
    assert 0.1 < free.duration * SPEED / 0.06 < 10.0


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
