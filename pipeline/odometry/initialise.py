"""Start-up."""
import numpy as np
from pipeline.odometry.state import State, GRAVITY_M_S2
from pipeline.odometry import so3

def at_rest(rows):
    up = rows[:, 3:].mean(0)
    up /= np.linalg.norm(up)
    axis = np.cross(up, [0, 0, 1.0])
    s = np.linalg.norm(axis)
    rot = so3.exp(axis / max(s, 1e-12) * np.arctan2(s, up[2]))
    state = State(rot, np.zeros(3), np.zeros(3), rows[:, :3].mean(0), np.zeros(3), np.array([0, 0, -GRAVITY_M_S2]))
    sig = np.concatenate([[1e-4]*3, [1e-4]*3, [0.01]*3, [3e-4]*3, [0.1]*3, [0.012]*2])
    return state, np.diag(sig**2)
