"""The scenes that come with the package, by their bare names."""

from pathlib import Path

from ..scene import SceneError

PACKAGE = Path(__file__).resolve().parents[1]


def shipped_scenes():
    """{name: path} of the scenes that come with the package; none if they were not installed."""
    places = [PACKAGE / "scenes"]
    if (PACKAGE.parent / "pyproject.toml").exists():          # run from a clone
        places.append(PACKAGE.parent / "scenes")
    return {file.stem: file for place in places for file in sorted(place.glob("*.toml"))}


def find_scene(name):
    """Path of a scene given by its file, or the bare name of a shipped one. Raises SceneError."""
    if Path(name).is_file():
        return Path(name)
    scenes = shipped_scenes()
    if name in scenes:
        return scenes[name]
    known = ", ".join(scenes) or "not installed"
    raise SceneError(f"{name}: there is no such file, nor a shipped scene of that name; shipped "
                     f"scenes: {known}")
