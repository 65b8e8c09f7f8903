"""Blender add-on: follows an RTSG session, sends edits to it, and exports X3D.

Install this file under Edit > Preferences > Add-ons. The panel is in the sidebar of the 3D view, under RTSG. To follow, it needs the
Python package rtsg (one folder, no compiled part of it) and pyzmq: the preferences name the folder that has it.

What is followed: Transforms and groups are empties, shapes are meshes with materials, viewpoints are cameras, and lights are lights; each
has the name of its node. Whoever moves such an object, or changes the property of a joint, asks the origin for it. X3D's y axis points up and
Blender's z axis does: an empty at the top turns one to the other.
"""
import math
import os
import sys
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
        camera.sensor_fit = "AUTO"
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


def _numbers(values):
    return " ".join(f"{round(float(v), 6) + 0:g}" for v in values)


def _quoted(text):
    return xml.sax.saxutils.quoteattr(str(text))


class _X3dWriter:
    """Objects as Transforms of their names, so that `rtsg serve --reload` finds them again after an edit."""

    def __init__(self, objects):
        self.objects, self.lines, self.given = set(objects), [], set()

    def text(self):
        self.say(0, "<X3D profile='Full' version='4.0'><Scene>")
        self.say(1, "<Transform DEF='BlenderAxes' rotation='1 0 0 -1.5707963'>")
        for one in sorted(self.objects, key=lambda o: o.name):
            if one.parent not in self.objects:
                self.object(one, 2)
        self.say(1, "</Transform>")
        self.say(0, "</Scene></X3D>")
        return "\n".join(["<?xml version='1.0' encoding='UTF-8'?>", *self.lines, ""])

    def say(self, depth, line):
        self.lines.append("  " * depth + line)

    def object(self, one, depth):
        matrix = one.matrix_parent_inverse @ one.matrix_basis if one.parent in self.objects else one.matrix_world
        place, turn, scale = matrix.decompose()
        self.say(depth, f"<Transform DEF={_quoted(one.name)} translation='{_numbers(place)}' rotation='{_numbers(_axis_angle(turn))}' scale='{_numbers(scale)}'>")
        if one.type == "MESH":
            self.mesh(one, depth + 1)
        elif one.type == "CAMERA":
            self.say(depth + 1, f"<Viewpoint description={_quoted(one.name)} position='0 0 0' fieldOfView='{min(one.data.angle, 3):g}'/>")
        elif one.type == "LIGHT":
            self.light(one.data, depth + 1)
        for child in sorted(one.children, key=lambda o: o.name):
            if child in self.objects:
                self.object(child, depth + 1)
        self.say(depth, "</Transform>")

    def light(self, light, depth):
        color = f"color='{_numbers(light.color)}' global='true'"
        if light.type == "SUN":
            self.say(depth, f"<DirectionalLight direction='0 0 -1' intensity='{light.energy:g}' {color}/>")
        else:
            self.say(depth, f"<PointLight location='0 0 0' attenuation='0 0 1' radius='1000000' intensity='{light.energy / (4 * math.pi):g}' {color}/>")

    def mesh(self, one, depth):
        evaluated = one.evaluated_get(bpy.context.evaluated_depsgraph_get())
        mesh = evaluated.to_mesh()
        uv = mesh.uv_layers.active
        points = _numbers(v for vertex in mesh.vertices for v in vertex.co)
        for slot in range(max(1, len(mesh.materials))):
            faces = [p for p in mesh.polygons if min(p.material_index, max(0, len(mesh.materials) - 1)) == slot]
            if not faces:
                continue
            index = " ".join(f"{' '.join(map(str, p.vertices))} -1" for p in faces)
            crease = "3.1416" if any(p.use_smooth for p in faces) else "0"
            corners, texture = [], ""
            if uv:  # a corner of each polygon has a place of its own in the picture
                counts = iter(range(sum(len(p.vertices) for p in faces)))
                texture = " texCoordIndex='" + " ".join(" ".join(str(next(counts)) for _ in p.vertices) + " -1" for p in faces) + "'"
                corners = [v for p in faces for i in p.loop_indices for v in uv.data[i].uv]
            self.say(depth, "<Shape>")
            self.material(mesh.materials[slot] if slot < len(mesh.materials) else None, depth + 1)
            self.say(depth + 1, f"<IndexedFaceSet solid='false' creaseAngle='{crease}' coordIndex='{index}'{texture}>")
            self.say(depth + 2, f"<Coordinate point='{points}'/>")
            if uv:
                self.say(depth + 2, f"<TextureCoordinate point='{_numbers(corners)}'/>")
            self.say(depth + 1, "</IndexedFaceSet>")
            self.say(depth, "</Shape>")
        evaluated.to_mesh_clear()

    def material(self, material, depth):
        if material is None:
            return self.say(depth, "<Appearance><Material/></Appearance>")
        name = f"{material.name}_look"
        if name in self.given:
            return self.say(depth, f"<Appearance USE={_quoted(name)}/>")
        self.given.add(name)
        shader = material.node_tree.nodes.get("Principled BSDF") if material.use_nodes and material.node_tree else None
        rgb, metallic, roughness, alpha = material.diffuse_color[:3], material.metallic, material.roughness, material.diffuse_color[3]
        picture = ""
        if shader:
            base = shader.inputs["Base Color"]
            rgb, metallic, roughness = base.default_value[:3], shader.inputs["Metallic"].default_value, shader.inputs["Roughness"].default_value
            alpha = shader.inputs["Alpha"].default_value
            linked = base.links[0].from_node if base.links else None
            if linked and linked.type == "TEX_IMAGE" and linked.image:
                picture = f"<ImageTexture containerField='baseTexture' url='\"{bpy.path.abspath(linked.image.filepath)}\"'/>"
                rgb = (1, 1, 1)
        fields = f"baseColor='{_numbers(rgb)}' metallic='{metallic:g}' roughness='{roughness:g}' transparency='{1 - alpha:g}'"
        self.say(depth, f"<Appearance DEF={_quoted(name)}><PhysicalMaterial {fields}>{picture}</PhysicalMaterial></Appearance>")


def export_x3d(path, objects=None):
    """Writes objects, or all of the scene, as X3D."""
    chosen = bpy.context.scene.objects if objects is None else objects
    text = _X3dWriter([o for o in chosen if o.type in ("MESH", "EMPTY", "CAMERA", "LIGHT")]).text()
    with open(path + ".part", "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(path + ".part", path)  # whoever follows the file sees no half of it


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
        export_x3d(self.filepath, context.selected_objects if self.selected else None)
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
