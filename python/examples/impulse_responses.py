"""Measures a room along a path of the listener: impulse responses, and reverberation times with their 95 % intervals.

    python3 impulse_responses.py room.x3dv responses.npz
"""
import sys

import numpy as np
import rtsg

scene, responses = rtsg.load(sys.argv[1]), {}
ear = scene.nodes("Viewpoint")[0]
for x in np.linspace(-1, 1, 5):
    ear.position = x, 1.6, 0
    scene.frame(scene.now)
    heard = scene.listen(0, responses=True, channels="mono", rays=4000)
    times, intervals = heard.sources[0]["T30_s"], heard.sources[0]["ci95"]["T30_s"]
    print(f"x = {x:+.1f} m: T30 at 1 kHz is {times[5]:.3f} s +- {intervals[5]:.3f} s")
    responses[f"x = {x:+.1f}"] = heard.impulse_responses(16000)[:, 0]
np.savez(sys.argv[2], **responses)
