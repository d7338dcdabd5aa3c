"""HTTP answers of the emulated HERO8."""

from __future__ import annotations

import json
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Reply:
    """HTTP status and body."""

    code: int
    body: bytes


def accepted(value: object) -> Reply:
    """JSON with line breaks, as the camera writes it."""
    return Reply(200, (json.dumps(value, indent=1) + "\n").encode())


def refused(path: str, query: str) -> Reply:
    """HTTP 500 with the error body of a real HERO8."""
    body = {
        "version": "2.0",
        "path_info": path,
        "query_string": query,
        "error_code": -3,
        "error_msg": "Error executing command",
        "function": "gp_control_execute",
        "line": 512,
    }
    return Reply(500, json.dumps(body, indent=1).encode())
