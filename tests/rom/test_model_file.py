"""Reduced models as files: nothing is lost, and nothing damaged or foreign is taken for one."""

import time
from datetime import datetime, timedelta

import numpy as np
import pytest
import rom_toys
from damaged import changed, refused, without
from hypothesis import given
from hypothesis import strategies as st

from mpm_ref.rom import model_file
from mpm_ref.rom.model_file import Model, arrays_of, load, save
from mpm_ref.store.weights_file import checksum, header, pack

ABOUT = {"seed": 3, "command": "train ldm", "weights": {"F": 1.0 / 30.0, "v": 0.08},
         "runs": [0.1, 1e-300, 2], "scene": "Ärmel \0 \n\"", "noted": None, "free": True}


def model(dim=3, r=2, seed=0):
    rng = np.random.default_rng(seed)
    return Model(rom_toys.decoder(dim, r, seed), rng.normal(size=(4, 3, r)), rng.normal(size=r),
                 ABOUT)


def file_of(model):
    """The arrays that are written."""
    return header("map.npz", model_file.FORMAT, model.about) | arrays_of(model)


def flat(model):
    """All arrays of a model."""
    return [*model.field.net, *model.field.units, model.xhat, model.rest]


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    path = tmp_path_factory.mktemp("saved") / "map.npz"
    save(path, model())
    return path


# What is written.

def test_a_model_comes_back_bit_for_bit(tmp_path, d):
    save(tmp_path / "map.npz", model(d))
    back = load(tmp_path / "map.npz")
    for a, b in zip(flat(back), flat(model(d)), strict=True):
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
    assert back.about == ABOUT
    X = rom_toys.cloud(d, 10)
    for a, b in zip(back.field.derivatives(X, back.rest),
                    model(d).field.derivatives(X, back.rest), strict=True):
        np.testing.assert_array_equal(a, b)


def test_sizes_may_be_short_integers(saved):
    """Their products are not."""
    assert 20 * 20 > np.iinfo(np.int8).max
    big = model()._replace(field=rom_toys.decoder(3, 2, hidden=(20, 20)))
    short = file_of(big) | {"net.sizes": np.array([5, 20, 20, 3], dtype=np.int8)}
    path = saved.with_name("short.npz")
    path.write_bytes(pack(short))
    X = rom_toys.cloud(3, 5)
    np.testing.assert_array_equal(load(path).field.place(X, big.rest),
                                  big.field.place(X, big.rest))


def test_equal_content_gives_equal_bytes(saved, monkeypatch):
    later = time.mktime((datetime.now() + timedelta(days=400)).timetuple())
    monkeypatch.setattr(time, "time", lambda: later)
    again = saved.with_name("again.npz")
    save(again, model()._replace(about=dict(reversed(ABOUT.items()))))
    assert again.read_bytes() == saved.read_bytes()
    save(again, model()._replace(about={**ABOUT, "seed": 4}))
    assert again.read_bytes() != saved.read_bytes()


def test_a_file_is_a_plain_npz(saved):
    with np.load(saved, allow_pickle=False) as file:
        assert str(file["format"]) == model_file.FORMAT
        assert '"seed": 3' in str(file["about"])
        np.testing.assert_array_equal(file["net.W"], model().field.net.W)


@pytest.mark.parametrize("broken", ["os.replace", "os.fsync"])
def test_where_the_system_refuses_the_old_file_stands(tmp_path, monkeypatch, broken):
    path = tmp_path / "map.npz"
    save(path, model())
    before = path.read_bytes()

    def refuse(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(broken, refuse)
    with pytest.raises(OSError, match=r"map\.npz could not be written: No space left"):
        save(path, model(seed=1))
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with pytest.raises(OSError, match=r"there is no folder .*; create it"):
        save(tmp_path / "none" / "map.npz", model())


# What is refused.

@given(place=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_any_flipped_bit_is_told(saved, place, bit):
    damaged = bytearray(saved.read_bytes())
    damaged[int(place * len(damaged))] ^= 1 << bit
    copy = saved.with_name("damaged.npz")
    copy.write_bytes(damaged)
    refused(load, copy, "is damaged, cut short|is not an npz file")


@given(st.floats(0, 1, exclude_max=True))
def test_any_cut_is_told(saved, share):
    content = saved.read_bytes()
    copy = saved.with_name("cut.npz")
    copy.write_bytes(content[:int(share * len(content))])
    refused(load, copy, "is damaged, cut short|is not an npz file")


@pytest.mark.parametrize("added", [b"\0", b"PK\5\6", b"0" * 64])
def test_bytes_behind_the_end_are_told(saved, added):
    copy = saved.with_name("longer.npz")
    copy.write_bytes(saved.read_bytes() + added)
    refused(load, copy, "is damaged")


def test_foreign_files_are_told(tmp_path):
    refused(load, tmp_path / "none.npz", "cannot be read: No such file")
    refused(load, tmp_path, "cannot be read: Is a directory")
    text = tmp_path / "text.npz"
    text.write_text("not a map")
    refused(load, text, "is not an npz file")
    np.save(tmp_path / "one.npy", np.arange(3))
    refused(load, tmp_path / "one.npy", "is not an npz file")
    np.savez(tmp_path / "other.npz", W=np.arange(3))
    refused(load, tmp_path / "other.npz", "none of ours: its checksum does not fit")


def test_nothing_is_unpickled(tmp_path):
    class Trap:
        def __reduce__(self):
            return pytest.fail, ("unpickled",)

    trap = np.empty(1, dtype=object)
    trap[0] = Trap()
    path = tmp_path / "trap.npz"
    path.write_bytes(pack({**file_of(model()), "format": trap}))
    refused(load, path, "allow_pickle=False")


def test_a_sealed_file_that_is_no_archive_is_told(saved):
    content = saved.read_bytes()[:-500]
    copy = saved.with_name("short.npz")
    copy.write_bytes(content + checksum(content))
    refused(load, copy, "is no archive of plain arrays")


@pytest.mark.parametrize(("about", "said"), [
    ('{"seed": 3', "about is no JSON"), ("", "about is no JSON"), ("[3]", "about is a list"),
])
def test_a_file_that_says_nothing_of_its_map_is_told(tmp_path, about, said):
    path = tmp_path / "map.npz"
    path.write_bytes(pack({**file_of(model()), "about": np.array(about)}))
    refused(load, path, said)


def test_another_format_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(model_file, "FORMAT", "reduced model 2")
    save(tmp_path / "map.npz", model())
    monkeypatch.undo()
    refused(load, tmp_path / "map.npz",
            "has format reduced model 2, this program reads reduced model 1; use the version")


@pytest.mark.parametrize("kept", [[1, 1], [1], [], "1", 1.5, None])
def test_what_is_no_format_is_told(kept, tmp_path):
    found = {} if kept is None else {"format": np.array(kept)}
    path = tmp_path / "map.npz"
    path.write_bytes(pack(without("format")(file_of(model())) | found))
    said = "has format .*, this program reads reduced model 1; |holds no reduced model, format"
    with pytest.raises(ValueError, match=rf"map\.npz ({said})"):
        load(path)


def sized(sizes):
    """The arrays of a file with other widths of layers."""
    return changed(**{"net.sizes": sizes})


FAULTS = {
    "lacks net.W, net.b": without("net.W", "net.b"),
    "its kind is cake, expected one of network, ": changed(kind="cake"),
    "has format None": without("format"),
    r"W has shape \(140,\), expected \(141,\)": changed(**{"net.W": lambda W: W[1:]}),
    r"b has shape \(21,\), expected \(20,\)": changed(**{"net.b": lambda b: np.append(b, 0.0)}),
    r"low has shape \(2,\), expected \(3,\)": changed(**{"units.low": lambda a: a[:2]}),
    r"xhat has shape \(4, 3, 1\), expected \(4, 3, 2\)": changed(xhat=lambda a: a[..., :1]),
    r"xhat has shape \(12, 2\), expected \('runs', 'levels', 2\)": changed(
        xhat=lambda a: a.reshape(12, 2)),
    r"rest has shape \(3,\), expected \(2,\)": changed(rest=np.zeros(3)),
    r"layers of net.sizes \[3, 9, 8, 3\]": sized([3, 9, 8, 3]),
    r"sizes is an array of shape .* \[5, 0, 8, 3\]: expected whole": sized([5, 0, 8, 3]),
    r"net.sizes is an array of shape .* \[\]: expected": sized(np.array([], dtype=int)),
    r"net.sizes is an array of .* \[5, -9, 8, 3\]: expected": sized([5, -9, 8, 3]),
    r"layers of net.sizes \[3, 3, .*, 3, \.\. 9999 in all\]: expected d \+ r, \.\., d": sized(
        np.full(9999, 3)),
    r"sizes is an array of shape \(4,\) and type float": sized(
        lambda a: a + 0.5),
    r"sizes is an array of shape \(2, 2\)": sized(lambda a: a.reshape(2, 2)),
    r"sizes is an array of shape \(\)": sized(5),
    r"sizes is an array of shape \(4,\) and type <U": sized(lambda a: a.astype(str)),
    "W is of type <U.*, expected floating-point": changed(**{"net.W": lambda W: W.astype(str)}),
    "rest is of type int64": changed(rest=np.zeros(2, dtype=int)),
    r"net.sizes is an array of shape .* \[5\]: expected": sized([5]),
    "W has numbers that are not finite": changed(
        **{"net.W": lambda W: np.where(W > 0, W, np.nan)}),
    "xhat has numbers that are not finite": changed(xhat=lambda a: a / 0.0),
    "units.std has numbers that are not positive": changed(**{"units.std": lambda a: 0.0 * a}),
}


@pytest.mark.filterwarnings("ignore:divide by zero")
@pytest.mark.parametrize(("said", "change"), FAULTS.items(), ids=FAULTS.keys())
def test_a_sound_file_of_something_else_is_told(tmp_path, said, change):
    path = tmp_path / "map.npz"
    path.write_bytes(pack(change(file_of(model()))))
    refused(load, path, said)


@pytest.mark.parametrize(("change", "said"), [
    ({"rest": np.array([0.0, np.nan])}, "is not written: rest has numbers that are not finite"),
    ({"xhat": np.zeros((4, 3, 5))}, r"is not written: xhat has shape \(4, 3, 5\), expected"),
    ({"about": {"x": np.zeros(2)}}, r"is not written: about: Object of type nd.*; give numbers"),
    ({"about": {"x": np.nan}}, "is not written: about: Out of range float"),
])
def test_what_could_not_be_read_is_not_written(tmp_path, change, said):
    with pytest.raises(ValueError, match=said):
        save(tmp_path / "map.npz", model()._replace(**change))
    assert list(tmp_path.iterdir()) == []
