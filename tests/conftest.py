import numpy as np
import pytest
from hypothesis import settings

# Compiling a kernel may take seconds, hence no deadline; the same examples in every run.
settings.register_profile("mpm_ref", deadline=None, derandomize=True)
settings.load_profile("mpm_ref")


@pytest.fixture(params=(2, 3), ids=("2d", "3d"))
def d(request):
    """Space dimension."""
    return request.param


@pytest.fixture
def rng():
    return np.random.default_rng(0)
