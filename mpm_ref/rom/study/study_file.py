"""A study file as its tables: what it gives that they do not know is refused in one sentence."""

import tomllib
from difflib import get_close_matches

import msgspec

from ...scene import SceneError
from ...scene.messages import joined, rephrase
from ...scene.validate import check_finite
from . import nsf_tables as nsf
from . import tables as ldm
from .tables import LDM, NSF, Parameter

MODELS = {LDM: (ldm.Tables, ldm.Map, ldm.Run), NSF: (nsf.Tables, nsf.Fields, nsf.Run)}


def plain(path):
    """The plain tables of a TOML file. Raises SceneError, which names it."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as fault:
        raise SceneError(f"{path}: cannot be read ({fault.strerror})") from None
    except ValueError as fault:
        raise SceneError(f"{path}: not valid TOML: {fault}") from None


def checked(data):
    """`Tables` of plain tables, those of its model. Raises SceneError, which names the key."""
    check_finite(data)
    model = data.get("model", LDM)
    if not isinstance(model, str) or model not in MODELS:
        raise SceneError(f"model = {model!r}: expected one of {', '.join(map(repr, MODELS))}")
    whole = MODELS[model][0]
    for k, path in enumerate(("", "map", "run")):
        others = {name: records[k].__struct_encode_fields__ for name, records in MODELS.items()}
        own = others.pop(model)
        require_keys(data.get(path) if path else data, own, path, others)
    varied = data.get("parameter")
    for k, part in enumerate(varied if isinstance(varied, list) else ()):
        require_keys(part, Parameter.__struct_encode_fields__, f"parameter[{k}]")
    try:
        tables = msgspec.convert(data, whole)
    except msgspec.ValidationError as fault:
        raise SceneError(rephrase(str(fault), data)) from None
    kind, known = tables.map.kind, tables.map.keys
    for key in sorted(set(data["map"]) - {"kind", "r", *known[kind]}):
        other = next(other for other, keys in known.items() if key in keys)
        raise SceneError(f'map.{key}: given, but the kind is "{kind}"; remove it, or take '
                         f'kind = "{other}"')
    return tables


def require_keys(table, known, path="", elsewhere=None):
    """Raise SceneError for a key of a table that is none of those known; elsewhere: {model: keys}
    of the same table of other models.
    """
    for key in table if isinstance(table, dict) else ():
        if key not in known:
            meant = hint(key, known, elsewhere or {})
            raise SceneError(f"{joined(path, key)}: unknown key; {meant}")


def hint(key, known, elsewhere):
    """What may have been meant by an unknown key."""
    if near := get_close_matches(key, known, 1):
        return f"did you mean `{near[0]}`?"
    for model, keys in elsewhere.items():
        if key in keys:
            return f'it is one of model = "{model}": say so at the top of the study, or remove it'
    return f"the keys here are {', '.join(known)}"
