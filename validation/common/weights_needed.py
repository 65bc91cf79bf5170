"""Weights that experiments need: those that are available, and a record of the others."""


class Untrained(ValueError):
    """The error of weights that no training has written yet."""


def load_available(run, names, load):
    """Return {name: load(name)} of the trainings whose weights exist; record the others.

    load(name) raises `Untrained` for missing weights, with a sentence on how to make them.
    """
    bundles, missing = {}, []
    for name in names:
        try:
            bundles[name] = load(name)
        except Untrained as error:
            missing.append(str(error))
    if missing:
        run.record(f"{run.experiment.id}.untrained", len(missing), comparator="info",
                   scale=f"of {len(names)} trainings", note="; ".join(missing))
    return bundles
