"""Where things stand on this machine."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from edge.config import Config

SYSTEM_RUNTIME = Path("/run/mapforest")
"""The service's runtime directory: `RuntimeDirectory=mapforest` in the unit."""
SOCKET_NAME = "control.sock"
BUS_NAME = "bus.sock"
RESULTS_NAME = "results.sock"


def recordings_folder(config: Config) -> Path:
    """Where sessions are written."""
    return Path(config.recording.folder).expanduser()


def control_socket(config: Config, environ: Mapping[str, str] = os.environ) -> Path:
    """Where a recorder started here listens: the configured path, else its runtime directory, else the user's."""
    if config.control.socket:
        return Path(config.control.socket).expanduser()
    return _runtime_folder(environ) / SOCKET_NAME


def find_control_socket(config: Config, environ: Mapping[str, str] = os.environ, system: Path = SYSTEM_RUNTIME) -> Path:
    """Where a client looks: `control_socket`, or the system service's when only that one is there."""
    own = control_socket(config, environ)
    service = system / SOCKET_NAME
    if config.control.socket or own.exists() or not service.exists():
        return own
    return service


def cache_folder(environ: Mapping[str, str] = os.environ) -> Path:
    """What can be made again, but not quickly: the service's cache, else the user's."""
    if given := environ.get("CACHE_DIRECTORY", "").partition(":")[0]:
        return Path(given)
    return Path(environ.get("XDG_CACHE_HOME", "") or Path.home() / ".cache") / "mapforest"


def _runtime_folder(environ: Mapping[str, str]) -> Path:
    # systemd joins several runtime directories with colons; ours is the first.
    if given := environ.get("RUNTIME_DIRECTORY", "").partition(":")[0]:
        return Path(given)
    if user := environ.get("XDG_RUNTIME_DIR", ""):
        return Path(user) / "mapforest"
    return Path(f"/tmp/mapforest-{os.getuid()}")  # the fixed name is made with mode 0700 and its owner is checked
