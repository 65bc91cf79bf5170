"""Laws as they are trained, of a kind: a record of constants that are not learned."""

from torch import nn


class LawOfKind(nn.Module):
    """A law of a kind, of those that `weights` knows."""

    def __init__(self, kind):
        super().__init__()
        self.kind = kind

    def extra_repr(self):
        """The kind with its constants."""
        return repr(self.kind)


def described(law):
    """What is to be known of a law but for what it has learned: its class, its constants, the sizes
    of its layers; plain values.
    """
    return [type(law).__name__, law.extra_repr(), [list(a.shape) for a in law.parameters()]]
