"""Writes a picture of every hundredth state of a log.

    python3 pictures_of_log.py session.rlog FOLDER
"""
import sys

import matplotlib.image
import rtsg

log = rtsg.Log(sys.argv[1])
for changes in log.states(every=100):
    picture = log.scene.render(width=160, height=90)
    matplotlib.image.imsave(f"{sys.argv[2]}/{changes.number:06}.png", picture)
