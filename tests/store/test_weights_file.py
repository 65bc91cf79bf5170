"""Files of weights that come along: what is read of them is written again to the same bytes."""

from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from mpm_ref.materials.learned import weights as of_laws
from mpm_ref.nclaw.gnn import weights as of_graphs
from mpm_ref.rom import model_file
from mpm_ref.rom.fields.pod import PodModes
from mpm_ref.rom.model_file import Model
from mpm_ref.store.weights_file import header, read, write
from validation.nclaw import bundle
from validation.nclaw.small_trainings import small_nets

VALIDATION = Path(__file__).parents[2] / "validation"
COMMITTED = [(of_graphs if "-gnn" in path.stem else bundle if path.stem in small_nets() else module,
              path)
             for module, folder in ((model_file, "ldm"), (of_laws, "nclaw"), (model_file, "nsf"))
             for path in sorted((VALIDATION / folder / "weights").glob("*.npz"))]


def members(path):
    """Names, dates, compression and bytes of the members of an archive; what else it has depends on
    Python's version.
    """
    with ZipFile(path) as archive:
        return [(one.filename, one.date_time, one.compress_type, archive.read(one))
                for one in archive.infolist()]


@pytest.mark.parametrize(("module", "path"), COMMITTED, ids=lambda a: getattr(a, "stem", ""))
def test_committed_weights_are_written_again_to_the_same_bytes(tmp_path, module, path):
    module.save(tmp_path / "again.npz", module.load(path))
    assert members(tmp_path / "again.npz") == members(path)


def test_arrays_come_back_with_how_they_were_made(tmp_path):
    path, about = tmp_path / "a.npz", {"seed": 1, "runs": (1, 2), "noted": None}
    x = np.array([0.1, 1e-300, np.nan])
    write(path, {"x": x, **header(path, "toys 1", about)}, lambda arrays: None)
    arrays, found = read(path, "toys 1", lambda arrays: None, "toys")
    assert arrays["x"].tobytes() == x.tobytes()
    assert found == about | {"runs": [1, 2]}


def test_a_fault_is_told_on_writing_and_on_reading(tmp_path):
    path = tmp_path / "a.npz"
    arrays = header(path, 1, {})
    with pytest.raises(ValueError, match=r"a\.npz is not written: it lacks x$"):
        write(path, arrays, lambda found: "it lacks x" if "x" not in found else None)
    assert not list(tmp_path.iterdir())
    write(path, arrays, lambda found: None)
    with pytest.raises(ValueError, match=r"a\.npz holds no toys: it lacks x; train again$"):
        read(path, 1, lambda found: "it lacks x", "toys")
    with pytest.raises(ValueError, match=r"a\.npz has format 1, this program reads 2; use the"):
        read(path, 2, lambda found: "it lacks x", "toys")


@pytest.mark.parametrize(("format", "asked", "said"), [
    ("gnn 2", 1, "holds no toys, format 1: its format, gnn 2, is that of graph networks; name "),
    ("mpm_ref law 1", "gnn 1", "holds no toys, format gnn 1: .*, is that of layers of exported l"),
    (1, "gnn 1", "holds no toys, format gnn 1: its format, 1, is that of laws; name"),
    ("gnn 2", "gnn 1", "has format gnn 2, this program reads gnn 1; use the version that wrote"),
    ("cake 7", 1, "has format cake 7, this program reads 1; "),
])
def test_files_of_another_kind_are_told_as_such(tmp_path, format, asked, said):
    path = tmp_path / "a.npz"
    write(path, header(path, format, {}), lambda found: None)
    with pytest.raises(ValueError, match=rf"a\.npz {said}"):
        read(path, asked, lambda found: None, "toys")


@pytest.mark.parametrize("save", [model_file.save, bundle.save])
def test_what_json_does_not_know_is_refused_with_the_file(tmp_path, save):
    about = {"x": np.zeros(2)}
    modes = PodModes(np.zeros((5, 2)), np.zeros((5, 2, 3)), np.zeros((5, 2, 2, 3)), None)
    made = bundle.Bundle({}, about) if save is bundle.save else Model(
        modes, np.zeros((1, 2, 3)), np.zeros(3), about)
    with pytest.raises(ValueError, match=r"a\.npz is not written: about: Object of type ndarray"):
        save(tmp_path / "a.npz", made)
    assert not list(tmp_path.iterdir())
