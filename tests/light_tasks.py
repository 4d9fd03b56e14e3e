"""Tasks for other processes, in a file that imports next to nothing: what sends them would load its libraries, too."""

import os
import signal

from sindyjoint.clock import spend


def square_sum(count):
    """Return a sum that takes processor time."""
    return sum(i * i for i in range(count))


def where(shared, task):
    """Return the process that a task runs in, and what it was given."""
    return os.getpid(), shared[task]


def hears_ctrl_c(task):
    """Return whether what a terminal sends reaches the process that a task runs in."""
    return signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def spending(work):
    """Return a piece of work after it was counted."""
    spend(work)
    return work
