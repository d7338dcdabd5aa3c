"""How well and how fast ground maps are brought onto aerial ones, beside what else there is."""
