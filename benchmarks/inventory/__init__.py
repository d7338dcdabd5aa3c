"""How well stems and their diameters are found."""
