"""Random programs over the package beside the same in C++ (program.cpp): equal hashes, frame by frame."""
import os
import random
import subprocess

import numpy as np
import pytest

import rtsg

TYPES = ("Transform Group Switch TimeSensor PositionInterpolator OrientationInterpolator ColorInterpolator Shape Appearance Material "
         "PixelTexture Coordinate Normal TextureCoordinate IndexedFaceSet Box Sphere Text FontStyle WorldInfo PointLight DirectionalLight "
         "Viewpoint BooleanToggle BooleanTrigger IntegerSequencer CoordinateInterpolator NurbsCurve Background GeoCoordinate "
         "FloatVertexAttribute Matrix4VertexAttribute MetadataDouble ProximitySensor Fog Collision LOD").split()
LONG = os.environ.get("RTSG_LONG", "0") not in ("", "0")


def text_of(number, kind):
    if isinstance(number, (bool, np.bool_)):
        return "TRUE" if number else "FALSE"
    if isinstance(number, str):
        return '"' + number.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return str(np.float32(number)) if kind[-1] == "f" or kind in ("Float", "Color", "ColorRGBA", "Rotation") else repr(number)


SIZES = {"Color": 3, "ColorRGBA": 4, "Vec2f": 2, "Vec2d": 2, "Vec3f": 3, "Vec3d": 3, "Vec4f": 4, "Vec4d": 4, "Rotation": 4,
         "Matrix3f": 9, "Matrix3d": 9, "Matrix4f": 16, "Matrix4d": 16}


def one(kind, dice):
    """A value for Python and the same as text."""
    if kind == "Bool":
        value = dice.random() < .5
    elif kind == "Int32":
        value = dice.randint(-3, 9)
    elif kind == "String":
        value = dice.choice(["", "a", 'say "so"', "b\u00e4r", "back\\slash"])
    elif kind in SIZES:
        # Colours and the like only take part of the numbers; any number is a value.
        flat = [float(np.float32(dice.uniform(-2, 2))) for _ in range(SIZES[kind])]
        side = int(SIZES[kind] ** .5)
        return (np.reshape(flat, (side, side)) if kind.startswith("Matrix") else flat), " ".join(text_of(n, kind) for n in flat)
    else:
        value = float(np.float32(dice.uniform(0, 5)))
    return value, text_of(value, kind)


def any_value(kind, dice):
    if kind.startswith("SF"):
        return one(kind[2:], dice)
    values = [one(kind[2:], dice) for _ in range(dice.randint(0, 4))]
    return [value for value, _ in values], "[ " + ", ".join(text for _, text in values) + " ]"


class Program:
    """Does to a scene what it notes as lines for program.cpp."""

    def __init__(self, seed):
        self.dice, self.scene, self.lines, self.hashes = random.Random(seed), rtsg.Scene(), [], []
        self.nodes, self.refused, self.time = [], 0, 0.0

    def attempt(self, line, call):
        self.lines.append(line)
        try:
            return call()
        except (rtsg.Error, ValueError) as error:
            assert not isinstance(error, (rtsg.Closed, rtsg.WrongThread))
            self.refused += 1
            return None

    def field(self, node, node_list=False):
        names = [name for name, kind in node.field_types.items()
                 if (kind == "MFNode" if node_list else kind[2:] not in ("Node", "Image"))]
        return self.dice.choice(names) if names else None

    def step(self):
        dice = self.dice
        what = dice.choices(["create", "set", "send", "child", "route", "unroute", "name", "destroy", "frame"],
                            [6, 20, 4, 8, 4, 1, 2, 1, 6])[0]
        if what == "create" or len(self.nodes) < 3:
            kind = dice.choice(TYPES)
            node = self.attempt(f"create {kind}", lambda: self.scene.create(kind))
            self.nodes += [node] if node is not None else []
            return
        node, other = dice.choice(self.nodes), dice.choice(self.nodes)
        name, other_name = self.field(node, what == "child"), self.field(other)
        if what in ("set", "send") and name:
            value, text = any_value(node.field_types[name], dice)
            if what == "set":
                self.attempt(f"set {node.node_id} {name} {text}", lambda: setattr(node, name, value))
            else:
                self.attempt(f"send {node.node_id} {name} {text}", lambda: node.send_event(name, value))
        elif what == "child" and name:
            parent = self.scene.root if dice.random() < .3 else node
            name = "children" if parent != node else name
            self.attempt(f"child {parent.node_id} {name} {other.node_id}", lambda: parent.add_child(other, name))
        elif what in ("route", "unroute") and name and other_name:
            call = self.scene.add_route if what == "route" else self.scene.remove_route
            self.attempt(f"{what} {node.node_id} {name} {other.node_id} {other_name}",
                         lambda: call(f"#{node.node_id}.{name}", f"#{other.node_id}.{other_name}"))
        elif what == "name":
            name = f"N{dice.randint(0, 20)}"
            self.attempt(f"name {node.node_id} {name}", lambda: setattr(node, "def_name", name))
        elif what == "destroy":
            alone = not any(kind[2:] == "Node" and node[n] for n, kind in node.field_types.items() if self.has_value(node, n))
            if alone:
                self.nodes.remove(node)
                self.attempt(f"destroy {node.node_id}", lambda: self.scene.remove(node))
        elif what == "frame":
            self.time += dice.choice([0, 1 / 60, .5])
            self.scene.frame(self.time)
            self.lines.append(f"frame {self.time!r}")
            self.hashes.append(f"{self.scene.hash} {self.refused}")

    @staticmethod
    def has_value(node, name):
        try:
            node[name]
            return True
        except rtsg.Error:
            return False


@pytest.mark.filterwarnings("ignore::rtsg.DiagnosticWarning")
@pytest.mark.parametrize("seed", range(200 if LONG else 12))
def test_the_same_program_in_cpp_has_the_same_hashes(seed):
    program = Program(seed)
    while len(program.hashes) < 40:
        program.step()
    run = subprocess.run([os.environ["RTSG_PYTHON_PROGRAM"]], input="\n".join(program.lines) + "\n", capture_output=True,
                         text=True, timeout=120, check=True)
    assert run.stdout.splitlines() == program.hashes, f"seed {seed}"
    assert program.refused < len(program.lines) / 2
