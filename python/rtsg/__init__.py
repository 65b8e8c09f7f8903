"""X3D scenes in Python: run them, picture them, hear them, follow them over a network, record and replay them.

    import rtsg
    scene = rtsg.load("hall.x3dv")
    scene.frame(0.0)
    scene["TRAIN"].rotation = 0, 1, 0, 0.5
    picture = scene.render(width=640, height=360)

A scene belongs to the thread that made it. Lengths are metres, times seconds, angles radians. docs/python.md tells more.
"""
from ._errors import Closed, Diagnostic, DiagnosticWarning, Error, NoSuchField, NoSuchName, WrongThread
from ._rtsg import (Change, ChangeSet, Node, Recorder, Scene, Server, Sound, Subscription, __version__, diff, load, loads,
                    replay_test)
from ._follow import Follower, follow
from ._logs import Log, Table
from ._serve import serve
from ._types import Damage, Divergence, FieldDifference, FieldStep, Irradiance, Pick, ReplayReport, Verdict

__all__ = ["Change", "ChangeSet", "Closed", "Damage", "Diagnostic", "DiagnosticWarning", "Divergence", "Error",
           "FieldDifference", "FieldStep", "Follower", "Irradiance", "Log", "Node", "NoSuchField", "NoSuchName", "Pick",
           "Recorder", "ReplayReport", "Scene", "Server", "Sound", "Subscription", "Table", "Verdict", "WrongThread",
           "diff", "follow", "load", "loads", "replay_test", "serve", "__version__"]
