"""One page a session, for whoever has to decide something: verdict, map, trees, sensors, and what to do."""
