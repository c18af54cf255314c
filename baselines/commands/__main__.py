"""``python -m baselines.commands`` is ``flexdrive``."""

from baselines.commands import main

main()
