"""Settings that a paper prints, checked against the scene that is run."""


def record_settings(run, scene, values, **tolerances):
    """Record {target id: our value} of a scene's settings.

    A setting agrees to round-off, or to the relative `tolerances` {id with _ for .: tolerance}
    where the paper prints it rounded.
    """
    for target, value in values.items():
        tolerance = tolerances.get(target.replace(".", "_"))
        rule = {} if tolerance is None else {"tolerance": tolerance}
        run.record(target, value, scale=f"scenes/{scene}.toml", **rule)
