"""Stored weights that experiments need: loaded if they are of the training asked for, reported
where they are missing.
"""


class Untrained(ValueError):
    """The error of weights that no training has written yet."""


def load_weights(path, expected, load, command, reason="", defaults=None):
    """Return load(path), whose `about` must have the plain values `expected` of its training.

    command: trains again; reason: why the file may be missing; defaults: values of keys that older
    files do not have. Raises `Untrained` where the file is missing, ValueError where it is damaged
    or of another training.
    """
    if not path.exists():
        raise Untrained(f"no weights {path.name}: {reason}{command}")
    content = load(path)
    require_identity(f"weights {path.name} are", content.about, expected, command, defaults)
    return content


def require_identity(subject, about, expected, command, defaults=None):
    """Raise ValueError unless the plain values `about` of a training have those `expected`."""
    stored = {key: about.get(key, (defaults or {}).get(key)) for key in expected}
    if stored != expected:
        raise ValueError(f"{subject} of {stored}, now it is {expected}: {command}")


def load_available(run, names, load):
    """Return {name: load(name)} of those trainings that have weights; record the number of the
    others, and the commands that train them.
    """
    models, untrained = {}, []
    for name in names:
        try:
            models[name] = load(name)
        except Untrained as fault:
            untrained.append(str(fault))
    if untrained:
        run.record(f"{run.experiment.id}.untrained", len(untrained), comparator="info",
                   scale=f"of {len(names)} trainings", note="; ".join(untrained))
    return models
