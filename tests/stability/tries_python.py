#!/usr/bin/env python3
"""Random calls of the Python package with random arguments: an exception at most, never a signal, an abort, or a call without end.

usage: tries_python.py [--seed N] [--first N] [--tries N] [--show]   (PYTHONPATH names the folder of the package)

Each try is a process that makes 60 calls of what the package offers, on objects that earlier calls have made, closed ones among them. With --show it
prints each call before it makes it. Prints a line for each fault with what was called last, and at the end "N tries, M faults".
"""
import argparse
import gc
import inspect
import math
import os
import random
import re
import resource
import signal
import sys
import tempfile
import warnings

import numpy as np

import rtsg

TEXT = """#X3D V4.0 utf8
PROFILE Full
DEF CLOCK TimeSensor { cycleInterval 2 loop TRUE }
DEF PATH PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 4 0 0 ] }
DEF BOX Transform { children Shape { appearance Appearance { material DEF PAINT Material { } texture PixelTexture { image 1 1 3 0xFF00 } } geometry Box { } } }
DEF VIEW Viewpoint { position 0 0 10 }
DEF S Script { inputOnly SFFloat tick outputOnly SFInt32 count inputOutput MFVec3f points [ ] url "ecmascript: function tick(v) { count = 1; }" }
ROUTE CLOCK.fraction_changed TO PATH.set_fraction
ROUTE PATH.value_changed TO BOX.translation
"""
CALLS, SECONDS = 60, 60
NAMES = ["BOX", "CLOCK", "PATH", "PAINT", "VIEW", "S", "#1", "#5", "#99999999999999999999", "", "BOX.translation", "CLOCK.fraction_changed", "PAINT.diffuseColor",
         "S.tick", "S.points", "PATH.keyValue", "BOX.nothing", ".", "children", "translation", "keyValue", "url", "Transform", "Material", "Script", "Inline", "SFVec3f",
         "MFNode", "inputOutput", "pointer", "a.b.c", "\0", "\udc80", "\U0001F600", "x" * 5000, "*", "ipc://x", "tcp://127.0.0.1:*", "tcp://1", "inproc://x",
         "nowhere.x3dv", "a.rlog", "a.x3d", "a.wav", "/", "/dev/null", "path", "raster", "depth", "all", "stereo", "binaural", "linear", "none", "edits", "code"]
# What would stop the try itself, or wait by design.
LEFT_OUT = {"serve", "follow", "Follower", "main", "set_threads", "register_field_type", "drain", "wait", "wait_for", "poll", "__aiter__"}


def any_array(dice):
    shape = tuple(dice.choice([0, 1, 2, 3, 4, 9, 16]) for _ in range(dice.randint(0, 3)))
    array = np.zeros(shape, dice.choice(["f4", "f8", "i4", "u1", "?", "i8", "c16", "O", "U3"]))
    if array.dtype.kind in "fi" and dice.random() < .7:
        array = (np.ones(shape) * dice.choice([1, -1, 1e30, np.nan])).astype(array.dtype, casting="unsafe")
    return array[::-1] if shape and dice.random() < .2 else array


def any_value(dice, made, depth=0):
    kind = dice.randrange(13 if depth < 3 else 9)
    if kind < 3 and made:
        return dice.choice(made)
    if kind == 3:
        return dice.choice(NAMES)
    if kind == 4:
        return dice.choice([0, 1, 2, 3, -1, 7, 64, 1 << 31, 1 << 63, -1 << 70, True, False, None])
    if kind == 5:
        return dice.choice([0.0, .5, 1.0, -1.0, 1e-300, 1e30, 1e308, float("nan"), float("inf"), -0.0])
    if kind == 6:
        return any_array(dice)
    if kind == 7:
        return dice.choice([b"", b"\0\xff", object(), print, lambda *a: None, rtsg.Scene, int, ..., slice(None), 1j, range(3), {1, 2}])
    if kind == 8:
        return TEXT if dice.random() < .3 else dice.choice(["Group { }", "DEF A Box { }", "PROTO P [ ] { Group { } } P { }", "Group {", "ROUTE A.b TO C.d"])
    if kind == 9:
        return {dice.choice(NAMES): any_value(dice, made, depth + 1) for _ in range(dice.randint(0, 3))}
    values = [any_value(dice, made, depth + 1) for _ in range(dice.choice([0, 1, 2, 3, 3, 3, 4]))]
    return values if kind == 10 else tuple(values)


def parameters(function):
    """Names and types of what it takes, as its signature or its first line of documentation has them."""
    try:
        return {p.name: str(p.annotation) for p in inspect.signature(function).parameters.values()}
    except (TypeError, ValueError):
        doc = (getattr(function, "__doc__", None) or "").split("\n")[0]
        found = re.findall(r"(\w+): ((?:[\w.]+)(?:\[[^=]*?\])?)(?=,|\)| =)", doc[doc.find("("):doc.rfind(" ->")])
        return {name: kind for name, kind in found if name != "self"}


SMALL = {"width": [1, 8, 33, 0, -1], "height": [1, 8, 33, 0, -1], "samples": [1, 4, 0, -5], "rays": [1, 100, 0, -5], "seconds": [0, .01, .1, -1, math.nan],
         "timeout": [0, .01, -1], "fps": [.5, 1, 30, 0, -1, math.nan], "error": [.5, 1, 0, -1, math.nan], "quality": [.25, 1, 0, 99, math.nan], "threads": [1],
         "sample_rate": [8000, 0, -1, 1], "t": [0, .1, .2, 1, -1, 1e10, math.nan, math.inf], "count": [0, 1, 3, -1], "keyframe_seconds": [0, .1, -1, math.nan]}


SIZES = {"Color": 3, "ColorRGBA": 4, "Vec2f": 2, "Vec2d": 2, "Vec3f": 3, "Vec3d": 3, "Vec4f": 4, "Vec4d": 4, "Rotation": 4, "Image": 5}
FILES = ["a.rlog", "b.rlog", "a.x3d", "b.x3dv", "a.wav", "a.png", "a.rtsgb", "nowhere/a.x3d", ".", "", "a.json"]


def field_value(kind, dice, made):
    """A value for a field of this type, not always of the right size."""
    def one():
        if kind[2:] == "Node":
            return dice.choice([item for item in made if isinstance(item, rtsg.Node)] or [None])
        if kind[2:] == "String":
            return dice.choice(NAMES)
        if kind[2:] == "Bool":
            return dice.random() < .5
        number = dice.choice([0, 1, -1, 5, .5, 1e30, math.nan, math.inf, -1 << 31])
        return [number] * SIZES[kind[2:]] if kind[2:] in SIZES else number
    if kind.startswith("SF"):
        return one()
    values = [one() for _ in range(dice.choice([0, 1, 2, 5, 300]))]
    if kind[2:] in SIZES and dice.random() < .5:
        return np.array(values, dice.choice(["f4", "f8"])).reshape(-1, SIZES[kind[2:]])[::dice.choice([1, -1, 2])]
    return values


def fitting(name, kind, dice, made):
    """A value of the kind that a parameter has, or, one time in six, anything. What only costs time is kept small."""
    if name in SMALL:
        return dice.choice(SMALL[name])
    if dice.random() < .17:
        return any_value(dice, made)
    for part, cls in (("Node", rtsg.Node), ("Scene", rtsg.Scene)):
        if part in kind:
            return dice.choice([item for item in made if isinstance(item, cls)] or [None])
    if name in ("node", "child", "parent"):
        return dice.choice([item for item in made if isinstance(item, rtsg.Node)] or [None])
    if "PathLike" in kind or name == "path" and "str" not in kind:
        return dice.choice(FILES)
    if name == "value":
        return field_value(dice.choice(["SF", "MF"]) + dice.choice([*SIZES, "Node", "String", "Bool", "Float"]), dice, made)
    if name == "type_name":
        return dice.choice(["Transform", "Shape", "Material", "IndexedFaceSet", "Text", "NurbsPatchSurface", "TimeSensor", "Script", "ParticleSystem", "", "X3DNode"])
    if name == "text":
        return dice.choice([TEXT, "Group { }", "DEF A Box { }", "Group {", "PROTO P [ ] { Group { } } P { }"])
    if "str" in kind or name in ("path", "name", "field", "scene", "log"):
        return dice.choice(NAMES)
    if "bool" in kind:
        return dice.random() < .5
    if "int" in kind:
        return dice.choice([0, 1, 2, 3, 5, -1, 64, 1 << 31, 1 << 40])
    if "float" in kind:
        return dice.choice([0.0, .5, 1.0, -1.0, 1e-300, 1e30, math.nan, math.inf])
    if name in ("origin", "direction", "point", "center", "displacement", "place", "normal", "values") and dice.random() < .8:
        return [dice.choice([0, 1, -1, .5, 1e30, math.nan]) for _ in range(3)]
    return any_value(dice, made)


SPECIAL = ("__getitem__", "__setitem__", "__len__", "__contains__", "__eq__", "__hash__", "__bool__", "__enter__", "__exit__", "__getattr__", "__setattr__",
           "__init__", "__iter__", "__repr__")

ENDS = ("close", "__exit__", "__enter__", "__init__")


def one_call(dice, made, show):
    owners = [item for item in made if type(item).__module__.startswith("rtsg")] or [rtsg]
    owner = dice.choice(owners) if dice.random() < .85 else rtsg
    ends = dice.random() < .1  # what has ended refuses all that comes later, so it ends seldom
    try:
        names = [name for name in dir(owner)
                 if (not name.startswith("_") or name in SPECIAL) and name not in LEFT_OUT and (ends or name not in ENDS)]
        if name_of(owner) == "Node" and dice.random() < .6:
            names = [name for name in names if not name.startswith("_")] + list(owner.field_names) * 2
        name = dice.choice(names)
        if owner is not rtsg and dice.random() < (.3 if name_of(owner) == "Node" else .05):
            kind = owner.field_types.get(name) if name_of(owner) == "Node" else None
            value = field_value(kind, dice, made) if kind and dice.random() < .8 else any_value(dice, made)
            show(f"set {name_of(owner)}.{name} = {value!r:.300}")
            setattr(owner, name, value)
            return
        show(f"get {name_of(owner)}.{name}")
        item = getattr(owner, name)
        if not callable(item) or isinstance(item, type) and issubclass(item, BaseException):
            result = item
        else:
            known = parameters(item) or {"node": ""}
            given = [key for key in known if key not in ("args", "kwargs")]
            if known == {"node": ""} and name in ALSO:
                given = []
            positional = given[:dice.choice([len(given), 1, 1, 2, 2, 0, 3])]
            arguments = [fitting(key, known[key], dice, made) for key in positional] + [any_value(dice, made)] * (dice.random() < .1)
            optional = [key for key in (given + ALSO.get(name, []))[len(positional):] if dice.random() < .4 or key in ("width", "height", "seconds")]
            keywords = {key: fitting(key, known.get(key, ""), dice, made) for key in optional}
            show(f"call {name_of(owner)}.{name}{tuple(arguments)!r:.500} {keywords!r:.300}")
            result = item(*arguments, **keywords)
            if inspect.isgenerator(result) or hasattr(result, "__next__"):
                result = next(iter(result), None)
        show(f" -> {result!r:.100}")
        if result is not None and not isinstance(result, (str, bytes, int, float, type)):
            made.append(result)
            if isinstance(result, (list, tuple)):
                made += list(result)[:3]
    except Exception as error:  # what a misuse is told; anything but an exception is a fault
        show(f" -> {type(error).__name__}: {error!s:.150}")


# What the signatures of these do not tell.
ALSO = {"render": ["width", "height", "samples", "viewpoint", "integrator", "threads", "format"], "render_layers": ["width", "height", "samples", "threads"],
        "listen": ["seconds", "channels", "rays", "metrics", "responses"], "irradiance": ["samples", "threads"]}


def name_of(item):
    return "rtsg" if item is rtsg else type(item).__name__


def one_try(seed, number, show):
    dice = random.Random(f"{seed}/python/{number}")
    signal.setitimer(signal.ITIMER_PROF, SECONDS)  # of CPU
    signal.alarm(20 * SECONDS)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))
    os.chdir(tempfile.mkdtemp(dir=os.getcwd()))
    warnings.simplefilter("ignore")
    scene = rtsg.loads(TEXT)
    made = [scene, scene["BOX"], scene["PATH"], rtsg.Scene()]
    scene.frame(0)
    made.append(scene.record("a.rlog"))
    scene.frame(.1)
    scene.frame(.2)
    for _ in range(CALLS):
        one_call(dice, made, show)
        if len(made) > 40:
            del made[dice.randrange(4 if dice.random() < .1 else 3, len(made))]
        if dice.random() < .05:
            gc.collect()
    made.clear()
    del scene
    gc.collect()


def forked(options, number):
    """How the try ended, and what it called last."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        status = 3

        def show(text):
            os.write(writing, (text + "\n").encode(errors="backslashreplace")[:4000])
        try:
            one_try(options.seed, number, show)
            status = 0
        except SystemExit:
            status = 0
        except BaseException as error:
            show(f"ended by {type(error).__name__}: {error}")
        finally:
            os._exit(status)
    os.close(writing)
    said = b""
    while part := os.read(reading, 65536):
        said = (said + part)[-100000:]
    os.close(reading)
    return os.waitpid(child, 0)[1], said.decode(errors="replace")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--tries", type=int, default=100)
    parser.add_argument("--show", action="store_true")
    options = parser.parse_args()
    faults = 0
    for number in range(options.first, options.first + options.tries):
        status, said = forked(options, number)
        if options.show:
            print(said)
        if status != 0:
            faults += 1
            what = f"signal {os.WTERMSIG(status)}" if os.WIFSIGNALED(status) else f"status {os.WEXITSTATUS(status)}"
            print(f"FAULT: python: seed {options.seed}, try {number}: {what} after: " + " | ".join(said.strip().split("\n")[-2:])[:700], flush=True)
    print(f"{options.tries} tries, {faults} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
