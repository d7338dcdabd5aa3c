"""What the detector costs beyond the network it runs."""
