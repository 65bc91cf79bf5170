import sys

import numpy as np
import pytest
from command_line import SCENE, mpm_ref
from goldens import checker, recorded
from hidden_torch import hide
from hypothesis import settings

# Compiling a kernel may take seconds, hence no deadline; the same examples in every run.
settings.register_profile("mpm_ref", deadline=None, derandomize=True)
settings.load_profile("mpm_ref")


@pytest.fixture(params=(2, 3), ids=("2d", "3d"))
def d(request):
    """Space dimension."""
    return request.param


@pytest.fixture(autouse=True)
def no_figure_stays_open():
    """Matplotlib warns of more than 20, and which tests share a process is up to pytest-xdist."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.fixture
def scene(tmp_path):
    """File of a small scene."""
    path = tmp_path / "disk.toml"
    path.write_text(SCENE)
    return path


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Results of that scene."""
    folder = tmp_path_factory.mktemp("finished")
    (folder / "disk.toml").write_text(SCENE)
    done = mpm_ref("run", folder / "disk.toml", "--out", folder / "run.h5", "--quiet")
    assert done.exit_code == 0, done.output
    return folder / "run.h5"


@pytest.fixture(scope="module")
def golden(tmp_path_factory):
    """A golden file of two disks."""
    return recorded(tmp_path_factory.mktemp("golden"))


@pytest.fixture
def checked(golden, tmp_path):
    """A function that checks arrays against the golden file."""
    return checker(golden, tmp_path / "other.h5")


@pytest.fixture
def one_torch_thread():
    """PyTorch on one thread."""
    torch = pytest.importorskip("torch")
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture
def doubles_by_default():
    """PyTorch makes tensors of doubles."""
    torch = pytest.importorskip("torch")
    before = torch.get_default_dtype()
    torch.set_default_dtype(torch.float64)
    yield
    torch.set_default_dtype(before)


@pytest.fixture
def double(monkeypatch):
    """Networks of doubles read doubles."""
    torch = pytest.importorskip("torch")
    monkeypatch.setattr(torch.Tensor, "float", torch.Tensor.double)


@pytest.fixture
def without_torch(monkeypatch):
    """As if PyTorch were not installed."""
    hide(monkeypatch)
