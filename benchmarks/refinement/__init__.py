"""The refinement beside the live fusion."""
