"""What only the law between moment and motion shows: runs held against each other, and faults undone by trial."""
