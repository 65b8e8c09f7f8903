"""Follows a scene that is served elsewhere, and prints where one of its fields is.

    python3 follow_mirror.py tcp://127.0.0.1:5570 BALL.translation
"""
import sys

import rtsg

for changes in rtsg.follow(sys.argv[1]):
    if sys.argv[2] in changes:
        print(f"t = {changes.time:.3f} s", changes[sys.argv[2]])
