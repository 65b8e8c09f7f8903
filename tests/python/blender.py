#!/usr/bin/env python3
"""Does the Blender add-on follow a session, send edits to it, and export X3D and glTF?

Starts the program and Debian's Blender without a window, which runs this file again (inside()). Exit status 77 where Blender, or pyzmq for
its Python, is not installed.
"""
import argparse
import importlib.util
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
PATIENCE = 60  # seconds


def until(done, session, what):
    end = time.monotonic() + PATIENCE
    while not done():
        session.step(.05)
        assert time.monotonic() < end, what


def inside(program, folder, endpoint, feed):
    """Within Blender."""
    import bpy
    from mathutils import Vector

    spec = importlib.util.spec_from_file_location("rtsg_session", ROOT / "python" / "blender" / "rtsg_session.py")
    addon = importlib.util.module_from_spec(spec)
    sys.modules["rtsg_session"] = addon
    spec.loader.exec_module(addon)
    addon.register()
    for one in list(bpy.data.objects):
        bpy.data.objects.remove(one)

    # What is served is there, upright, with its materials and meshes.
    session = addon.Session(endpoint)
    until(lambda: "palm" in bpy.data.objects, session, "no palm")

    def place(name):
        bpy.context.view_layer.update()
        return bpy.data.objects[name].matrix_world.translation

    height = .1 + .2 + .4 + .3
    assert (place("palm") - Vector((0, 0, height))).length < 1e-5, place("palm")
    beams = [o for o in bpy.data.objects if o.type == "MESH" and len(o.data.polygons) == 32]
    assert len(beams) == 2, beams
    orange = beams[0].data.materials[0]
    assert orange.name.startswith("orange") and abs(orange.diffuse_color[0] - .787) < .01, tuple(orange.diffuse_color)

    # A joint that a feed moves.
    def send(**line):
        with open(feed, "a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")

    send(node="elbow", field="angle", value=math.pi / 2)
    reached = Vector((.3, 0, .1 + .2 + .4))
    until(lambda: (place("palm") - reached).length < 1e-4, session, "the elbow does not bend")
    assert abs(bpy.data.objects["elbow"]["angle"] - math.pi / 2) < 1e-5

    # One that is moved here: by its property, and an object by hand.
    bpy.data.objects["elbow"]["angle"] = 0.0
    until(lambda: abs(session.follower.scene["elbow"]["angle"]) < 1e-6, session, "the property of a joint does not reach the origin")
    until(lambda: (place("palm") - Vector((0, 0, height))).length < 1e-4, session, "the elbow does not stretch")
    bpy.data.objects["wrist"].location.x += .25
    until(lambda: abs(session.follower.scene["wrist"]["translation"][0] - .25) < 1e-6, session, "an object that is moved does not reach the origin")
    assert session.problem == "", session.problem

    # A material, and what is no Transform any more.
    send(node="column", field="visible", value=False)
    until(lambda: "palm" not in bpy.data.objects, session, "what is not visible is still there")
    send(node="column", field="visible", value=True)
    until(lambda: "palm" in bpy.data.objects, session, "what is visible again is not there")
    session.close()

    # Export: the same places come back from the files.
    text = os.path.join(folder, "out.x3d")
    addon.export_x3d(text)
    bpy.ops.export_scene.gltf(filepath=os.path.join(folder, "out.glb"), export_format="GLB")
    for name in ("out.x3d", "out.glb"):
        checked = subprocess.run([program, "validate", os.path.join(folder, name)], capture_output=True, text=True, timeout=PATIENCE)
        assert checked.returncode == 0, checked.stdout + checked.stderr
    written = pathlib.Path(text).read_text(encoding="utf-8")
    assert "<Transform DEF='palm'" in written.replace('"', "'") and "PhysicalMaterial" in written
    exports(addon, folder, program)
    addon.unregister()
    print("all of it works")


def exports(addon, folder, program):
    """Within Blender: what the exporter makes of a scene, and what it says it leaves out."""
    import bpy
    import xml.etree.ElementTree as xml

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.frame_start, scene.frame_end = 320, 180, 1, 25

    def put(name, data, location=(0, 0, 0), parent=None):
        one = bpy.data.objects.new(name, data)
        one.location, one.parent = location, parent
        scene.collection.objects.link(one)
        return one

    def mesh(name, smooth=()):
        made = bpy.data.meshes.new(name)
        made.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1)], [], [(0, 1, 2, 3), (0, 4, 5, 1)])
        for number in smooth:
            made.polygons[number].use_smooth = True
        return made

    flat, bent = mesh("flat"), mesh("bent", (0,))
    paint = bpy.data.materials.new("Red paint")
    paint.use_nodes = True
    flat.materials.append(paint)
    mover, _, hidden = put("My Mover.001", flat), put("Twin", flat, (3, 0, 0)), put("Hidden", flat)
    put("Bent", bent, (6, 0, 0))
    hidden.hide_render = True
    pivot = put('Pivot <&> "q"', None, (0, 0, -2))
    child = put("Child", mesh("own"), parent=pivot)
    limit = child.constraints.new("LIMIT_LOCATION")
    limit.use_min_x, limit.min_x = True, 1.5
    for frame, height in ((1, 0), (13, 2), (25, 0)):
        mover.location.z = height
        mover.keyframe_insert("location", frame=frame)
    for curve in mover.animation_data.action.fcurves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    words = bpy.data.curves.new("Word", "FONT")
    words.body = "Hi"
    put("Word", words, (0, 0, 4))
    library = bpy.data.collections.new("Library")
    library.objects.link(bpy.data.objects.new("part", mesh("part")))
    for number in range(2):
        one = put(f"Copy {number}", None, (number, 9, 0))
        one.instance_type, one.instance_collection = "COLLECTION", library
    camera = bpy.data.cameras.new("Camera")
    scene.camera = put("Z camera", camera, (0, -10, 0))
    put("A camera", bpy.data.cameras.new("A"))
    spot = bpy.data.lights.new("Spot", "SPOT")
    spot.spot_size, spot.spot_blend = .6, .25
    put("Spot", spot)
    put("Bones", bpy.data.armatures.new("Bones"))
    scene.frame_set(1)
    bpy.context.view_layer.update()

    path = os.path.join(folder, "whole.x3d")
    losses = addon.export_x3d(path)
    assert losses == ["left out: bones: meshes stand as they do now (Bones)", "left out: hidden objects (Hidden)"], losses
    checked = subprocess.run([program, "validate", path], capture_output=True, text=True, timeout=PATIENCE)
    assert checked.returncode == 0 and checked.stdout + checked.stderr == "", checked.stdout + checked.stderr
    document = xml.parse(path).getroot()
    named = {node.get("DEF"): node for node in document.iter() if node.get("DEF")}

    def numbers(node, field):
        return [float(v) for v in node.get(field).replace(",", " ").split()]

    assert {"My_Mover_001", "Twin", "Pivot______q_", "Child", "Word", "Copy_0", "Copy_1"} <= set(named) and "Hidden" not in named, sorted(named)
    view = next(document.iter("Viewpoint"))
    assert view.get("description") == "Z camera", "the scene's camera is the first"
    # Half of 180 of 320 pixels, seen through a sensor whose width has the camera's angle.
    assert abs(float(view.get("fieldOfView")) - 2 * math.atan(math.tan(camera.angle / 2) * 180 / 320)) < 1e-5
    assert named["Twin"].find("Group").get("USE") == named["My_Mover_001"].find("Group").get("DEF"), "a mesh of two objects is there once"
    assert len(named["Copy_0"].findall(".//IndexedFaceSet")) + len(named["Copy_1"].findall(".//IndexedFaceSet")) == 1
    assert numbers(named["Child"], "translation") == [1.5, 0, 0], "where its constraint has it"
    assert named["Word"].findall(".//IndexedFaceSet") != []
    light = next(document.iter("SpotLight"))
    assert abs(float(light.get("cutOffAngle")) - .3) < 1e-6 and abs(float(light.get("beamWidth")) - .225) < 1e-6
    normals = named["Bent"].find(".//Normal")
    assert normals is not None and named["My_Mover_001"].find(".//Normal") is None
    flat_face = [numbers(normals, "vector")[3 * int(i):3 * int(i) + 3] for i in named["Bent"].find(".//IndexedFaceSet").get("normalIndex").split()[5:9]]
    assert all(abs(abs(normal[1]) - 1) < 1e-3 for normal in flat_face), flat_face
    clock, moves = next(document.iter("TimeSensor")), named["My_Mover_001_translation"]
    assert float(clock.get("cycleInterval")) == 1 and numbers(moves, "key") == [0, .5, 1], moves.attrib
    assert numbers(moves, "keyValue") == [0, 0, 0, 0, 0, 2, 0, 0, 0]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", required=True)
    program = os.path.abspath(parser.parse_args().program)
    blender = shutil.which("blender")
    if not blender:
        print("skipped: Blender is not installed (blender)")
        return 77
    # Debian's Blender uses the system's Python, and looks for the libraries of the first python3 in the path.
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "python"), "PYTHONDONTWRITEBYTECODE": "1", "PATH": "/usr/bin:/bin"}
    asked = subprocess.run([blender, "-b", "--python-use-system-env", "--python-exit-code", "3", "--python-expr", "import zmq, numpy"],
                           capture_output=True, text=True, env=environment, timeout=300)
    if asked.returncode != 0:
        print("skipped: Blender's Python has no pyzmq (python3-zmq)")
        return 77
    with tempfile.TemporaryDirectory() as folder:
        feed = os.path.join(folder, "feed")
        os.mkfifo(feed)
        kept = os.open(feed, os.O_RDWR)  # the pipe does not end when a writer closes it
        server = subprocess.Popen([program, "serve", str(ROOT / "examples/robot/arm.urdf"), "--package", f"arm={ROOT / 'examples/robot'}",
                                   "--bind", "tcp://127.0.0.1:*", "--upstream", "edits", "--feed", feed, "--json", "--for", "280s"],
                                  stdout=subprocess.PIPE, text=True)
        try:
            endpoint = json.loads(server.stdout.readline())["endpoint"]
            arguments = [program, folder, endpoint, feed]
            ran = subprocess.run([blender, "-b", "--factory-startup", "--python-use-system-env", "--python-exit-code", "3", "--python", __file__, "--", *arguments],
                                 capture_output=True, text=True, env=environment, timeout=280)
        finally:
            server.kill()
            server.wait()
            os.close(kept)
    if ran.returncode != 0 or "all of it works" not in ran.stdout:
        print(ran.stdout[-4000:], ran.stderr[-4000:])
        return 1
    return 0


if __name__ == "__main__":
    if "bpy" in sys.modules or "--" in sys.argv:
        inside(*sys.argv[sys.argv.index("--") + 1:])
    else:
        sys.exit(main())
