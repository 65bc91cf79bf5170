"""Numbers of things for people."""


def counted(n, noun):
    """A number with its noun, which gets an s unless it is 1: 1 frame, 2 frames."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"
