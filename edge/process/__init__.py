"""The onboard pipeline over a recording: odometry, fusion, detection, products; each stage kept when finished."""
