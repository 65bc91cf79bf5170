"""A seal of a model's arrays: any flipped bit of any array shows, and nothing else does."""

import numpy as np
import pytest
import rom_toys
from scipy.spatial import KDTree

from mpm_ref.rom.fields.pod import PodModes
from mpm_ref.rom.fields.pod_fields import Cells, ModalField, PodFields
from mpm_ref.rom.fields.radial_basis import Radial
from mpm_ref.rom.integrity import DamagedModel, damaged_arrays, require_intact, seal
from mpm_ref.rom.model_file import flatten


def fields():
    """Fields of random arrays; no run could use them."""
    rng = np.random.default_rng(0)
    radial = Radial(*(rng.normal(size=(2, 2)) for _ in Radial._fields))
    part = ModalField(rng.normal(size=(3, 2, 2)), radial)
    return PodFields(rng.normal(size=(3, 3)), rng.normal(size=(3, 3, 2)), radial, part, part,
                     rng.normal(size=2), Cells(*(np.arange(3) for _ in Cells._fields)))


ARRAYS = [name for name, _ in flatten(fields())]


def flip(field, name, bit):
    """Flip a bit of the last byte of an array, in place."""
    a = dict(flatten(field))[name]
    a.view(np.uint8).reshape(-1)[-1] ^= np.uint8(1 << bit)


def test_a_model_is_intact_and_so_is_its_copy():
    assert damaged_arrays(fields(), seal(fields())) == []
    require_intact(fields(), seal(fields()))


@pytest.mark.parametrize("name", ARRAYS)
def test_any_flipped_bit_shows_and_is_named(name):
    for bit in (0, 3, 7):
        field = fields()
        before = seal(field)
        flip(field, name, bit)
        others = [one for one in ARRAYS if one != name]
        found = damaged_arrays(field, before)
        assert name in found
        assert not [one for one in others if one in found
                    and not np.shares_memory(dict(flatten(field))[one],
                                             dict(flatten(field))[name])]
        with pytest.raises(DamagedModel, match=f"changed in memory: .*{name}"):
            require_intact(field, before)
        flip(field, name, bit)
        assert damaged_arrays(field, before) == []


def test_shape_and_type_count():
    X, U = rom_toys.cloud(3, 4), np.zeros((4, 3, 2))
    modes = PodModes(X, U, np.zeros((4, 3, 3, 2)), KDTree(X))
    before = seal(modes)
    assert damaged_arrays(modes._replace(U=U.reshape(4, 2, 3)), before) == ["U"]
    assert damaged_arrays(modes._replace(U=U.astype(np.float32)), before) == ["U"]


def test_objects_that_are_no_records_have_no_seal():
    assert seal(object()) == {}
