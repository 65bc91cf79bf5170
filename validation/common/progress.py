"""Progress of a run: one bar over all experiments, weighted by their budgets, and one within each.

Where the error output is no terminal, bars would be noise: one line at the start and one at the end
of each experiment are printed instead, with the time left.
"""

import shutil
import sys
import time

from tqdm import tqdm


class SuiteProgress:
    """Bars for a list of experiments with budgets [s]; a context manager."""

    def __init__(self, budgets):
        self.total, self.done, self.budget = float(sum(budgets)), 0.0, 0.0
        self.count, self.index = len(budgets), 0
        self.started = self.began = time.perf_counter()
        self.bar = tqdm(total=self.total, position=0, **_bar_style(),
                        bar_format="{desc} {percentage:3.0f}% |{bar}| {elapsed}, {remaining} left")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.bar.close()

    def begin(self, label, budget):
        """Show that an experiment starts."""
        self.index, self.budget, self.began = self.index + 1, budget, time.perf_counter()
        self.label = f"[{self.index}/{self.count}] {label}"
        self.bar.set_description_str(self.label)
        if self.bar.disable:
            self.say(f"{self.label}: about {budget:.0f} s, {self.left():.0f} s left in all")

    def end(self, message):
        """Show that the experiment has ended, with a message."""
        self.done += self.budget
        self.budget = 0.0
        self.tick()
        self.say(f"{self.label}: {message}")

    def ended(self, label, budget, message):
        """Show that one of several experiments that run at a time has ended."""
        self.index, self.done = self.index + 1, self.done + budget
        self.began = time.perf_counter()
        self.bar.set_description_str(f"[{self.index}/{self.count}]")
        self.tick()
        self.say(f"[{self.index}/{self.count}] {label}: {message}; {self.left():.0f} s left in all")

    def left(self):
        """Return the seconds left, from the budgets and their pace so far."""
        elapsed = time.perf_counter() - self.started
        pace = elapsed / self.done if self.done else 1.0
        return pace * (self.total - self.done)

    def tick(self):
        """Move the overall bar with the clock, up to the budget of the running experiment."""
        spent = min(time.perf_counter() - self.began, self.budget)
        self.bar.update(self.done + spent - self.bar.n)

    def say(self, text):
        """Print a line above the bars."""
        tqdm.write(text, file=sys.stderr)

    def inner(self, iterable, desc):
        """Return a bar for one loop of the running experiment."""
        items = range(iterable) if isinstance(iterable, int) else iterable
        return _Inner(items, desc=desc, tick=self.tick)


def _bar_style():
    """Return the style of both bars: removed when done, disabled without a terminal."""
    return {"leave": False, "disable": None, "file": sys.stderr,
            "ncols": shutil.get_terminal_size().columns}


class _Inner(tqdm):
    """The bar of a loop, in the second line; it also advances the first one."""

    def __init__(self, items, desc, tick):
        self._tick = tick
        super().__init__(items, desc=f"  {desc}", position=1, **_bar_style())

    def update(self, n=1):
        """Advance by n items."""
        self._tick()
        return super().update(n)
