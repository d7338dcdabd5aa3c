"""The whole onboard pipeline over simulated walks with everything the payload records."""
