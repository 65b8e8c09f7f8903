"""Blender add-on: follows an RTSG session, sends edits to it, and exports X3D.

Install this file under Edit > Preferences > Add-ons. The panel is in the sidebar of the 3D view, under RTSG. To follow, it needs the
Python package rtsg (one folder, no compiled part of it) and pyzmq: the preferences name the folder that has it.

What is followed: Transforms and groups are empties, shapes are meshes with materials, viewpoints are cameras, and lights are lights; each
has the name of its node. Whoever moves such an object, or changes the property of a joint, asks the origin for it. X3D's y axis points up and
Blender's z axis does: an empty at the top turns one to the other.
"""
import base64
import math
import os
import sys
import urllib.parse
import xml.sax.saxutils

import bpy
import numpy as np
from bpy.props import BoolProperty, StringProperty
from bpy_extras.io_utils import ExportHelper
from mathutils import Matrix, Quaternion, Vector

bl_info = {"name": "RTSG session", "author": "RTSG", "version": (0, 3, 0), "blender": (3, 0, 0), "category": "Import-Export",
           "location": "3D View > Sidebar > RTSG; File > Export", "description": "Follow and edit an RTSG session; export X3D"}

_UP = Matrix.Rotation(math.pi / 2, 4, "X")  # from X3D, where y points up, to Blender
_DEEPEST = 200  # levels of nodes; a scene may refer to itself
_MOVED = 1e-6  # metres and parts of a turn; less is rounding


# ---- values of X3D ---------------------------------------------------------------------------------------------------


def _rotation(value):
    x, y, z, angle = (float(v) for v in value)
    return Matrix.Identity(4) if x == y == z == 0 else Matrix.Rotation(angle, 4, Vector((x, y, z)))


def _axis_angle(quaternion):
    axis, angle = quaternion.to_axis_angle()
    return [axis.x, axis.y, axis.z, angle] if angle else [0.0, 0.0, 1.0, 0.0]


def _transform(node):
    """ISO/IEC 19775-1 10.4.4: T C R SR S -SR -C."""
    center = Matrix.Translation(Vector(node["center"]))
    tilt = _rotation(node["scaleOrientation"])
    scale = Matrix.Diagonal((*(float(v) for v in node["scale"]), 1))
    return Matrix.Translation(Vector(node["translation"])) @ center @ _rotation(node["rotation"]) @ tilt @ scale @ tilt.inverted() @ center.inverted()


def _polygons(indices):
    """Lists of polygons of a coordIndex."""
    polygon, all_of_them = [], []
    for index in (int(i) for i in indices):
        if index >= 0:
            polygon.append(index)
            continue
        if len(polygon) > 2:
            all_of_them.append(polygon)
        polygon = []
    return all_of_them + ([polygon] if len(polygon) > 2 else [])


def _triangles(indices):
    return [indices[i:i + 3] for i in range(0, len(indices) - 2, 3)]


def _box(size):
    x, y, z = (float(v) / 2 for v in size)
    points = [(sx * x, sy * y, sz * z) for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)]
    return points, [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def _turned(profile, count=32):
    """A body of rotation about y: `profile` lists (radius, y) from the bottom to the top."""
    points, faces = [], []
    for radius, y in profile:
        points += [(radius * math.cos(2 * math.pi * i / count), y, -radius * math.sin(2 * math.pi * i / count)) for i in range(count)]
    for ring in range(len(profile) - 1):
        for i in range(count):
            a, b = ring * count + i, ring * count + (i + 1) % count
            faces.append((a, b, b + count, a + count))
    return points, [list(range(count - 1, -1, -1)), *faces, [len(points) - count + i for i in range(count)]]


def _shape_of(node):
    """(points, polygons) of a geometry node; None: of a kind that is not shown here."""
    kind = node.type_name
    if kind == "InlineGeometry":
        return _shape_of(node["body"][0]) if node["body"] else None
    if kind == "Box":
        return _box(node["size"])
    if kind == "Cylinder":
        return _turned([(node["radius"], -node["height"] / 2), (node["radius"], node["height"] / 2)])
    if kind == "Cone":
        return _turned([(node["bottomRadius"], -node["height"] / 2), (1e-6, node["height"] / 2)])
    if kind == "Sphere":
        return _turned([(node["radius"] * math.cos(a), node["radius"] * math.sin(a)) for a in np.linspace(-1.5707, 1.5707, 17)])
    if "coord" not in node.field_names or node["coord"] is None:
        return None
    points = [tuple(map(float, p)) for p in node["coord"]["point"]]
    if kind == "IndexedFaceSet":
        faces = _polygons(node["coordIndex"])
    elif kind == "IndexedTriangleSet":
        faces = _triangles([int(i) for i in node["index"]])
    elif kind == "TriangleSet":
        faces = _triangles(range(len(points)))
    else:
        return None
    return points, [face for face in faces if max(face) < len(points)]


# ---- following -------------------------------------------------------------------------------------------------------


class Session:
    """A served scene as objects of Blender. `step()` is called by a timer, or by whoever has none."""

    def __init__(self, endpoint, name="blender"):
        from rtsg import pure
        self.follower = pure.follow(endpoint, name=name)
        self.collection = bpy.data.collections.new("RTSG")
        bpy.context.scene.collection.children.link(self.collection)
        self.objects, self.applied, self.materials, self.given = {}, {}, {}, {}
        self.root, self.problem, self.requests = None, "", {}

    # ---- from the session to Blender
    def step(self, timeout=0.0):
        """Applies what has come, and sends what was moved here. Returns the number of sets of changes."""
        self.send()
        sets = self.follower.poll(timeout)
        for verdict in self.follower.verdicts():
            path = self.requests.pop(verdict.request, "")
            if verdict.refusal:
                self.problem = f"{path}: {verdict.refusal}"
                self.moved_back(path)
        if any(changes.is_snapshot for changes in sets) or not all(self.take(changes) for changes in sets):
            self.build()
        if sets:
            self.applied = {o.name: self.pose_of(o) for o in self.collection.objects}
        return len(sets)

    def take(self, changes):
        """Whether a set was no more than values of what is shown."""
        moved, looks = set(), set()
        for change in changes:
            if change.kind in ("define_type", "add_route", "remove_route", "event"):
                continue
            node = change.node
            if change.kind != "set_field" or not node.is_alive:
                return False
            if change.field in ("translation", "rotation", "scale", "center", "scaleOrientation") and "translation" in node.field_names:
                moved.add(node.node_id)
            elif node.type_name in ("Material", "PhysicalMaterial", "UnlitMaterial"):
                looks.add(node.node_id)
            elif change.field in self.given.get(node.node_id, ()):
                for one in self.objects.get(node.node_id, []):
                    one[change.field] = float(node[change.field])
            elif change.field in self.shown(node):
                return False
        for number in moved:
            self.place(number)
        for number in looks:
            self.color(number)
        return True

    @staticmethod
    def shown(node):
        """Fields whose change means that objects have to be made anew."""
        if node.type_name in ("Coordinate", "Box", "Sphere", "Cylinder", "Cone", "IndexedFaceSet", "IndexedTriangleSet", "TriangleSet"):
            return node.field_names
        return ("children", "body", "whichChoice", "visible", "geometry", "appearance", "coord", "material", "load")

    def build(self):
        """All objects anew."""
        for one in list(self.collection.objects):
            bpy.data.objects.remove(one)
        self.objects, self.materials, self.given = {}, {}, {}
        self.root = self.add("RTSG", None, None)
        self.root.matrix_basis = _UP
        self.below(self.follower.scene.root, self.root, 0)
        self.applied = {o.name: self.pose_of(o) for o in self.collection.objects}

    def add(self, name, data, parent, node=None):
        one = bpy.data.objects.new(name, data)
        one.parent = parent
        self.collection.objects.link(one)
        if node is not None:
            one["rtsg"] = node.node_id
            self.objects.setdefault(node.node_id, []).append(one)
        return one

    def below(self, node, parent, depth):
        if node is None or depth > _DEEPEST:
            return
        kind, fields = node.type_name, node.field_names
        if kind == "Switch":
            children = node["children"]
            chosen = node["whichChoice"]
            return self.below(children[chosen] if 0 <= chosen < len(children) else None, parent, depth + 1)
        if "visible" in fields and not node["visible"]:
            return
        if kind == "Shape":
            return self.shape(node, parent)
        name = node.def_name or kind
        if kind.endswith("Viewpoint") and "position" in fields:
            return self.viewpoint(node, parent, name)
        if kind.endswith("Light"):
            return self.light(node, parent, name)
        lists = [node[field] for field in ("body", "children", "shapes", "skin") if field in node._inside().type.index]
        if not lists:
            return
        here = parent
        if kind != "RtsgScene":
            here = self.add(name, None, parent, node)
            self.joint(node, here)
            if "translation" in fields and "scaleOrientation" in fields:
                here.matrix_basis = _transform(node)
        # The children of a prototype's instance are in its body.
        for child in lists[0]:
            self.below(child, here, depth + 1)

    def joint(self, node, one):
        """Numbers of a prototype's instance are properties that may be changed here."""
        inside = node._inside().type
        if "body" not in inside.index or node.type_name in ("Inline", "InlineGeometry"):
            return
        names = [field for field, kind in node.field_types.items() if kind == "SFFloat" and inside.fields[inside.index[field]].access == 3]
        self.given[node.node_id] = set(names)
        for field in names:
            one[field] = float(node[field])

    def shape(self, node, parent):
        geometry = node["geometry"]
        made = _shape_of(geometry) if geometry is not None else None
        if made is None:
            return
        mesh = bpy.data.meshes.new(node.def_name or geometry.type_name)
        mesh.from_pydata(made[0], [], made[1])
        mesh.validate()
        appearance = node["appearance"]
        material = appearance["material"] if appearance is not None and appearance.type_name == "Appearance" else None
        if material is not None:
            mesh.materials.append(self.material(material, appearance.def_name or material.def_name or material.type_name))
        self.add(node.def_name or geometry.type_name, mesh, parent, node)

    def material(self, node, name):
        if node.node_id not in self.materials:
            self.materials[node.node_id] = bpy.data.materials.new(name)
            self.materials[node.node_id].use_nodes = True
            self.color(node.node_id)
        return self.materials[node.node_id]

    def color(self, number):
        material = self.materials.get(number)
        if material is None:
            return
        node = self.follower.scene.node(number)
        fields = node.field_names
        base = next(field for field in ("baseColor", "diffuseColor", "emissiveColor") if field in fields)
        rgb = [float(v) for v in node[base]]
        if base == "diffuseColor":  # display values, as Blender's are light
            rgb = [v / 12.92 if v <= .04045 else ((v + .055) / 1.055) ** 2.4 for v in rgb]
        shader = material.node_tree.nodes.get("Principled BSDF")
        shader.inputs["Base Color"].default_value = (*rgb, 1)
        shader.inputs["Alpha"].default_value = 1 - float(node["transparency"])
        shader.inputs["Metallic"].default_value = float(node["metallic"]) if "metallic" in fields else 0
        shader.inputs["Roughness"].default_value = float(node["roughness"]) if "roughness" in fields else .6
        material.diffuse_color = (*rgb, 1 - float(node["transparency"]))

    def viewpoint(self, node, parent, name):
        camera = bpy.data.cameras.new(name)
        render = bpy.context.scene.render
        wide = render.resolution_x * render.pixel_aspect_x >= render.resolution_y * render.pixel_aspect_y
        camera.sensor_fit = "VERTICAL" if wide else "HORIZONTAL"  # X3D's angle is that of the smaller side
        if "fieldOfView" in node.field_names and isinstance(node["fieldOfView"], float):
            camera.angle = node["fieldOfView"]
        one = self.add(name, camera, parent, node)
        one.matrix_basis = Matrix.Translation(Vector(node["position"])) @ _rotation(node["orientation"])

    def light(self, node, parent, name):
        kinds = {"PointLight": "POINT", "SpotLight": "SPOT", "DirectionalLight": "SUN"}
        if node.type_name not in kinds:
            return
        light = bpy.data.lights.new(name, kinds[node.type_name])
        light.color = [float(v) for v in node["color"]]
        light.energy = float(node["intensity"]) * (4 * math.pi if node.type_name != "DirectionalLight" else 1)
        if node.type_name == "SpotLight":
            light.spot_size = 2 * float(node["cutOffAngle"])
            light.spot_blend = 1 - min(float(node["beamWidth"]) / max(float(node["cutOffAngle"]), 1e-6), 1)
        one = self.add(name, light, parent, node)
        at = Matrix.Translation(Vector(node["location"])) if "location" in node.field_names else Matrix.Identity(4)
        way = Vector(node["direction"]) if "direction" in node.field_names else Vector((0, 0, -1))
        one.matrix_basis = at @ Vector((0, 0, -1)).rotation_difference(way).to_matrix().to_4x4()

    def place(self, number):
        node = self.follower.scene.node(number)
        if "scaleOrientation" not in node.field_names:
            return
        for one in self.objects.get(number, []):
            one.matrix_basis = _transform(node)

    # ---- from Blender to the session
    def pose_of(self, one):
        joint = self.given.get(one.get("rtsg", 0), ())
        return one.matrix_basis.copy(), {field: float(one[field]) for field in joint if field in one}

    def send(self):
        """Asks the origin for what was moved here since it was last looked at."""
        for one in list(self.collection.objects):
            number, before = one.get("rtsg", 0), self.applied.get(one.name)
            if not number or before is None:
                continue
            now = self.pose_of(one)
            self.applied[one.name] = now
            for field, value in now[1].items():
                if abs(value - before[1].get(field, value)) > _MOVED:
                    self.ask(self.follower.send, f"#{number}.{field}", value)
            if max(abs(a - b) for x, y in zip(now[0], before[0]) for a, b in zip(x, y)) > _MOVED:
                self.send_pose(one, number)

    def send_pose(self, one, number):
        node = self.follower.scene.node(number)
        if "scaleOrientation" not in node.field_names:
            return
        # The center stays where it is: what it adds goes into the translation.
        place, turn, scale = one.matrix_basis.decompose()
        center = Vector(node["center"])
        moved = place - center + turn.to_matrix() @ Matrix.Diagonal(scale) @ center
        self.ask(self.follower.edit, f"#{number}.translation", list(moved))
        self.ask(self.follower.edit, f"#{number}.rotation", _axis_angle(turn))
        self.ask(self.follower.edit, f"#{number}.scale", list(scale))

    def ask(self, how, path, value):
        name, _, field = path.rpartition(".")
        now = self.follower.scene[name][field]
        if np.allclose(np.asarray(now, float), np.asarray(value, float), atol=_MOVED):
            return
        self.requests[how(path, value)] = path

    def moved_back(self, path):
        number = int(path.partition(".")[0][1:] or 0)
        if number in self.objects:
            self.place(number)
            for one in self.objects[number]:
                for field in self.given.get(number, ()):
                    one[field] = float(self.follower.scene.node(number)[field])
                self.applied[one.name] = self.pose_of(one)

    def close(self):
        self.follower.close()


# ---- exporting X3D ---------------------------------------------------------------------------------------------------

_MESHES = ("MESH", "FONT", "CURVE", "SURFACE", "META")
_STILL = 1e-5  # metres and parts of a turn between keys that are left out, and what they say


def _numbers(values):
    return " ".join(f"{round(float(v), 6) + 0:g}" for v in values)


def _quoted(text):
    return xml.sax.saxutils.quoteattr(str(text))


def _placed(matrix):
    """The fields of a Transform: (translation, rotation, scale, scaleOrientation), the last of which shear needs."""
    place, turn, scale = matrix.decompose()
    again = Matrix.Translation(place) @ turn.to_matrix().to_4x4() @ Matrix.Diagonal((*scale, 1))
    size = max(abs(v) for row in matrix for v in row)
    if max(abs(a - b) for x, y in zip(again, matrix) for a, b in zip(x, y)) <= _STILL * max(size, 1):
        return [*place], _axis_angle(turn), [*scale], [0, 0, 1, 0]
    left, sizes, right = np.linalg.svd(np.array(matrix.to_3x3(), float))
    turn, sign = left @ right, np.sign(np.linalg.det(left @ right))
    tilt = right.T * np.sign(np.linalg.det(right))
    return [*place], _axis_angle(Matrix((turn * sign).tolist()).to_quaternion()), [*(sizes * sign)], _axis_angle(Matrix(tilt.tolist()).to_quaternion())


def _display(light):
    """What a screen shows of light: X3D's colours of skies."""
    return [min(max(12.92 * v if v <= .0031308 else 1.055 * v ** (1 / 2.4) - .055, 0), 1) for v in light]


def _kept(times, values):
    """The numbers of keys between which straight lines give all values, as far as anybody sees."""
    kept, values = [0], np.asarray(values, float)
    waiting = [(0, len(times) - 1)]
    while waiting:  # Douglas and Peucker's way to fewer points
        first, last = waiting.pop()
        if last - first < 2:
            kept.append(last)
            continue
        part = (np.asarray(times[first:last + 1]) - times[first]) / (times[last] - times[first])
        apart = np.abs(values[first] + part[:, None] * (values[last] - values[first]) - values[first:last + 1]).max(axis=1)
        worst = int(apart.argmax())
        if apart[worst] <= _STILL:
            kept.append(last)
        else:
            waiting += [(first + worst, last), (first, first + worst)]
    return sorted(set(kept))


class _X3dWriter:
    """Objects as Transforms of their names, so that `rtsg serve --reload` finds them again after an edit."""

    def __init__(self, objects, path):
        self.scene, self.folder = bpy.context.scene, os.path.dirname(os.path.abspath(path))
        self.graph = bpy.context.evaluated_depsgraph_get()
        self.lines, self.routes, self.names, self.taken, self.shared, self.lost = [], [], {}, set(), set(), {}
        self.chosen = {o for o in objects if self.is_seen(o)}
        self.objects = set()  # the chosen ones, and those that they hang on
        for one in self.chosen:
            while one is not None and one not in self.objects:
                self.objects.add(one)
                one = one.parent if one.parent in set(objects) else None
        self.instances = {}
        for each in self.graph.object_instances:
            # Text and curves are copies of themselves there.
            if each.is_instance and each.parent and each.parent.original in self.chosen and each.object.original != each.parent.original:
                self.instances.setdefault(each.parent.original, []).append((each.object.original, each.matrix_world.copy()))

    def is_seen(self, one):
        if one.hide_render or not one.visible_get():
            self.lose("hidden objects", one.name)
            return False
        if one.type not in (*_MESHES, "EMPTY", "CAMERA", "LIGHT"):
            self.lose({"ARMATURE": "bones: meshes stand as they do now"}.get(one.type, f"objects of the kind {one.type.lower()}"), one.name)
            return one.type == "ARMATURE"
        return True

    def lose(self, what, name):
        names = self.lost.setdefault(what, [])
        if name not in names:
            names.append(name)

    def losses(self):
        return [f"left out: {what} ({', '.join(sorted(names)[:5])}{', ...' if len(names) > 5 else ''})" for what, names in sorted(self.lost.items())]

    def name(self, kind, given):
        """A name that every encoding can spell, and that no other node has."""
        if (kind, given) not in self.names:
            plain = "".join(c if c.isalnum() or c in "_-" else "_" for c in given) or "_"
            plain = free = "_" + plain if plain[0].isdigit() or plain[0] == "-" else plain
            count = 1
            while free in self.taken:
                count += 1
                free = f"{plain}_{count}"
            self.taken.add(free)
            self.names[kind, given] = free
        return self.names[kind, given]

    def text(self):
        self.taken |= {"BlenderAxes", "BlenderClock"}
        for one in sorted(self.objects, key=lambda o: o.name):  # theirs are the names that stay
            self.name("object", one.name)
        self.say(0, "<X3D profile='Full' version='4.0'><Scene>")
        self.world()
        self.say(1, "<Transform DEF='BlenderAxes' rotation='1 0 0 -1.5707963'>")
        for one in self.ordered(o for o in self.objects if o.parent not in self.objects):
            self.object(one, 2)
        self.say(1, "</Transform>")
        self.motions()
        self.say(0, "</Scene></X3D>")
        return "\n".join(["<?xml version='1.0' encoding='UTF-8'?>", *self.lines, ""])

    def say(self, depth, line):
        self.lines.append("  " * depth + line)

    def ordered(self, objects):
        """By name; but the scene's camera comes first, as the first viewpoint is the one that is seen through."""
        above, one = set(), self.scene.camera
        while one is not None:
            above.add(one)
            one = one.parent
        return sorted(objects, key=lambda o: (o not in above, o.name))

    # ---- places
    def local(self, one):
        """Where constraints and parents put it: relative to the object around it in the file."""
        here = one.evaluated_get(self.graph).matrix_world
        if one.parent not in self.objects:
            return here
        around = one.parent.evaluated_get(self.graph).matrix_world
        try:
            return around.inverted() @ here
        except ValueError:
            self.lose("places below objects of size 0", one.name)
            return Matrix.Identity(4)

    @staticmethod
    def fields(matrix):
        place, turn, scale, tilt = _placed(matrix)
        tilted = f" scaleOrientation='{_numbers(tilt)}'" if tilt[3] else ""
        return f"translation='{_numbers(place)}' rotation='{_numbers(turn)}' scale='{_numbers(scale)}'{tilted}"

    def object(self, one, depth):
        self.say(depth, f"<Transform DEF={_quoted(self.name('object', one.name))} {self.fields(self.local(one))}>")
        if one in self.chosen:
            self.content(one, depth + 1)
        inverse = one.evaluated_get(self.graph).matrix_world.inverted_safe()
        for copied, matrix in self.instances.get(one, []):
            self.say(depth + 1, f"<Transform {self.fields(inverse @ matrix)}>")
            self.content(copied, depth + 2, True)
            self.say(depth + 1, "</Transform>")
        for child in self.ordered(o for o in one.children if o in self.objects):
            self.object(child, depth + 1)
        self.say(depth, "</Transform>")

    def content(self, one, depth, is_copy=False):
        if one.type in _MESHES:
            self.mesh(one, depth)
        elif one.type == "CAMERA" and not is_copy:
            self.camera(one, depth)
        elif one.type == "LIGHT":
            self.light(one, depth)

    def camera(self, one, depth):
        data = one.data
        corners = [Vector(v) for v in data.view_frame(scene=self.scene)]
        low, high = [min(c[i] for c in corners) for i in (0, 1)], [max(c[i] for c in corners) for i in (0, 1)]
        said = f"description={_quoted(one.name)} position='0 0 0' nearDistance='{data.clip_start:g}' farDistance='{data.clip_end:g}'"
        if data.type == "ORTHO":
            return self.say(depth, f"<OrthoViewpoint {said} fieldOfView='{_numbers([*low, *high])}'/>")
        if data.type != "PERSP":
            self.lose("panoramas: their cameras are plain ones", one.name)
        if data.shift_x or data.shift_y:
            self.lose("shifts of cameras", one.name)
        if data.dof.use_dof:
            self.lose("depth of field", one.name)
        side = min(high[0] - low[0], high[1] - low[1])  # X3D's angle is that of the smaller side
        self.say(depth, f"<Viewpoint {said} fieldOfView='{min(2 * math.atan2(side / 2, abs(corners[0].z)), 3):g}'/>")

    def light(self, one, depth):
        light = one.data
        color = f"color='{_numbers(min(v, 1) for v in light.color)}' global='true'"
        far = "location='0 0 0' attenuation='0 0 1' radius='1000000'"
        if light.use_nodes and light.node_tree and any(n.type not in ("EMISSION", "OUTPUT_LIGHT") for n in light.node_tree.nodes):
            self.lose("nodes of lights", one.name)
        if light.type == "SUN":
            self.say(depth, f"<DirectionalLight direction='0 0 -1' intensity='{light.energy:g}' {color}/>")
        elif light.type == "SPOT":
            cut = min(light.spot_size / 2, math.pi / 2)
            self.say(depth, f"<SpotLight direction='0 0 -1' cutOffAngle='{cut:g}' beamWidth='{cut * (1 - light.spot_blend):g}' {far} "
                            f"intensity='{light.energy / (4 * math.pi):g}' {color}/>")
        elif light.type == "AREA":
            self.lose("sizes of area lights: they shine from their middle", one.name)
            self.say(depth, f"<SpotLight direction='0 0 -1' cutOffAngle='1.5707' beamWidth='0.01' {far} intensity='{light.energy / math.pi:g}' {color}/>")
        else:
            self.say(depth, f"<PointLight {far} intensity='{light.energy / (4 * math.pi):g}' {color}/>")

    def world(self):
        world = self.scene.world
        if world is None:
            return
        light = [*world.color]
        sky = next((n for n in world.node_tree.nodes if n.type == "BACKGROUND"), None) if world.use_nodes and world.node_tree else None
        if sky:
            light = [v * sky.inputs["Strength"].default_value for v in sky.inputs["Color"].default_value[:3]]
            if sky.inputs["Color"].links:
                return self.lose("pictures and nodes of the world", world.name)
        self.say(1, f"<Background skyColor='{_numbers(_display(light))}'/>")
        if any(light):
            self.lose("light of the world", world.name)

    # ---- meshes
    def mesh(self, one, depth):
        """Objects that have one mesh share it, unless something changes it for each."""
        own = one.modifiers or any(slot.link == "OBJECT" for slot in one.material_slots)
        key = ("mesh", one.name + " mesh") if own else ("mesh", one.data.name)
        if key in self.shared:
            return self.say(depth, f"<Group USE={_quoted(self.name(*key))}/>")
        evaluated = one.evaluated_get(self.graph)
        try:
            mesh = evaluated.to_mesh()
        except RuntimeError:  # a metaball that another one has taken in
            return
        if mesh is None or not len(mesh.polygons):
            evaluated.to_mesh_clear()
            return self.lose("objects without faces", one.name)
        self.shared.add(key)
        self.say(depth, f"<Group DEF={_quoted(self.name(*key))}>")
        self.shapes(one, key, mesh, [slot.material for slot in evaluated.material_slots], depth + 1)
        self.say(depth, "</Group>")
        edges = np.empty(len(mesh.loops), np.int32)
        mesh.loops.foreach_get("edge_index", edges)
        if len(np.unique(edges)) < len(mesh.edges):
            self.lose("edges without faces", one.name)
        evaluated.to_mesh_clear()

    def shapes(self, one, key, mesh, materials, depth):
        points = _numbers(v for vertex in mesh.vertices for v in vertex.co)
        coordinate = self.name("points", f"{key[1]} points") if len(materials) > 1 else ""
        is_smooth = any(p.use_smooth for p in mesh.polygons)
        if is_smooth and hasattr(mesh, "calc_normals_split"):  # Blender below 4.1
            mesh.calc_normals_split()
        is_first = True
        for slot in range(max(1, len(materials))):
            faces = [p for p in mesh.polygons if min(p.material_index, max(0, len(materials) - 1)) == slot]
            if not faces:
                continue
            material = materials[slot] if materials else None
            parts = []
            fields = f"coordIndex='{' '.join(' '.join(map(str, p.vertices)) + ' -1' for p in faces)}'"
            if is_smooth:
                corner = mesh.corner_normals if hasattr(mesh, "corner_normals") else None
                fields += self.listed("normal", "Normal vector", faces, lambda i: (round(v, 4) for v in (corner[i].vector if corner else mesh.loops[i].normal)), parts)
            if mesh.uv_layers.active:
                layer = mesh.uv_layers.active.data
                fields += self.listed("texCoord", "TextureCoordinate point", faces, lambda i: layer[i].uv, parts)
            colors = self.colors(one, mesh, material)
            if colors:
                fields += self.listed("color", "ColorRGBA color", faces, lambda i: colors.data[mesh.loops[i].vertex_index if colors.domain == "POINT" else i].color, parts)
            self.say(depth, "<Shape>")
            self.material(material, depth + 1)
            self.say(depth + 1, f"<IndexedFaceSet solid='{'true' if material and material.use_backface_culling else 'false'}' {fields}>")
            self.say(depth + 2, f"<Coordinate{f' DEF={_quoted(coordinate)}' if coordinate else ''} point='{points}'/>" if is_first else f"<Coordinate USE={_quoted(coordinate)}/>")
            for part in parts:
                self.say(depth + 2, part)
            self.say(depth + 1, "</IndexedFaceSet>")
            self.say(depth, "</Shape>")
            is_first = False

    @staticmethod
    def listed(field, node, faces, value, parts):
        """The index of corners' values, each of which is in the list once; the list is added to the parts."""
        known, index = {}, []
        for face in faces:
            index += [str(known.setdefault(_numbers(value(i)), len(known))) for i in face.loop_indices] + ["-1"]
        name, its = node.split()
        parts.append(f"<{name} {its}='{' '.join(known)}'/>")
        return f" {field}Index='{' '.join(index)}'"

    def colors(self, one, mesh, material):
        """Colours of points, where a material shows them: in X3D they take the place of the material's."""
        attributes = getattr(mesh, "color_attributes", [])
        shader = self.shader(material)
        linked = shader.inputs["Base Color"].links[0].from_node if shader and shader.inputs["Base Color"].links else None
        wanted = linked and {"VERTEX_COLOR": "layer_name", "ATTRIBUTE": "attribute_name"}.get(linked.type)
        if wanted and len(attributes):
            return attributes.get(getattr(linked, wanted)) or attributes.active_color
        if len(attributes):
            self.lose("colours of points that no material shows", one.name)
        return None

    # ---- materials
    @staticmethod
    def shader(material):
        if material is None or not material.use_nodes or not material.node_tree:
            return None
        return next((n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED"), None)

    def material(self, material, depth):
        if material is None:
            return self.say(depth, "<Appearance><Material/></Appearance>")
        name = self.name("look", f"{material.name}_look")
        if ("look", material.name) in self.shared:
            return self.say(depth, f"<Appearance USE={_quoted(name)}/>")
        self.shared.add(("look", material.name))
        shader = self.shader(material)
        rgb, metallic, roughness, alpha = material.diffuse_color[:3], material.metallic, material.roughness, material.diffuse_color[3]
        glow, pictures = [0, 0, 0], ""
        if shader:
            value = {socket.name: socket.default_value for socket in shader.inputs if hasattr(socket, "default_value")}
            rgb, metallic, roughness, alpha = value["Base Color"][:3], value["Metallic"], value["Roughness"], value["Alpha"]
            strength = value.get("Emission Strength", 0)
            glow = [v * strength for v in (value.get("Emission Color") or value.get("Emission") or (0, 0, 0))[:3]]
            pictures, known = self.pictures(shader, material)
            rgb = (1, 1, 1) if "Base Color" in known else rgb
            if value.get("Transmission", value.get("Transmission Weight", 0)) > 0:
                self.lose("glass: it is as opaque as its alpha", material.name)
        elif material.use_nodes:
            self.lose("shaders other than the Principled one: they have the colour of the viewport", material.name)
        if max(glow) > 1:
            self.lose("emission beyond 1", material.name)
            glow = [v / max(glow) for v in glow]
        fields = f"baseColor='{_numbers(rgb)}' metallic='{metallic:g}' roughness='{roughness:g}' transparency='{1 - alpha:g}'"
        fields += f" emissiveColor='{_numbers(glow)}'" if any(glow) else ""
        self.say(depth, f"<Appearance DEF={_quoted(name)}><PhysicalMaterial {fields}>{pictures}</PhysicalMaterial></Appearance>")

    def pictures(self, shader, material):
        """(the nodes of textures, the inputs that they stand for); what else is linked is named."""
        text, known = "", set()
        fields = {"Base Color": "baseTexture", "Normal": "normalTexture", "Emission": "emissiveTexture", "Emission Color": "emissiveTexture"}
        for socket in shader.inputs:
            if not socket.links:
                continue
            linked = socket.links[0].from_node
            if socket.name == "Normal" and linked.type == "NORMAL_MAP" and linked.inputs["Color"].links:
                linked = linked.inputs["Color"].links[0].from_node
            if linked.type in ("VERTEX_COLOR", "ATTRIBUTE") and socket.name == "Base Color":
                continue
            if linked.type == "TEX_IMAGE" and linked.image and socket.name in fields:
                text += f"<ImageTexture containerField='{fields[socket.name]}' url={_quoted(chr(34) + self.url(linked.image) + chr(34))}/>"
                known.add(socket.name)
            elif not (linked.type == "TEX_IMAGE" and socket.name == "Alpha" and "Base Color" in known):  # the picture has its alpha
                self.lose(f"nodes that lead to {socket.name}", material.name)
        return text, known

    def url(self, image):
        if image.packed_file:
            kind = "jpeg" if image.packed_file.data[:2] == b"\xff\xd8" else "png"
            return f"data:image/{kind};base64,{base64.b64encode(image.packed_file.data).decode()}"
        file = bpy.path.abspath(image.filepath)
        try:
            file = os.path.relpath(file, self.folder)
        except ValueError:  # on another drive
            pass
        return urllib.parse.quote(file.replace(os.sep, "/"), safe="/:")

    # ---- what keyframes, constraints and drivers move
    def motions(self):
        movers = [o for o in self.objects if self.may_move(o)]
        start, end = self.scene.frame_start, self.scene.frame_end
        for one in self.objects:
            self.other_keyframes(one)
        if not movers or end <= start:
            return
        frames, poses, now = list(range(start, end + 1)), {one: [] for one in movers}, self.scene.frame_current
        for frame in frames:
            self.scene.frame_set(frame)
            for one in movers:
                poses[one].append(_placed(self.local(one)))
        self.scene.frame_set(now)
        rate = self.scene.render.fps / self.scene.render.fps_base
        moving = [one for one in sorted(movers, key=lambda o: o.name) if self.motion(one, frames, poses[one])]
        if not moving:
            return
        self.say(1, f"<TimeSensor DEF='BlenderClock' cycleInterval='{(end - start) / rate:g}' loop='true'/>")
        for line in self.routes:
            self.say(1, line)

    @staticmethod
    def may_move(one):
        while one is not None:
            animation = one.animation_data
            if (animation and (animation.action or animation.nla_tracks or animation.drivers)) or one.constraints or one.rigid_body:
                return True
            one = one.parent
        return False

    def motion(self, one, frames, poses):
        """Writes the interpolators of what changes; False: nothing does."""
        times = [(frame - frames[0]) / (frames[-1] - frames[0]) for frame in frames]
        if any(pose[3] != poses[0][3] for pose in poses):
            self.lose("shear that changes", one.name)
        moves = False
        for part, field, node in ((0, "translation", "PositionInterpolator"), (1, "rotation", "OrientationInterpolator"), (2, "scale", "PositionInterpolator")):
            values = [pose[part] for pose in poses]
            compared = [[*Quaternion(v[:3], v[3])] for v in values] if part == 1 else values
            for i in range(1, len(compared) if part == 1 else 0):  # q and -q are one rotation
                if sum(a * b for a, b in zip(compared[i - 1], compared[i])) < 0:
                    compared[i] = [-v for v in compared[i]]
            if np.abs(np.asarray(compared) - compared[0]).max() <= _STILL:
                continue
            moves, name, own = True, self.name("object", one.name), self.name(field, f"{one.name}_{field}")
            keys = _kept(times, compared)
            self.say(1, f"<{node} DEF={_quoted(own)} key='{_numbers(times[k] for k in keys)}' keyValue='{_numbers(v for k in keys for v in values[k])}'/>")
            self.routes += [f"<ROUTE fromNode='BlenderClock' fromField='fraction_changed' toNode={_quoted(own)} toField='set_fraction'/>",
                            f"<ROUTE fromNode={_quoted(own)} fromField='value_changed' toNode={_quoted(name)} toField='set_{field}'/>"]
        return moves

    def other_keyframes(self, one):
        def moves(owner):
            animation = getattr(owner, "animation_data", None)
            return animation and (animation.action or animation.nla_tracks or animation.drivers)

        if moves(one.data):
            self.lose("keyframes of cameras, lights and meshes", one.name)
        if moves(getattr(one.data, "shape_keys", None)):
            self.lose("keyframes of shape keys", one.name)
        if one.type in _MESHES and any(m.type not in ("ARMATURE", "COLLISION") and moves(one) for m in one.modifiers):
            self.lose("modifiers that change with time", one.name)
        if one.particle_systems if hasattr(one, "particle_systems") else False:
            self.lose("particles that move", one.name)
        for slot in one.material_slots:
            if slot.material and (moves(slot.material) or moves(slot.material.node_tree)):
                self.lose("keyframes of materials", slot.material.name)


def export_x3d(path, objects=None):
    """Writes objects, or all of the scene, as X3D. Returns a sentence for each kind of thing that is left out, and prints them."""
    writer = _X3dWriter(list(bpy.context.scene.objects if objects is None else objects), path)
    text = writer.text()
    with open(path + ".part", "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(path + ".part", path)  # whoever follows the file sees no half of it
    for line in writer.losses():
        print(f"{path}: {line}")
    return writer.losses()


# ---- what Blender shows ----------------------------------------------------------------------------------------------


class _Running:
    session = None


def _tick():
    session = _Running.session
    if session is None:
        return None
    try:
        session.step()
    except Exception as error:  # the timer would end in silence
        session.problem = str(error)
        _Running.session = None
        session.close()
        return None
    return 1 / 60


class RtsgPreferences(bpy.types.AddonPreferences):
    bl_idname = __name__
    package: StringProperty(name="Folder with the package rtsg", subtype="DIR_PATH", description="The folder python/ of RTSG, say")

    def draw(self, context):
        self.layout.prop(self, "package")


class RtsgFollow(bpy.types.Operator):
    """Follow a served session, and send to it what is moved here"""
    bl_idname, bl_label = "rtsg.follow", "Follow"
    endpoint: StringProperty(name="Endpoint", default="tcp://127.0.0.1:4711")

    def execute(self, context):
        preferences = context.preferences.addons.get(__name__)
        if preferences and preferences.preferences.package and preferences.preferences.package not in sys.path:
            sys.path.append(bpy.path.abspath(preferences.preferences.package))
        if _Running.session:
            bpy.ops.rtsg.leave()
        try:
            _Running.session = Session(self.endpoint)
        except Exception as error:
            self.report({"ERROR"}, f"{self.endpoint}: {error}")
            return {"CANCELLED"}
        bpy.app.timers.register(_tick)
        return {"FINISHED"}


class RtsgLeave(bpy.types.Operator):
    """Follow no longer; what is there stays"""
    bl_idname, bl_label = "rtsg.leave", "Leave"

    def execute(self, context):
        if _Running.session:
            _Running.session.close()
            _Running.session = None
        return {"FINISHED"}


class RtsgExport(bpy.types.Operator, ExportHelper):
    """Write X3D whose nodes have the names of their objects"""
    bl_idname, bl_label = "export_scene.rtsg_x3d", "X3D for RTSG"
    filename_ext = ".x3d"
    selected: BoolProperty(name="Selected objects alone", default=False)

    def execute(self, context):
        for line in export_x3d(self.filepath, context.selected_objects if self.selected else None):
            self.report({"WARNING"}, line)
        return {"FINISHED"}


class RtsgPanel(bpy.types.Panel):
    bl_idname, bl_label = "VIEW3D_PT_rtsg", "RTSG"
    bl_space_type, bl_region_type, bl_category = "VIEW_3D", "UI", "RTSG"

    def draw(self, context):
        session = _Running.session
        self.layout.prop(context.scene, "rtsg_endpoint", text="")
        if session is None:
            self.layout.operator("rtsg.follow").endpoint = context.scene.rtsg_endpoint
        else:
            self.layout.operator("rtsg.leave")
            self.layout.label(text=f"state {session.follower.scene.number}")
            if session.problem:
                self.layout.label(text=session.problem, icon="ERROR")


_CLASSES = (RtsgPreferences, RtsgFollow, RtsgLeave, RtsgExport, RtsgPanel)


def _menu(self, context):
    self.layout.operator(RtsgExport.bl_idname, text="X3D for RTSG (.x3d)")


def register():
    for one in _CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Scene.rtsg_endpoint = StringProperty(name="Endpoint", default="tcp://127.0.0.1:4711")
    bpy.types.TOPBAR_MT_file_export.append(_menu)


def unregister():
    bpy.types.TOPBAR_MT_file_export.remove(_menu)
    del bpy.types.Scene.rtsg_endpoint
    for one in reversed(_CLASSES):
        bpy.utils.unregister_class(one)
