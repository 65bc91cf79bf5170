"""Errors of a scene: one sentence that begins with the key and its value."""

import re
from contextlib import contextmanager
from difflib import get_close_matches
from types import UnionType
from typing import Literal, Union, get_args, get_origin, get_type_hints

from msgspec import Struct

from .records import Scene

SHOWN = 60          # characters of a value
WORDS = {"float": "a number", "int": "a whole number", "str": "text", "bool": "true or false",
         "array": "a list", "object": "a table"}
TYPES = {float: "a number", int: "a whole number"}
# A sentence about one key: "nu = 0.6: expected ...", or with what it belongs to before it.
OF_A_KEY = re.compile(r"(?:\w+ '[^']*': )?(?=[\w\[\]]+ = )")


class SceneError(ValueError):
    """A scene that cannot be run; the message is one sentence that begins with the key's path."""

    def __init__(self, message):
        super().__init__(" ".join(str(message).split()))


def joined(path, key):
    """Path of a key of the table at `path`."""
    return f"{path}.{key}" if path else str(key)


def placed(path, sentence):
    """The sentence with the path before it; a key that it begins with joins the path."""
    of_a_key = OF_A_KEY.match(sentence)
    if of_a_key:
        return joined(path, sentence[of_a_key.end():])
    return f"{path}: {sentence}" if path else sentence


@contextmanager
def at(path):
    """Within this context a ValueError becomes a SceneError that begins with `path`."""
    try:
        yield
    except SceneError:
        raise
    except ValueError as fault:
        raise SceneError(placed(path, str(fault))) from None


@contextmanager
def opened_by(source):
    """Within this context the sentences of SceneErrors begin with `source`, unless it is empty."""
    try:
        yield
    except SceneError as fault:
        if not source:
            raise
        raise SceneError(f"{source}: {fault}") from None


def shown(value):
    """A value as text, not too long."""
    try:
        text = repr(value)
    except ValueError:          # a whole number of thousands of digits
        text = "a huge number"
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def rephrase(message, data):
    """The sentence for a message of msgspec about plain tables."""
    said, _, where = message.rpartition(" - at `$")
    said, where = (said, where.rstrip("`").lstrip(".")) if said else (where, "")
    steps = [int(step) if step.isdigit() else step for step in re.findall(r"[^.\[\]]+", where)]
    key = re.fullmatch(r"Object (contains unknown|missing required) field `(.*)`", said, re.DOTALL)
    if key:
        about = _unknown if key[1] == "contains unknown" else _missing
        return about(where, key[2], _types_at(steps, data))
    value = _follow(data, steps)
    if said.startswith("Invalid"):
        return f"{where} = {shown(value)}: expected {_choices(steps, data)}"
    if said.startswith("Expected"):
        said = re.sub(r"`([a-z| ]+)`", _in_words, said.partition(", got")[0])
        return f"{where or 'the scene'} = {shown(value)}: e{said[1:]}"
    return placed(where, said)


def _unknown(where, key, types):
    known = sorted({name for kind in types if _is_record(kind) for name in _keys(kind)})
    near = get_close_matches(key, known, 1)
    hint = f"did you mean `{near[0]}`?" if near else f"the keys here are {', '.join(known)}"
    return f"{joined(where, shown(key)[1:-1])}: unknown key; {hint}"


def _missing(where, key, types):
    if key == "type":
        return f"{where}: the key `type` is missing; it is one of {_tags(types)}"
    return f"{joined(where, key)}: this key is missing"


def _in_words(match):
    return " or ".join(WORDS.get(word, word) for word in match[1].split(" | ") if word != "null")


def _choices(steps, data):
    """What a key that has a few values may be."""
    kinds = _types_at(steps, data)
    values = [repr(value) for kind in kinds if get_origin(kind) is Literal
              for value in get_args(kind)]
    values += [TYPES[kind] for kind in kinds if kind in TYPES]
    return f"one of {', '.join(values) or _tags(_types_at(steps[:-1], data))}"


# the types of the records along a path

def _types_at(steps, data):
    """Types that the value at a path may have; tables by their `type` where they say it."""
    kinds = [Scene]
    for step in steps:
        kinds = [part for kind in kinds for part in _parts(kind, step)]
        data = _follow(data, [step])
        named = data.get("type") if isinstance(data, dict) else None
        kinds = [kind for kind in kinds if named is not None and _tag(kind) == named] or kinds
    return kinds


def _parts(kind, step):
    """Types of an item of a list, or of a key of a table."""
    if isinstance(step, int):
        return _flat(get_args(kind)[0]) if get_origin(kind) is tuple else []
    here = step in getattr(kind, "__struct_fields__", ())
    return _flat(get_type_hints(kind)[step]) if here else []


def _flat(kind):
    """The members of a union."""
    if get_origin(kind) in (Union, UnionType):
        return [part for member in get_args(kind) for part in _flat(member)]
    return [kind]


def _is_record(kind):
    return isinstance(kind, type) and issubclass(kind, Struct)


def _keys(kind):
    return (*kind.__struct_fields__, *(["type"] if _tag(kind) else []))


def _tag(kind):
    return kind.__struct_config__.tag if _is_record(kind) else None


def _tags(kinds):
    return ", ".join(f"'{_tag(kind)}'" for kind in kinds if _tag(kind))


def _follow(data, steps):
    """The value at a path, or None."""
    for step in steps:
        try:
            data = data[step]
        except (KeyError, IndexError, TypeError):
            return None
    return data
