"""Weights that experiments need, and what they say of those that are not there yet."""


class Untrained(ValueError):
    """Weights are not there yet."""


def there(run, names, load):
    """{name: load(name)} of those trainings that are there; records how many are not, and how to
    make them.
    """
    found, waiting = {}, []
    for name in names:
        try:
            found[name] = load(name)
        except Untrained as fault:
            waiting.append(str(fault))
    if waiting:
        run.record(f"{run.experiment.id}.untrained", len(waiting), comparator="info",
                   scale=f"of {len(names)} trainings", note="; ".join(waiting))
    return found
