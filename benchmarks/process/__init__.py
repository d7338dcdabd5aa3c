"""`mapforest process` over long recordings."""
