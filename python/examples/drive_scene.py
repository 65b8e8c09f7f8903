"""Drives a scene from NumPy at 60 Hz in real time, while it is served and recorded.

    python3 drive_scene.py room.x3dv session.rlog
"""
import sys
import time

import numpy as np
import rtsg

scene = rtsg.load(sys.argv[1])
begin = time.monotonic()
with scene.serve() as server, scene.record(sys.argv[2]):
    for t in np.arange(0, 2, 1 / 60):
        scene["BELL"].translation = 1.5 * np.cos(t), 1.2, 1.5 * np.sin(t)
        scene.frame(t)
        server.wait(begin + t + 1 / 60 - time.monotonic())
