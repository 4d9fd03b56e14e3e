"""``python -m sindyjoint`` is the same command line."""

from sindyjoint.cli import main

main()
