"""After the session, on a workstation: the trajectory that all of the data agree on best, as a factor graph."""
