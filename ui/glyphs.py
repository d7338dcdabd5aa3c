"""Plain ASCII for terminals that cannot draw the symbols: the Linux console, or a locale without UTF-8."""

from __future__ import annotations

from collections.abc import Mapping

from textual.content import Content

ASCII = str.maketrans(
    {
        "✓": "+", "✗": "X", "▲": "!", "○": "o", "●": "*", "→": ">", "±": "~", "°": " ", "…": ".", "·": "|",
        "▼": "v", "█": "#", "▀": '"', "▄": "o", "▁": "_", "▂": ".", "▃": ":", "▅": "+", "▆": "*", "▇": "#", "─": "-",
    }
)  # fmt: skip
"""One character for one character, so that nothing moves."""


def plain(content: Content) -> Content:
    """The same content in ASCII, with its styles."""
    return Content(content.plain.translate(ASCII), list(content.spans))


def needs_plain(environment: Mapping[str, str]) -> bool:
    """Whether the terminal that `environment` describes is better served with ASCII."""
    if environment.get("TERM", "") in {"linux", "dumb", "vt100", "vt220"}:
        return True
    locale = environment.get("LC_ALL") or environment.get("LC_CTYPE") or environment.get("LANG") or "C.UTF-8"
    return "utf" not in locale.lower()
