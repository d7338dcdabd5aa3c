"""The sensors of the payload: their wire protocols, the messages they emit, and a simulated twin of each."""
