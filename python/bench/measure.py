"""Measures the Python package: a JSON line each, with the same work in NumPy alone beside it, as `rtsg bench` prints.

    PYTHONPATH=build/python python3 python/bench/measure.py
"""
import json
import os
import tempfile
import time

import numpy as np
import rtsg


def best(work, times):
    """The least CPU time of a call, seconds: what else the machine does counts little."""
    spent = []
    for _ in range(times):
        begin = time.process_time()
        work()
        spent.append(time.process_time() - begin)
    return min(spent)


def report(case, metric, unit, value, baseline, beside, limit):
    print(json.dumps({"bench": "python", "case": case, "metric": metric, "unit": unit, "value": round(value, 4),
                      "baseline": {"name": baseline, "value": round(beside, 4)}, "limit": {"name": "asked for", "value": limit}}))


def points():
    scene = rtsg.Scene()
    node = scene.create("Coordinate")
    given, target = np.random.default_rng(1).random((1_000_000, 3), dtype=np.float32), np.empty((1_000_000, 3), np.float32)

    def there_and_back():
        node.point = given
        return node.point[-1, 0]

    report("1,000,000 points", "set and read", "ms", 1e3 * best(there_and_back, 20), "numpy.copyto", 1e3 * best(lambda: np.copyto(target, given), 20), 10)
    wide = given.astype(float)

    def from_doubles():
        node.point = wide

    report("1,000,000 points", "set from doubles", "ms", 1e3 * best(from_doubles, 20), "numpy.copyto", 1e3 * best(lambda: np.copyto(target, wide), 20), 20)


def frames():
    count = 20_000

    def of(scene):
        def run():
            for _ in range(count):
                scene.frame(scene.now + .001)
        return best(run, 5) / count * 1e6

    def made(subscribers):
        scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Immersive\nDEF C TimeSensor { loop TRUE }")
        for _ in range(subscribers):
            scene.subscribe(len)
        return scene

    alone, ten = of(made(0)), of(made(10))
    report("a clock", "frame", "us", alone, "none", 0, 20)
    report("a clock", "a subscriber", "us a frame", (ten - alone) / 10, "a frame without", alone, 3)


def fields():
    scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Immersive\nDEF T Transform { }")
    node, count, value = scene["T"], 100_000, (1., 2., 3.)

    def each(work):
        return best(lambda: [work() for _ in range(count)], 3) / count * 1e6

    report("a vector", "read a field", "us", each(lambda: node.translation), "numpy.array", each(lambda: np.array(value, np.float32)), 3)
    report("a vector", "set a field", "us", each(lambda: setattr(node, "translation", value)), "numpy.array", each(lambda: np.array(value, np.float32)), 5)
    report("a node", "find by its name", "us", each(lambda: scene["T"]), "a dict", each(lambda: {"T": node}["T"]), 3)


def columns(count=216_000):
    """An hour at 60 Hz of a scene that moves; beside it the same log stepped through state by state."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "a.rlog")
        scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Immersive\nDEF C TimeSensor { loop TRUE }\nDEF P PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 1 0 0 ] }\n"
                           "DEF T Transform { }\nROUTE C.fraction_changed TO P.set_fraction\nROUTE P.value_changed TO T.translation\n" + "Transform { }\n" * 100)
        with scene.record(path, inputs=False):
            for k in range(count):
                scene.frame(k / 60)
        log = rtsg.Log(path)
        rows = len(log.table("T.translation")["time"])
        report(f"{rows:,} states", "a column", "ms", 1e3 * best(lambda: log.table("T.translation"), 3), "Replayer::step() alone",
               1e3 * best(log.verify, 3), 1e3 * 2 * best(log.verify, 3))


def clicks(count=2000):
    """From an event to a function that hears of it, frame included; beside it the same frame without a listener, and the clock's own cost."""
    scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Immersive\nDEF BUTTON BooleanFilter { }")
    heard = []
    scene.subscribe(lambda changes: heard.append(time.perf_counter()))

    def delays():
        all = []
        for k in range(count):
            begin = time.perf_counter()
            scene.send("BUTTON.set_boolean", k % 2 == 0)
            scene.frame(scene.now + .001)
            all.append(1e6 * (heard[-1] - begin))
        return sorted(all)

    ours = delays()
    begin, calls = time.perf_counter(), []
    for _ in range(count):
        (lambda: calls.append(time.perf_counter()))()
    alone = 1e6 * (time.perf_counter() - begin) / count
    report("an event", "to a function in Python, median", "us", ours[len(ours) // 2], "the function alone", alone, 1000)
    report("an event", "to a function in Python, p99", "us", ours[len(ours) * 99 // 100], "the function alone", alone, 5000)


if __name__ == "__main__":
    points()
    frames()
    fields()
    clicks()
    columns()
