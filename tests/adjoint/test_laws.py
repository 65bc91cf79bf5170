"""What laws and flows give to the adjoint, against exact arithmetic and identities."""

from decimal import Decimal, getcontext

import numpy as np
import pytest
from constitutive import EPS, LAW
from flows import setting

from mpm_ref.core import law as names
from mpm_ref.core.law import d_pressure, gap_ratio, kirchhoff_hat, kirchhoff_vjp, pressure, units

getcontext().prec = 60
GAPS = (0.0, 1e-12, 1e-8, 1e-4, 1e-1)
SHARE = 0.37        # of the deviator that the return leaves


@pytest.fixture(params=LAW)
def law(request):
    return LAW[request.param]


@pytest.mark.parametrize(("derived", "primal"), [
    ("kirchhoff_vjp", "kirchhoff_hat"), ("units", "kirchhoff_hat"), ("d_pressure", "pressure"),
    ("project_vjp", "project"), ("gap_ratio", "project"),
])
def test_what_has_a_function_has_its_adjoint(derived, primal):
    """Learned laws, of F as a whole, have none."""
    assert getattr(names, derived).methods.keys() == getattr(names, primal).methods.keys()


def test_stress_is_the_sum_over_the_moduli(law):
    s = (1.3, 1.1, 0.8)
    parts = [kirchhoff_hat(s, alone) for alone in units(law)]
    assert [tuple(alone) for alone in units(law)] == [tuple(row) for row in np.eye(len(law))]
    assert np.abs(np.array(law) @ parts - kirchhoff_hat(s, law)).max() < 10 * EPS


def test_derivative_of_the_pressure():
    law, J, h = LAW["fluid"], 0.7, 0.5
    difference = (pressure(J + h, law) - pressure(J - h, law)) / (2 * h)    # exact for a quadratic
    assert abs(d_pressure(J, law) - difference) < 10 * EPS


def test_a_symmetric_stress_knows_no_skew_bar(law):
    T = (0.0, 0.3, -0.8), (-0.3, 0.0, 0.5), (0.8, -0.5, 0.0)
    assert np.abs(kirchhoff_vjp((1.3, 1.1, 0.8), T, law)).max() < 10 * EPS


# The quotient of a pair, in 60 digits: s'_i from s'_j, whose mean drops out.

def of_logarithms(s_i, s_j, s_new_j):
    return s_new_j * (s_i / s_j) ** Decimal(SHARE)


def of_squares(s_i, s_j, s_new_j):
    return (s_new_j**2 + Decimal(SHARE) * (s_i**2 - s_j**2)).sqrt()


def of_fixed_corotated(s_i, s_j, s_new_j):
    x = s_new_j * (s_new_j - 1) + Decimal(SHARE) * (s_i - s_j) * (s_i + s_j - 1)
    return Decimal("0.5") + (Decimal("0.25") + x).sqrt()


RETURNS = {
    "drucker_prager": of_logarithms, "von_mises": of_logarithms,
    "von_mises_hardening": of_logarithms, "von_mises_softening": of_logarithms,
    "herschel_bulkley": of_squares, "fixed_corotated_von_mises": of_fixed_corotated,
}


@pytest.mark.parametrize("name", RETURNS)
def test_quotients_of_pairs_have_no_cancellation(name):
    _, flow = setting(name, 2)
    for gap in GAPS:
        s_j, s_new_j = 0.9, 0.95
        s_i = s_j + gap
        wide = Decimal("1e-25") if gap == 0.0 else Decimal(s_i) - Decimal(s_j)
        j, j_new = Decimal(s_j), Decimal(s_new_j)
        i_new = RETURNS[name](j + wide, j, j_new)
        found = gap_ratio((s_i, s_j), (float(i_new), s_new_j), 0, 1, SHARE, flow)
        assert abs(Decimal(found) / ((i_new - j_new) / wide) - 1) < Decimal("1e-15")


def test_quotients_of_a_clamp():
    _, flow = setting("snow_clamp", 2, s_min=0.9, s_max=1.05)
    for s, expected in (((1.0, 0.95), 1.0), ((1.0, 1.0), 1.0), ((1.2, 1.1), 0.0), ((0.5, 0.5), 0.0),
                        ((0.95, 0.85), 0.5), ((1.1, 0.8), 0.5), ((1.06, 1.04), 0.5)):
        assert abs(gap_ratio(s, s, 0, 1, 1.0, flow) - expected) < 100 * EPS
