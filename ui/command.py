"""Runs the app in this terminal. Imported only by `mapforest tui`, and only when it is called."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from ui.app import Options, RecorderApp
from ui.connection import SocketConnection
from ui.glyphs import needs_plain


def run(socket_path: Path, *, sun: bool = False, bell: bool = False, ascii_only: bool = False) -> str:
    """Show the recorder at `socket_path` until the operator leaves. Returns a last word to print, or nothing."""
    options = Options(sun, bell, ascii_only or needs_plain(os.environ), sys.stdin.fileno())
    return RecorderApp(SocketConnection(socket_path), options).run() or ""
