"""Which states of a full-order run are kept for its fields: one every so many steps."""

from ...scene import SceneError


def every(base, changes):
    """Steps between the states kept of a `Scene` with changes {path: value}; without `every`, 1.
    Raises SceneError for frames by `interval`, and where the last state would come out of step.
    """
    own = {name: changes.get(name, getattr(base, name)) for name in ("every", "interval", "steps")}
    if own["interval"] is not None:
        raise SceneError(f"interval = {own['interval']}: expected `every`, steps from one kept "
                         "state to the next, in the scene or in [set]")
    every, steps = 1 if own["every"] is None else own["every"], own["steps"]
    if every == 0:
        raise SceneError("every = 0: expected 1 or more steps from one kept state to the next")
    if isinstance(every, int) and isinstance(steps, int) and steps % every:
        raise SceneError(f"every = {every}: expected a divisor of steps = {steps}, so that the "
                         "states kept are as far apart as each other; change one of the two")
    return every
