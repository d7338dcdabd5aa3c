"""The onboard pipeline over a recording: odometry, fusion, products; stage by stage, each finished one kept."""
