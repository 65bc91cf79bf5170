"""Find the bundled scenes and studies by their names."""

from difflib import get_close_matches
from pathlib import Path

from ..scene import SceneError
from ..store.checksums import has_head

HDF5 = b"\x89HDF\r\n\x1a\n"      # how such files begin, but for results
LISTS = {"scenes": "scenes", "studies of reduced models": "rom studies",      # commands
         "studies of laws": "law studies"}
LONGEST = 100                    # characters of a name that are compared with others
SCENES = (".toml", ".json")      # suffixes of their files
PACKAGE = Path(__file__).resolve().parents[1]


def bundled_scenes():
    """Return {name: path} of the bundled scenes, empty if they are not installed."""
    return _bundled("scenes")


def bundled_studies():
    """Return {name: path} of the bundled studies, empty if they are not installed."""
    return _bundled("studies")


def _bundled(folder):
    places = [PACKAGE / folder]
    if (PACKAGE.parent / "pyproject.toml").exists():          # run from a clone
        places.append(PACKAGE.parent / folder)
    return {file.stem: file for place in places for file in sorted(place.glob("*.toml"))}


def find_scene(name):
    """Return the path of a scene, given by its file or a bundled name. Raises SceneError."""
    file = Path(name)
    if file.suffix.lower() == ".npz" and file.is_file():
        what = "the file is empty" if file.stat().st_size == 0 else "the file is no scene"
        raise SceneError(f"{name}: {what}; expected a scene (a TOML file or a bundled name), "
                         "or for `mpm-ref info` a map or laws, as `mpm-ref rom train` and "
                         "`mpm-ref law train` write them")
    if file.suffix.lower() in (".h5", ".hdf5"):
        raise SceneError(f"{name}: {_wrong_with(file)}; expected a scene (a TOML file or a bundled "
                         "name), or for `mpm-ref info` what `mpm-ref run` wrote")
    if file.is_file():
        return file
    scenes = bundled_scenes()
    if name in scenes:
        return scenes[name]
    if file.is_dir():
        raise SceneError(f"{name}: this is a folder; expected a scene (a TOML file or a bundled "
                         "name), or for `mpm-ref info` what `mpm-ref run` wrote")
    raise SceneError(f"{name}: there is no such file, nor a bundled scene of that name; "
                     f"{_meant(name, scenes, 'scenes')}")


def find_study(name, kind, is_kind):
    """Return the path of a study, given by its file or a bundled name. Raises SceneError, which
    names the studies of a kind: a key of LISTS, and whether a path is one.
    """
    if Path(name).is_file():
        return Path(name)
    studies = bundled_studies()
    if name not in studies:
        others = {other: path for other, path in studies.items() if is_kind(path)}
        raise SceneError(f"{name}: there is no such file, nor a bundled study of that name; "
                         f"{_meant(name, others, kind)}")
    return studies[name]


def _meant(name, bundled, what):
    """Return the bundled name that is nearest to a name, or all of them."""
    if near := get_close_matches(name[:LONGEST], bundled, 1):
        return f"did you mean {near[0]}? `mpm-ref {LISTS[what]}` lists all {what}"
    return f"bundled {what}: {', '.join(bundled) or 'not installed'}"


def study_named(name):
    """Return the path of a file or of a bundled study; a bundled scene of that name goes first."""
    path = Path(name)
    return path if path.is_file() or name in bundled_scenes() else bundled_studies().get(name, path)


def require_other_file(path, out):
    """Raise ValueError if the file to write is the scene at `path`, or is named like a scene."""
    if Path(out).exists() and path.samefile(out):
        raise ValueError(f"--out {out}: this is the scene itself; name another file")
    if Path(out).suffix.lower() in SCENES:
        raise ValueError(f"--out {out}: scenes have such names, but HDF5 is to be written; name a "
                         "file such as run.h5")


def _wrong_with(file):
    """Why a file named as HDF5 files are is no scene, nor results."""
    if not file.is_file():
        return "there is no such file"
    if is_hdf5(file):
        return "an HDF5 file is no scene"
    return "the file is empty" if file.stat().st_size == 0 else "the file does not hold HDF5"


def is_hdf5(name):
    """Return whether a name is that of results, or of another file with HDF5's signature."""
    if not Path(name).is_file():
        return False
    if has_head(name):
        return True
    with open(name, "rb") as file:
        return file.read(len(HDF5)) == HDF5
