"""Break an attribute of a module, for all that have imported it.

The statements of `before` and `after` see the arguments of a call by their names, and those of
`after` also `result`, which they may assign; the expression of `value` sees what it replaces as
`old`. All see NumPy as `np`, and `scaled` of `scaling`. Kernels that Numba compiles have their
callees and constants within them, so that such an attribute of `mpm_ref` is refused.
"""

import importlib
import inspect
import sys
from functools import wraps

import numpy as np

from .scaling import scaled

PACKAGES = ("mpm_ref", "validation")
INLINED = (bool, int, float, tuple, np.ndarray)
NAMES = {"np": np, "scaled": scaled}


def apply(mutation):
    """Break what a `Mutation` names, in this process, for good.

    Raises ValueError where there is no such attribute, or where kernels would not see the change.
    """
    owner, name = owner_of(mutation)
    old = getattr(owner, name)
    require_uncompiled(mutation, old)
    new = replacement(mutation, old)
    setattr(owner, name, new)
    if not inspect.isclass(owner):
        for module in loaded_modules():
            for alias, thing in list(vars(module).items()):
                if thing is old:
                    setattr(module, alias, new)


def owner_of(mutation):
    """Return the module or class of a mutation's attribute, and the attribute's name."""
    module, _, path = mutation.where.partition(":")
    try:
        owner = importlib.import_module(module)
        *classes, name = path.split(".")
        for part in classes:
            owner = getattr(owner, part)
        getattr(owner, name)
    except (ImportError, AttributeError, ValueError) as error:
        raise ValueError(f"mutation {mutation.name!r}: where = {mutation.where!r}: {error}; "
                         "expected module:attribute or module:Class.method") from None
    return owner, name


def require_uncompiled(mutation, old):
    """Raise ValueError where compiled kernels hold a copy of an attribute."""
    compiled = hasattr(old, "py_func")
    constant = isinstance(old, INLINED) and mutation.where.startswith("mpm_ref")
    if compiled or constant:
        raise ValueError(f"mutation {mutation.name!r}: kernels hold a copy of {mutation.where}; "
                         "break a Python function that calls them")


def replacement(mutation, old):
    """Return what stands in the place of an attribute."""
    if mutation.value:
        return eval(mutation.value, {**NAMES, "old": old})
    if mutation.before:
        return with_arguments(old, mutation.before)
    return with_result(old, mutation.after)


def with_arguments(function, statements):
    """Return the function, called after statements that may change its arguments."""
    signature, code = inspect.signature(function), compile(statements, "<mutation>", "exec")

    @wraps(function)
    def broken(*args, **kwargs):
        given = signature.bind(*args, **kwargs)
        names = {**NAMES, **given.arguments}
        exec(code, names)
        given.arguments.update((name, names[name]) for name in given.arguments)
        return function(*given.args, **given.kwargs)

    return broken


def with_result(function, statements):
    """Return the function, followed by statements that may change its result."""
    signature, code = inspect.signature(function), compile(statements, "<mutation>", "exec")

    @wraps(function)
    def broken(*args, **kwargs):
        names = {**NAMES, **signature.bind(*args, **kwargs).arguments,
                 "result": function(*args, **kwargs)}
        exec(code, names)
        return names["result"]

    return broken


def loaded_modules():
    """Return the modules of the repository that are loaded."""
    return [module for name, module in list(sys.modules.items())
            if name.split(".")[0] in PACKAGES and module is not None]
