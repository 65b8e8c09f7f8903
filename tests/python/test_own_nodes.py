"""Node types of one's own: tables of fields and functions, what becomes of exceptions, replicas and logs of them."""
import gc
import math
import weakref

import numpy as np
import pytest

import rtsg

PENDULUM = {"length": ("SFFloat", "inputOutput", 1), "amplitude": ("SFFloat", "inputOutput", .5), "enabled": ("SFBool", "inputOutput", True),
            "rotation_changed": ("SFRotation", "outputOnly")}


def swing(cascade, node):
    if not node.enabled:
        return None
    cascade.emit(node, "rotation_changed", (0, 0, 1, node.amplitude * math.sin(cascade.now * math.sqrt(9.81 / node.length))))
    return cascade.now


@pytest.fixture
def scene():
    scene = rtsg.Scene()
    scene.define("Pendulum", PENDULUM, on_time=swing)
    scene.root.add_child(scene.create("Pendulum", def_name="P", length=9.81))
    scene.add("DEF ARM Transform { }")
    scene.add_route("P.rotation_changed", "ARM.rotation")
    return scene


def test_it_swings_what_it_is_routed_to(scene):
    for k in range(61):
        changes = scene.frame(k / 10)
        assert scene["ARM"].rotation[3] == pytest.approx(.5 * math.sin(k / 10), abs=1e-6)
    assert "ARM.rotation" in changes and scene["P"].field_types["length"] == "SFFloat" and scene["P"].type_name == "Pendulum"


def test_it_rests_until_a_field_is_written(scene):
    scene.frame(0)
    scene["P"].enabled = False
    scene.frame(1)
    rests = scene["ARM"].rotation[3]
    for t in (2, 3):
        assert len(scene.frame(t)) == 0
    assert scene.rests_until == math.inf and scene["ARM"].rotation[3] == rests
    scene.send("P.enabled", True)
    scene.frame(4)
    assert scene["ARM"].rotation[3] == pytest.approx(.5 * math.sin(4), abs=1e-6)


def test_a_node_that_waits_for_a_time():
    times, scene = [], rtsg.Scene()

    def tick(cascade, node):
        times.append((cascade.previous, cascade.now))
        return cascade.now + .5

    scene.define("Tick", {}, on_time=tick)
    scene.root.add_child(scene.create("Tick"))
    for k in range(11):
        scene.frame(k / 10)
    assert [round(now, 6) for _, now in times] == [0, .5, 1]


def test_events_come_in_and_go_out():
    seen, scene = [], rtsg.Scene()

    def event(cascade, node, field, value):
        seen.append((field, np.asarray(value).tolist()))
        if field == "set_sum":
            cascade.emit(node, "total", node.total + value)
            cascade.emit(node, "total_changed", node.total)

    scene.define("Adder", {"set_sum": ("SFFloat", "inputOnly"), "total": ("SFFloat", "initializeOnly"), "total_changed": ("SFFloat", "outputOnly"),
                           "points": "MFVec3f", "name": ("SFString", "inputOutput", "none")}, on_event=event)
    scene.root.add_child(scene.create("Adder", def_name="A", name="sum"))
    scene.frame(0)
    scene.send("A.set_sum", 2)
    scene.send("A.points", [[1, 2, 3]])
    scene.frame(1)
    scene.send("A.set_sum", 3)
    changes = scene.frame(2)
    assert seen == [("set_sum", 2), ("points", [[1, 2, 3]]), ("set_sum", 3)]
    assert scene["A"].total == 5 and changes["A.total_changed"] == 5 and scene["A"].name == "sum"


def test_what_a_function_raises_is_raised_by_the_frame_and_ends_the_type_alone(scene):
    calls = []

    def fails(cascade, node):
        calls.append(cascade.now)
        raise LookupError("mine")

    scene.define("Broken", {}, on_time=fails)
    for name in "BC":
        scene.root.add_child(scene.create("Broken", def_name=name))
    with pytest.raises(LookupError, match="mine"):
        scene.frame(1)
    assert scene.now == 1 and scene["ARM"].rotation[3] == pytest.approx(.5 * math.sin(1), abs=1e-6)  # the frame was completed
    scene.frame(2)
    assert calls == [1] and scene["ARM"].rotation[3] == pytest.approx(.5 * math.sin(2), abs=1e-6)


@pytest.mark.parametrize("body, error", [(lambda c, n: "soon", TypeError), (lambda c, n: c.emit(n, "nothing", 1), rtsg.NoSuchField),
                                         (lambda c, n: c.emit(n, "length", "long"), TypeError), (lambda c, n: c.emit(n._scene_root, "x", 1), AttributeError),
                                         (lambda c: None, TypeError)])
def test_mistakes_in_functions(body, error):
    scene = rtsg.Scene()
    scene.define("Wrong", {"length": "SFFloat"}, on_time=body)
    scene.root.add_child(scene.create("Wrong"))
    with pytest.raises(error):
        scene.frame(0)


def test_a_function_leaves_the_scene_alone(tmp_path):
    scene, refused = rtsg.Scene(), []

    def meddles(cascade, node):
        for call in (lambda: scene.remove(node), lambda: setattr(node, "length", 2), lambda: scene.frame(1), scene.seal, lambda: scene.create("Group"),
                     lambda: scene.render(width=4, height=4), lambda: scene.pick((0, 0, 0), (0, 0, 1)), lambda: scene.record(tmp_path / "a.rlog"),
                     lambda: scene.subscribe(print), scene.serve, scene.snapshot, lambda: scene.listen(0), lambda: scene.save(tmp_path / "a.x3d"),
                     lambda: scene.define("More", {}), scene.close):
            with pytest.raises(rtsg.Error) as raised:
                call()
            refused.append(raised.value.code)
        cascade.emit(node, "length", 3)
        cascade.warn("it has tried")

    scene.define("Meddler", {"length": "SFFloat"}, on_time=meddles)
    node = scene.create("Meddler")
    scene.root.add_child(node)
    with pytest.warns(rtsg.DiagnosticWarning, match="it has tried"):
        scene.frame(0)
    assert set(refused) == {"from-within"} and len(refused) == 15 and node.length == 3


def test_a_cascade_is_good_for_its_call_alone():
    kept, scene = [], rtsg.Scene()
    scene.define("Keeper", {}, on_time=lambda cascade, node: kept.append((cascade, node)))
    scene.root.add_child(scene.create("Keeper"))
    scene.frame(0)
    with pytest.raises(rtsg.Closed):
        kept[0][0].now
    with pytest.raises(rtsg.Closed):
        kept[0][0].emit(kept[0][1], "x", 1)


def test_what_cannot_be_defined(scene):
    for name, fields, error in (("", {}, ValueError), ("Two Words", {}, ValueError), ("A", {"b c": "SFFloat"}, ValueError), ("A", {"b\0": "SFFloat"}, ValueError),
                                ("A", {1: "SFFloat"}, TypeError), ("A", {"a": (1,)}, TypeError), ("A", {"a": ("SFFloat", 1)}, TypeError), (b"A", {}, TypeError)):
        with pytest.raises(error):
            scene.define(name, fields)
    for fields, error in (({"a": "SFNothing"}, ValueError), ({"a": ("SFFloat", "sometimes")}, ValueError), ({"a": ("SFFloat", "inputOutput", "x")}, TypeError),
                          ({"a": ()}, ValueError)):
        with pytest.raises(error):
            scene.define("Other", fields)
    with pytest.raises(rtsg.Error):
        scene.define("Pendulum", {})
    with pytest.raises(rtsg.Error):
        scene.define("Transform", {})
    with pytest.raises(TypeError):
        scene.define("Other", {}, on_time=3)
    with pytest.raises(ValueError, match="implements X3DTimeDependantNode"):
        scene.define("Other", {}, implements=["X3DNode", "X3DTimeDependantNode"])
    scene.define("Other", {}, implements=["X3DNode", "X3DChildNode", "X3DTimeDependentNode"])
    assert scene.create("Other") in scene.nodes("X3DTimeDependentNode")


def test_it_is_mirrored_and_logged_like_any_other(scene, tmp_path):
    with scene.serve() as server, rtsg.follow(server.endpoint) as follower, scene.record(tmp_path / "a.rlog"):
        for k in range(10):
            scene.frame(k / 10)
        replica = follower.wait(number=scene.number)
        assert replica.hash == scene.hash and replica["P"].length == scene["P"].length
    log = rtsg.Log(tmp_path / "a.rlog")
    assert log.verify()["first_divergence"] is None
    angles = log.table("ARM.rotation")["ARM.rotation"][:, 3]
    assert angles[-1] == pytest.approx(.5 * math.sin(.9), abs=1e-6)
    report = rtsg.replay_test(tmp_path / "a.rlog", scene=build)  # run afresh on the recorded input
    assert report.passed, report.text


def build(scene):
    scene.define("Pendulum", PENDULUM, on_time=swing)
    scene.root.add_child(scene.create("Pendulum", def_name="P", length=9.81))
    scene.add("DEF ARM Transform { }")
    scene.add_route("P.rotation_changed", "ARM.rotation")


def test_functions_and_their_scene_are_let_go_together():
    class Thing:
        pass

    thing, scene = Thing(), rtsg.Scene()
    scene.define("Holder", {}, on_time=lambda cascade, node, held=(thing, scene): None)
    scene.root.add_child(scene.create("Holder"))
    scene.frame(0)
    gone = weakref.ref(thing)
    del thing, scene
    gc.collect()
    assert gone() is None
