"""A study file as its tables: keys that they do not have are refused in one sentence."""

from difflib import get_close_matches

import msgspec

from ...scene import SceneError
from ...scene.messages import joined, rephrase, shown
from ...scene.validate import check_finite
from .tables import LDM, TABLES, Parameter


def parse_tables(data):
    """Return the `TABLES` of a study's method from plain tables. Raises SceneError, which names the
    key.
    """
    check_finite(data)
    model = data.get("model", LDM)
    if not isinstance(model, str) or model not in TABLES:
        raise SceneError(f"model = {shown(model)}: expected one of {', '.join(map(repr, TABLES))}")
    for k, path in enumerate(("", "map", "run")):
        others = {name: records[k].__struct_encode_fields__ for name, records in TABLES.items()}
        keys = others.pop(model)
        require_keys(data.get(path) if path else data, keys, path, others)
    varied = data.get("parameter")
    for k, part in enumerate(varied if isinstance(varied, list) else ()):
        require_keys(part, Parameter.__struct_encode_fields__, f"parameter[{k}]")
    try:
        tables = msgspec.convert(data, TABLES[model][0])
    except msgspec.ValidationError as fault:
        raise SceneError(rephrase(str(fault), data)) from None
    kind, kinds = tables.reduced_model.kind, tables.reduced_model.keys
    for key in sorted(set(data["map"]) - {"kind", "r", *kinds[kind]}):
        other = next(other for other, keys in kinds.items() if key in keys)
        raise SceneError(f'map.{key}: given, but the kind is "{kind}"; remove it, or take '
                         f'kind = "{other}"')
    return tables


def require_keys(table, allowed, path="", others=None):
    """Raise SceneError for a key of a table that is not allowed; others: {model: keys} of the same
    table of other methods.
    """
    for key in table if isinstance(table, dict) else ():
        if key not in allowed:
            hint = key_hint(key, allowed, others or {})
            raise SceneError(f"{joined(path, key)}: unknown key; {hint}")


def key_hint(key, allowed, others):
    """Return a sentence on the likely meaning of an unknown key."""
    if near := get_close_matches(key, allowed, 1):
        return f"did you mean `{near[0]}`?"
    for model, keys in others.items():
        if key in keys:
            return f'it is one of model = "{model}": say so at the top of the study, or remove it'
    return f"the keys here are {', '.join(allowed)}"
