"""Two themes: one for shade and night, one for the sun."""

from __future__ import annotations

from textual.theme import Theme

SHADE = Theme(
    name="shade",
    dark=True,
    primary="#5fd38a",
    secondary="#8fb8a0",
    accent="#ffd34d",
    foreground="#e8eee8",
    background="#0c110e",
    surface="#141b17",
    panel="#1d2721",
    success="#5fd38a",
    warning="#ffb52e",
    error="#ff6257",
    variables={
        "quiet": "#2c3831",
        "on-quiet": "#f0f5f0",
        "quiet-text": "#93a399",
        "good": "#1f8f4e",
        "on-good": "#ffffff",
        "good-text": "#6fe09a",
        "warn": "#ffb52e",
        "on-warn": "#1a1200",
        "warn-text": "#ffc55c",
        "bad": "#c3261c",
        "on-bad": "#ffffff",
        "bad-text": "#ff8178",
        "footer-background": "#1d2721",
        "footer-key-foreground": "#ffd34d",
    },
)

SUN = Theme(
    name="sun",
    dark=False,
    primary="#004d25",
    secondary="#000000",
    accent="#00349a",
    foreground="#000000",
    background="#ffffff",
    surface="#ffffff",
    panel="#ffffff",
    success="#004d25",
    warning="#6b3d00",
    error="#a00000",
    text_alpha=1.0,
    variables={
        "quiet": "#000000",
        "on-quiet": "#ffffff",
        "quiet-text": "#303030",
        "good": "#005a2b",
        "on-good": "#ffffff",
        "good-text": "#004d25",
        "warn": "#ffd000",
        "on-warn": "#000000",
        "warn-text": "#6b3d00",
        "bad": "#b00000",
        "on-bad": "#ffffff",
        "bad-text": "#a00000",
        "footer-background": "#000000",
        "footer-foreground": "#ffffff",
        "footer-description-foreground": "#ffffff",
        "footer-key-foreground": "#ffd000",
    },
)
"""Black on white with nothing in between: glare takes the greys first."""
