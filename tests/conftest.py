"""Fixtures shared by all tests."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared_recordings():
    """Folder of real recordings, which may not be copied into the project and may be absent."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "recordings"
    if not folder.is_dir():
        pytest.skip("real recordings are not part of the project: no ../shared/recordings beside it")
    return folder
