"""Override values of a scene by their paths.

A path leads into the scene's tables, such as "dx", "gravity[2]" or
"fixed.top.motion.rotation.rate"; items of a list are addressed by index or by name.
"""

import re
from difflib import get_close_matches

import msgspec

from .messages import SceneError
from .validate import validate_scene

STEP = re.compile(r"\[([^\[\]]+)\]|([^.\[\]]+)")


def with_values(scene, values):
    """Return a scene with other values, {path: value}.

    Raises SceneError for a path that does not exist and for a value that does not fit.
    """
    tables = msgspec.json.decode(msgspec.json.encode(scene))
    for path, value in values.items():
        put(tables, path, value)
    return validate_scene(tables)


def put(tables, path, value):
    """Set the value at a path in nested dicts and lists."""
    *parents, last = steps(path)
    for step in parents:
        tables = tables[locate(tables, step, path)]
    tables[locate(tables, last, path)] = value


def steps(path):
    """Return the steps of a path."""
    result = [a or b for a, b in STEP.findall(path)]
    if not result or STEP.sub("", path).strip("."):
        raise SceneError(f"{path!r} is no path into a scene: expected one such as gravity[2] or "
                         "fixed.top.motion.rotation.rate")
    return result


def locate(tables, step, path):
    """Return the key in a table, or the index in a list, that a step of a path names."""
    names = []
    if isinstance(tables, dict):
        names = list(tables)
        if step in names:
            return step
    elif isinstance(tables, list):
        names = [str(item.get("name", k)) if isinstance(item, dict) else str(k)
                 for k, item in enumerate(tables)]
        if step in names:
            return names.index(step)
        if step.isdigit() and int(step) < len(tables):
            return int(step)
    raise SceneError(f"{path!r} leads nowhere in the scene: there is no `{step}`; "
                     + _hint(step, names))


def _hint(step, names):
    near = get_close_matches(step, names, 1)
    if near:
        return f"did you mean `{near[0]}`?"
    return f"there are {', '.join(names)}" if names else "the scene does not give what is before it"


def flat(tables, path=""):
    """Flatten nested tables to {path: value}."""
    result = {}
    for key, value in tables.items():
        where = f"{path}.{key}" if path else key
        result |= flat(value, where) if isinstance(value, dict) else {where: value}
    return result
