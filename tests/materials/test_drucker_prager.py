"""Drucker-Prager: NSF-F3, NCLAW-eq15, NCLAW-eq16."""

from math import radians, sin, sqrt

import numpy as np
import pytest
from constitutive import EPS, LAW, deviator, returned
from flows import kirchhoff_hat, setting, size, stretches, volume

from mpm_ref.materials import make_flow


def test_drucker_prager_regions(d, rng):
    law, flow = setting("drucker_prager", d)
    s = stretches(rng, d)
    out, _, _ = returned(law, flow, s)
    tension = np.log(s).sum(axis=1) > 0
    assert (out[tension] == 1.0).all()                               # NCLAW-X7: tension wins
    tau = kirchhoff_hat(out, law)
    room = -flow.alpha * tau.sum(axis=1) - size(deviator(tau))       # >= 0 in the cone
    assert (room >= -10 * EPS).all()
    moved = ~tension & (out != s).any(axis=1)
    kept = ~tension & ~moved
    assert min(tension.sum(), moved.sum(), kept.sum()) > 5
    assert np.abs(room[moved]).max() < 10 * EPS                      # on the cone
    assert np.abs(volume(out[moved]) / volume(s[moved]) - 1).max() < EPS


def test_drucker_prager_return_is_radial(d, rng):
    law, flow = setting("drucker_prager", d)
    s = stretches(rng, d) * 0.8
    out, _, _ = returned(law, flow, s)
    kept = np.log(out).sum(axis=1) < 0
    before, after = deviator(np.log(s[kept])), deviator(np.log(out[kept]))
    cosine = (before * after).sum(axis=1) / (size(before) * size(after))
    assert np.abs(cosine - 1).max() < EPS


@pytest.mark.parametrize("angle", [20.0, 25.0, 40.0])
def test_drucker_prager_slope_is_mohr_coulomb(angle, d):
    """sigma_1 - sigma_3 = -(sigma_1 + sigma_3) sin(phi) at yield: in every state in 2D, in triaxial
    compression (sigma_1 = sigma_2 > sigma_3) in 3D."""
    alpha = make_flow("drucker_prager", LAW["hencky"], d, friction_angle=angle).alpha
    sine = sin(radians(angle))
    tau = np.array([-(1 - sine), -(1 + sine)] if d == 2 else [-(1 - sine)] * 2 + [-(1 + sine)])
    assert abs(size(deviator(tau)) + alpha * tau.sum()) < EPS


def test_drucker_prager_slopes_of_2d_and_3d_differ():
    """X-cross-15."""
    flat, full = (make_flow("drucker_prager", LAW["hencky"], d, friction_angle=30) for d in (2, 3))
    assert abs(flat.alpha - 0.5 / sqrt(2)) < EPS
    assert abs(full.alpha - sqrt(2 / 3) * 2 * 0.5 / 2.5) < EPS


def test_drucker_prager_at_the_axis(d):
    """No deviator, so that eps_hat / |eps_hat| is 0/0: compression stays, expansion goes to 1."""
    s = np.array([[0.7] * d, [1.3] * d])
    out, _, _ = returned(*setting("drucker_prager", d), s)
    assert (out[0] == s[0]).all()
    assert (out[1] == 1.0).all()


def test_least_stretch_recovers_inverted_sand(d):
    law, flow = setting("drucker_prager", d, s_min=0.05)
    s = np.full((2, d), 0.8)
    s[:, -1] = -0.5, 0.01
    out, _, _ = returned(law, flow, s)
    lifted, _, _ = returned(law, flow, np.where(s < 0.05, 0.05, s))
    assert (out == lifted).all()
    assert (out > 0).all()
