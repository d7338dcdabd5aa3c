"""Measurements that are run by hand: what recording costs, and what other programs make of a recording."""
