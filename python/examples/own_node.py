"""A node type of one's own: a pendulum, whose angle may be routed to whatever else.

    python3 own_node.py
"""
import math

import rtsg


def swing(cascade, node):
    cascade.emit(node, "angle", .5 * math.sin(cascade.now * math.sqrt(9.81 / node.length)))
    return cascade.now  # again in the next frame


scene = rtsg.Scene()
scene.define("Pendulum", {"length": ("SFFloat", "inputOutput", 1), "angle": ("SFFloat", "outputOnly")}, on_time=swing)
scene.root.add_child(scene.create("Pendulum", def_name="P", length=2))
for k in range(31):
    scene.frame(k / 10)
    print(f"t = {k / 10:.1f} s: {scene['P'].angle:+.3f} rad")
