"""What the tests of the Python package share: where scenes are, and small ones."""
import pathlib

import pytest

import rtsg

ROOT = pathlib.Path(__file__).parents[2]

MOVING = """#X3D V4.0 utf8
PROFILE Immersive
DEF CLOCK TimeSensor { cycleInterval 2 loop TRUE }
DEF WAY PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 4 0 0 ] }
DEF BOX Transform { children Shape { appearance Appearance { material DEF PAINT Material { diffuseColor 1 0 0 } } geometry Box { } } }
DEF VIEW Viewpoint { position 0 0 10 }
ROUTE CLOCK.fraction_changed TO WAY.set_fraction
ROUTE WAY.value_changed TO BOX.translation
"""

SCRIPTED = """#X3D V4.0 utf8
PROFILE Full
DEF CLOCK TimeSensor { loop TRUE }
DEF S Script { inputOnly SFFloat tick outputOnly SFInt32 count
  url "ecmascript: var n = 0; function tick(v) { count = ++n; } function shutdown() { print('shut down'); }" }
ROUTE CLOCK.fraction_changed TO S.tick
"""


@pytest.fixture
def moving():
    """A box that goes to and fro, in front of a viewpoint."""
    return rtsg.loads(MOVING)


@pytest.fixture
def hall():
    return rtsg.load(ROOT / "examples/demo/hall.x3dv")


@pytest.fixture
def door():
    return ROOT / "examples/door.x3dv"
