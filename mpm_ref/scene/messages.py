"""Report errors of a scene, each in one sentence that begins with the key and its value."""

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
    """A scene that cannot run; the message is one sentence that begins with the path of a key."""

    def __init__(self, message):
        super().__init__(" ".join(str(message).split()))


def joined(path, key):
    """Return the path of a key of the table at `path`."""
    return f"{path}.{key}" if path else str(key)


def with_path(path, sentence):
    """Return a sentence preceded by a path; a key at its beginning is joined to the path."""
    of_a_key = OF_A_KEY.match(sentence)
    if of_a_key:
        return joined(path, sentence[of_a_key.end():])
    return f"{path}: {sentence}" if path else sentence


@contextmanager
def errors_at(path):
    """Turn a ValueError in this context into a SceneError that begins with `path`."""
    try:
        yield
    except SceneError:
        raise
    except ValueError as fault:
        raise SceneError(with_path(path, str(fault))) from None


@contextmanager
def errors_of(source):
    """Begin the message of a SceneError in this context with `source`, unless it is empty."""
    try:
        yield
    except SceneError as fault:
        if not source:
            raise
        raise SceneError(f"{source}: {fault}") from None


def shown(value):
    """Return a value as text of limited length."""
    try:
        text = repr(value)
    except ValueError:          # a whole number of thousands of digits
        text = "a huge number"
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def rephrase(message, data):
    """Return our sentence for a message of msgspec about plain tables."""
    text, _, where = message.rpartition(" - at `$")
    text, where = (text, where.rstrip("`").lstrip(".")) if text else (where, "")
    steps = [int(step) if step.isdigit() else step for step in re.findall(r"[^.\[\]]+", where)]
    key = re.fullmatch(r"Object (contains unknown|missing required) field `(.*)`", text, re.DOTALL)
    if key:
        about = _unknown if key[1] == "contains unknown" else _missing
        return about(where, key[2], _types_at(steps, data))
    value = _follow(data, steps)
    if text.startswith("Invalid"):
        return f"{where} = {shown(value)}: expected {_choices(steps, data)}"
    if text.startswith("Expected"):
        text = re.sub(r"`([a-z| ]+)`", _in_words, text.partition(", got")[0])
        return f"{where or 'the scene'} = {shown(value)}: e{text[1:]}"
    return with_path(where, text)


def _unknown(where, key, types):
    keys = sorted({name for kind in types if _is_record(kind) for name in _keys(kind)})
    near = get_close_matches(key, keys, 1)
    hint = f"did you mean `{near[0]}`?" if near else f"the keys here are {', '.join(keys)}"
    return f"{joined(where, shown(key)[1:-1])}: unknown key; {hint}"


def _missing(where, key, types):
    if key == "type":
        return f"{where}: the key `type` is missing; it is one of {_tags(types)}"
    return f"{joined(where, key)}: this key is missing"


def _in_words(match):
    return " or ".join(WORDS.get(word, word) for word in match[1].split(" | ") if word != "null")


def _choices(steps, data):
    """Return the values that a key may have, as text."""
    kinds = _types_at(steps, data)
    values = [repr(value) for kind in kinds if get_origin(kind) is Literal
              for value in get_args(kind)]
    values += [TYPES[kind] for kind in kinds if kind in TYPES]
    return f"one of {', '.join(values) or _tags(_types_at(steps[:-1], data))}"


# the types of the records along a path

def _types_at(steps, data):
    """Return the types that the value at a path may have, narrowed by the `type` of tables."""
    kinds = [Scene]
    for step in steps:
        kinds = [part for kind in kinds for part in _parts(kind, step)]
        data = _follow(data, [step])
        named = data.get("type") if isinstance(data, dict) else None
        kinds = [kind for kind in kinds if named is not None and _tag(kind) == named] or kinds
    return kinds


def _parts(kind, step):
    """Return the types of an item of a list, or of a key of a table."""
    if isinstance(step, int):
        return _flat(get_args(kind)[0]) if get_origin(kind) is tuple else []
    keys = getattr(kind, "__struct_encode_fields__", ())
    if step not in keys:
        return []
    return _flat(get_type_hints(kind)[kind.__struct_fields__[keys.index(step)]])


def _flat(kind):
    """Return the members of a union."""
    if get_origin(kind) in (Union, UnionType):
        return [part for member in get_args(kind) for part in _flat(member)]
    return [kind]


def _is_record(kind):
    return isinstance(kind, type) and issubclass(kind, Struct)


def _keys(kind):
    return (*kind.__struct_encode_fields__, *(["type"] if _tag(kind) else []))


def _tag(kind):
    return kind.__struct_config__.tag if _is_record(kind) else None


def _tags(kinds):
    return ", ".join(f"'{_tag(kind)}'" for kind in kinds if _tag(kind))


def _follow(data, steps):
    """Return the value at a path, or None."""
    for step in steps:
        try:
            data = data[step]
        except (KeyError, IndexError, TypeError):
            return None
    return data
