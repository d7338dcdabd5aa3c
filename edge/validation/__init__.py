"""Judging a recording from its message indexes."""
