"""Errors of calibration."""

from __future__ import annotations


class CalibrationError(Exception):
    """What was seen cannot be used at all. The text says what is missing and how to get it.

    A measurement that was possible and is not good enough is no error: it comes with a verdict.
    """
