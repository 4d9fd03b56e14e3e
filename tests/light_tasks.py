"""Tasks for other processes, in a file that imports nothing: what sends them would load its libraries there, too."""

import os


def square_sum(count):
    """Return a sum that takes processor time."""
    return sum(i * i for i in range(count))


def where(shared, task):
    """Return the process that a task runs in, and what it was given."""
    return os.getpid(), shared[task]
