"""X3D scenes in Python: run them, picture them, hear them, follow them over a network, record and replay them.

    import rtsg
    scene = rtsg.load("hall.x3dv")
    scene.frame(0.0)
    scene["TRAIN"].rotation = 0, 1, 0, 0.5
    picture = scene.render(width=640, height=360)

A scene belongs to the thread that made it. Lengths are metres, times seconds, angles radians. docs/python.md tells more.
Where the extension module is not installed, `native` is False: logs are read and mirrors followed in Python alone
(rtsg.pure), and whatever else is asked for raises NoExtension.
"""
import importlib.util as _util

from ._errors import Closed, Diagnostic, DiagnosticWarning, Error, NoExtension, NoSuchField, NoSuchName, WrongThread
from ._types import Damage, Divergence, FieldDifference, FieldStep, Irradiance, Pick, ReplayReport, Table, Verdict

native = _util.find_spec(__name__ + "._rtsg") is not None  # one that is there and cannot be loaded is an ImportError

_EXTENDED = ["Cascade", "Recorder", "Server", "Sound", "Subscription", "diff", "load", "loads", "register_field_type", "replay_test", "serve"]

__all__ = ["Change", "ChangeSet", "Closed", "Damage", "Diagnostic", "DiagnosticWarning", "Divergence", "Error",
           "FieldDifference", "FieldStep", "Follower", "Irradiance", "Log", "NoExtension", "Node", "NoSuchField", "NoSuchName",
           "Pick", "ReplayReport", "Scene", "Table", "Verdict", "WrongThread", "follow", "native", "__version__"]

if native:
    from ._rtsg import (Cascade, Change, ChangeSet, Node, Recorder, Scene, Server, Sound, Subscription, __version__, diff, load, loads,
                        register_field_type, replay_test)
    from ._follow import Follower, follow
    from ._logs import Log
    from ._serve import serve
    from . import _notebook
    Scene._repr_png_, Log._repr_html_, Sound._repr_html_ = _notebook.scene_png, _notebook.log_html, _notebook.sound_html
    __all__ += _EXTENDED
else:
    from .pure import Change, ChangeSet, Follower, Log, Node, Scene, follow
    __version__ = "unknown"

    def __getattr__(name):
        if name in _EXTENDED:
            raise NoExtension(f"rtsg.{name} needs the extension module rtsg._rtsg, which is not installed here; logs and mirrors are read without it")
        raise AttributeError(f"module 'rtsg' has no attribute {name!r}")
