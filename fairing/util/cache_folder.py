"""The user's cache folder."""

import os
from pathlib import Path


def cache_folder() -> Path:
    """EIGENFAIRING_CACHE, else XDG_CACHE_HOME/eigenfairing, else ~/.cache/eigenfairing."""
    if folder := os.environ.get("EIGENFAIRING_CACHE"):
        return Path(folder)
    root = os.environ.get("XDG_CACHE_HOME")
    return (Path(root) if root else Path.home() / ".cache") / "eigenfairing"
