"""Makes a data set of random edits of one scene: pictures, depth, a label for each pixel, and what is heard in stereo.

    python3 training_set.py room.x3dv set.npz 1000
"""
import sys

import numpy as np
import rtsg

scene, dice, rows = rtsg.load(sys.argv[1]), np.random.default_rng(1), []
scene.frame(0)
for _ in range(int(sys.argv[3])):
    scene["BALL"].translation = dice.uniform((-2, .3, -2), (2, .3, 0))
    scene["DOOR"].rotation = 0, -1, 0, dice.uniform(0, 1.4)
    rows.append(scene.render_layers(["depth", "ids"], width=64, height=36, samples=1))
    rows[-1]["sound"] = scene.listen(.1, metrics=False, sample_rate=16000).samples
np.savez(sys.argv[2], **{name: np.stack([row[name] for row in rows]) for name in rows[0]})
