"""Stems, their diameters, heights and crowns, from any map of points."""
