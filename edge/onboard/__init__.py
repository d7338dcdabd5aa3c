"""The camera's own files, brought onto the time of a session."""
