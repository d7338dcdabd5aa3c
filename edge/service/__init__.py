"""The recorder service: drivers, health, control socket, watchdog, live view."""
