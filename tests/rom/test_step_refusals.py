"""What a reduced step does not accept, and how it says so."""

import numpy as np
import pytest
from rom_toys import cloud

from mpm_ref.core.grid import OutOfRange
from mpm_ref.rom.fields.affine import Affine
from mpm_ref.rom.fields.elastic import ElasticMap
from mpm_ref.rom.kinematics import NoBody
from mpm_ref.rom.latent import start_state
from mpm_ref.rom.projection import PositionInversion
from mpm_ref.rom.step import ReducedStepper, ldm_stepper
from tests.rom.test_step import DT, GRAVITY, LAW, learned, quadrature, swinging


def test_names_that_do_not_exist_are_refused(d):
    with pytest.raises(ValueError, match="projection = 'sideways': expected one of linear"):
        learned(d, 2, projection="sideways")
    with pytest.raises(ValueError, match="velocity = 'sideways': expected one of previous"):
        learned(d, 2, velocity="sideways")


@pytest.mark.parametrize("gravity", [np.zeros(1), np.array([np.nan, 0.0, 0.0])])
def test_gravity_of_another_dimension_or_no_number_is_refused(d, gravity):
    X = cloud(d, 150)
    with pytest.raises(ValueError, match=f"expected {d} finite numbers"):
        ldm_stepper(Affine(d), quadrature("lagrangian", X, 2), LAW, gravity[:d])


def test_samples_out_of_the_body_are_no_silent_nothing(d):
    """A body of which nothing is left carries no mass: the step says so."""
    model = learned(d, 2, name="eulerian")
    gone = model.quadrature._replace(distance=lambda X: np.ones(len(X)))
    model = ldm_stepper(model.field.g, gone, LAW, GRAVITY[:d])
    with pytest.raises(NoBody, match="no quadrature point near the 9 samples"):
        model.step(swinging(d)[1], np.arange(9), 0.0, DT)


@pytest.mark.parametrize(("far", "fault"), [(1e9, OutOfRange), (np.nan, NoBody)])
def test_latent_coordinates_that_ran_away_are_said_to_be(d, far, fault):
    X, map = cloud(d, 150), Affine(d)
    model = ldm_stepper(map, quadrature("lagrangian", X, 2), LAW, GRAVITY[:d])
    with pytest.raises(fault):
        model.step(start_state(map.rest + far * np.arange(map.r)), np.arange(9), 0.0, DT)


@pytest.mark.parametrize(("options", "words"), [
    ({"transfer": "mls", "velocity": "latest"}, "velocity = 'latest' with transfer 'mls'"),
    ({"transfer": "flip"}, "transfer = 'flip': expected one of pic, apic, mls"),
])
def test_transfers_and_velocities_that_do_not_fit_are_refused(options, words):
    X = cloud(2, 20)
    with pytest.raises(ValueError, match=words):
        ldm_stepper(Affine(2), quadrature("lagrangian", X, 2), LAW, GRAVITY[:2], **options)


def test_inverted_positions_have_no_mls_transfer():
    X = cloud(2, 20)
    body = quadrature("lagrangian", X, 2)
    with pytest.raises(ValueError, match="transfer = 'mls': expected one of pic, apic"):
        ReducedStepper(ElasticMap(Affine(2), LAW), body, PositionInversion(), GRAVITY[:2],
                       transfer="mls")
