"""All cases: one list, in the order in which they run."""

from . import adjoints, implicit, laws, ldm, nsf, oracle, scenes, training

MODULES = (scenes, implicit, ldm, nsf, laws, adjoints, training, oracle)


def cases():
    """Return all `RunCase`s."""
    return [case for module in MODULES for case in module.cases()]
