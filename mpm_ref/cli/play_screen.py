"""The picture and the lines that `mpm-ref rom play` shows of a session."""

import numpy as np

from .braille import characters, dots, region_around

KEYS = "arrows: tilt gravity, stronger, weaker | space: pause | r: restart | q: quit"
AGAIN = "press r to restart"
UPRIGHT = 0.5       # degrees; a smaller tilt is not named,
PUNCTUAL = 0.1      # nor is less time behind [s]


class Screen:
    """Draws a session from one side; the region in view grows with the body, but not with what is
    left of one that broke down.
    """

    def __init__(self, session):
        self.session = session
        self.region = region_around(self._places())

    def picture(self, columns, rows):
        """Return the lines of braille of the present state."""
        x = self._places()
        if not self.session.breakdown:
            self.region = self.region.including(x)
        return characters(dots(x, self.region, columns, rows))

    def _places(self):
        x = self.session.shown.positions(self.session.state.latent.xhat)
        return x[:, list(self.session.load.view)]


def status_line(session, pace):
    """Return the line about time, gravity and pace of a session."""
    parts = [f"t = {session.state.t:.2f} s", gravity_text(session.load)]
    if session.is_paused:
        parts.append("paused")
    elif session.is_running:
        if pace.factor is not None:
            parts.append(f"{pace.factor:.2f} x real time")
        if pace.behind >= PUNCTUAL:
            parts.append(f"{pace.behind:.1f} s behind")
    return " | ".join(parts)


def gravity_text(load):
    """Return the strength and the tilt of a `Load` in words."""
    angle = (np.degrees(load.tilt) + 180.0) % 360.0 - 180.0
    tilt = "" if abs(angle) < UPRIGHT else (
        f", {abs(angle):.0f} degrees to the {'right' if angle > 0.0 else 'left'}")
    return f"gravity {load.strength:.3g} m/s^2{tilt}"


def warning_line(session, beyond):
    """Return the line about a breakdown, or else about the sentence `beyond` on latent coordinates
    out of the range of training; "" where all is well.
    """
    if session.breakdown:
        return f"{session.breakdown}; {AGAIN}"
    return f"warning: {beyond}" if beyond else ""
