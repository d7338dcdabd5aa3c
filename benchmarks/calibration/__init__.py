"""Errors of the calibration against simulated truth."""
