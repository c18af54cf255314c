"""``python docs/glossary.py`` writes docs/glossary.md: the terms as the pages explain them."""

from pathlib import Path

from baselines.report.glossary import markdown
from flexdrive_gym.files import write_atomically

PAGE = Path(__file__).with_name("glossary.md")

if __name__ == "__main__":
    write_atomically(PAGE, markdown())
