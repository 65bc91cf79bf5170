"""The committed list of mutations, `validation/mutations.toml`, and what it covers.

[[mutation]]    name, experiments (patterns of ids), breaks (a sentence), where
                ("module:attribute" or "module:Class.method"), and one of before, after
                (statements) or value (an expression): see `patch`
[[without]]     experiments whose verdicts no mutation can change, and why
"""

import tomllib
from fnmatch import fnmatchcase
from pathlib import Path

import msgspec

FILE = Path(__file__).parents[1] / "mutations.toml"


class Mutation(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One way to break what experiments measure."""

    name: str
    experiments: list[str]      # patterns of ids
    breaks: str
    where: str
    before: str = ""
    after: str = ""
    value: str = ""

    def __post_init__(self):
        if sum(map(bool, (self.before, self.after, self.value))) != 1:
            raise ValueError(f"mutation {self.name!r}: give one of before, after and value")


class Without(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Experiments that have verdicts and no mutation, with the reason."""

    experiments: list[str]      # patterns of ids
    why: str


class MutationList(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The content of the file."""

    mutation: list[Mutation]
    without: list[Without] = []

    def mutations_of(self, experiment_id):
        """Return the mutations of an experiment."""
        return [one for one in self.mutation if matches(one.experiments, experiment_id)]

    def reason_without(self, experiment_id):
        """Return why an experiment has no mutation, empty where none is given."""
        return next((one.why for one in self.without if matches(one.experiments, experiment_id)),
                    "")


def matches(patterns, experiment_id):
    """Return whether an id matches one of the patterns."""
    return any(fnmatchcase(experiment_id, pattern) for pattern in patterns)


def load(path=FILE):
    """Return the `MutationList` of a file.

    Raises ValueError, with the file, for a wrong key or value, and for a name given twice.
    """
    try:
        content = msgspec.convert(tomllib.loads(Path(path).read_text(encoding="utf-8")),
                                  MutationList)
    except (msgspec.ValidationError, tomllib.TOMLDecodeError) as error:
        raise ValueError(f"{Path(path).name}: {error}") from None
    names = [one.name for one in content.mutation]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"{Path(path).name}: mutation {name!r} is given twice; rename one")
    return content


def unlisted(mutations, experiment_ids):
    """Return the ids that have neither a mutation nor a reason."""
    return [id for id in experiment_ids
            if not (mutations.mutations_of(id) or mutations.reason_without(id))]


def unused(mutations, experiment_ids):
    """Return the patterns of the list that match none of the ids."""
    patterns = [pattern for one in (*mutations.mutation, *mutations.without)
                for pattern in one.experiments]
    return [pattern for pattern in patterns
            if not any(fnmatchcase(id, pattern) for id in experiment_ids)]
