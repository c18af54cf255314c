"""Fixtures shared by all tests."""

import os
from pathlib import Path

import pytest

# as the command line does: spinning threads of the linear algebra slow small matrices down tenfold on a busy machine
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@pytest.fixture(scope="session")
def shared_recordings():
    """Folder of real recordings, which may not be copied into the project and may be absent."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "recordings"
    if not folder.is_dir():
        pytest.skip("real recordings are not part of the project: no ../shared/recordings beside it")
    return folder
