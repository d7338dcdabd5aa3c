"""Emlid Reach M2 GNSS receiver: NMEA 0183 over serial or TCP."""
