"""The error of a scene, and how a sentence comes to name the place it is about."""

import re
from contextlib import contextmanager

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
