"""Writing a session: queue, writer thread, splits, session folder, repair."""
