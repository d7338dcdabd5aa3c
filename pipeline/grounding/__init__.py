"""Detections put on the LiDAR map: from boxes in images to trees with a place, and to points with a label."""
