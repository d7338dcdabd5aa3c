"""The live pipeline: from the recorder's bus to where the payload is, and back to be recorded."""
