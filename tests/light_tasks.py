"""Tasks for other processes, in a file that imports nothing: what sends them would load its libraries there, too."""

import os
import signal


def square_sum(count):
    """Return a sum that takes processor time."""
    return sum(i * i for i in range(count))


def where(shared, task):
    """Return the process that a task runs in, and what it was given."""
    return os.getpid(), shared[task]


def hears_ctrl_c(task):
    """Return whether what a terminal sends reaches the process that a task runs in."""
    return signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])
