"""``python -m baselines.cli`` is ``flexdrive``."""

from baselines.cli import main

main()
