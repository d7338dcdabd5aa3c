"""Ground maps brought onto aerial maps, and onto each other: fields, search, refinement, verdict. Arrays in and out."""
