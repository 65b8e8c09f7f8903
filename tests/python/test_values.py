"""Fields of every type as Python has them: without copies, read-only, from anything that is like an array."""
import gc
import math

import numpy as np
import pytest

import rtsg


@pytest.fixture
def points():
    scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Immersive\nDEF P Coordinate { point [ 0 1 2, 3 4 5 ] }")
    return scene["P"]


def test_an_array_is_a_view_of_the_scenes_own_memory(points):
    a, b = points.point, points.point
    assert a.dtype == np.float32 and a.shape == (2, 3) and a.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert a.__array_interface__["data"][0] == b.__array_interface__["data"][0]
    assert not a.flags.writeable
    with pytest.raises(ValueError):
        a[0, 0] = 7


def test_it_stays_as_it_was_after_edits_and_after_the_scene(points):
    before = points.point
    points.point = [[9, 9, 9]]
    assert before.tolist() == [[0, 1, 2], [3, 4, 5]] and points.point.tolist() == [[9, 9, 9]]
    after = points.point
    points = None
    gc.collect()
    assert before.sum() == 15 and after.sum() == 27


@pytest.mark.parametrize("given", [
    [[1, 2, 3], [4, 5, 6]],
    ((1., 2., 3.), (4., 5., 6.)),
    np.array([[1, 2, 3], [4, 5, 6]], dtype=np.float64),
    np.array([[1, 2, 3], [4, 5, 6]], dtype=np.int16),
    np.array([[1, 4], [2, 5], [3, 6]], dtype=np.float32).T,
    np.array([[0, 1, 0, 2, 0, 3], [0, 4, 0, 5, 0, 6]], dtype=np.float32)[:, 1::2],
    memoryview(np.array([[1, 2, 3], [4, 5, 6]], dtype=np.float32)),
])
def test_anything_like_an_array_is_taken(points, given):
    points.point = given
    assert points.point.tolist() == [[1, 2, 3], [4, 5, 6]]


def test_an_array_that_was_given_is_copied(points):
    given = np.ones((4, 3), dtype=np.float32)
    points.point = given
    given[:] = 5
    assert points.point.max() == 1


def test_empty_arrays(points):
    points.point = []
    assert points.point.shape == (0, 3)
    points.point = np.empty((0, 3))
    assert len(points.point) == 0


@pytest.mark.parametrize("given, error", [
    ([1, 2, 3], ValueError), ([[1, 2]], ValueError), ([[1, 2, 3], [4, 5]], TypeError), ("1 2 3", TypeError),
    ([[1j, 2, 3]], TypeError), (None, TypeError), ([["a", "b", "c"]], TypeError), (7, ValueError),
])
def test_what_is_no_value_is_refused_and_named(points, given, error):
    with pytest.raises(error, match="P.point"), np.errstate(all="ignore"):
        import warnings
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # NumPy's own, of ragged lists
            points.point = given
    assert points.point.tolist() == [[0, 1, 2], [3, 4, 5]]


EVERY_TYPE = {
    "SFBool": True, "SFInt32": -7, "SFFloat": .5, "SFDouble": .1, "SFTime": 1e9 + .25, "SFString": "h\u00e4\nllo",
    "SFColor": [.25, .5, 1], "SFColorRGBA": [.25, .5, 1, 0], "SFVec2f": [1, 2], "SFVec2d": [.1, .2], "SFVec3f": [1, 2, 3],
    "SFVec3d": [.1, .2, .3], "SFVec4f": [1, 2, 3, 4], "SFVec4d": [.1, .2, .3, .4], "SFRotation": [0, 1, 0, .5],
    "SFMatrix3f": np.arange(9.).reshape(3, 3), "SFMatrix3d": np.arange(9.).reshape(3, 3) / 10,
    "SFMatrix4f": np.arange(16.).reshape(4, 4), "SFMatrix4d": np.arange(16.).reshape(4, 4) / 10,
}


@pytest.mark.parametrize("kind", EVERY_TYPE)
def test_every_type_comes_back_as_it_was_set(kind):
    zero = {"SFString": '""', "SFBool": "FALSE"}.get(kind, " ".join("0" * np.size(EVERY_TYPE[kind])))
    fields = f"inputOutput {kind} one {zero}"
    scene = rtsg.loads(f"#X3D V4.0 utf8\nPROFILE Full\nDEF S Script {{ {fields} inputOutput MF{kind[2:]} many [ ] }}", scripts=False)
    node, value = scene["S"], EVERY_TYPE[kind]
    node.one = value
    node.many = [value, value, value]
    assert node.field_types["one"] == kind
    if kind == "SFString":
        assert node.one == value and node.many == (value,) * 3
        return
    assert np.array_equal(node.one, value)
    assert np.array_equal(node.many, [value] * 3) and node.many.shape == (3,) + np.shape(value)


def test_field_types_from_outside():
    for kind, name, count in (("float64", "SFPyPair", 2), ("float32", "SFPyMass", 1), ("int32", "SFPyCount", 1), ("bytes", "SFPyTag", 0)):
        rtsg.register_field_type(name, kind, count)
    with pytest.raises(ValueError, match="another layout"):
        rtsg.register_field_type("SFPyPair", "float64", 3)
    for name, kind in (("SFVec3f", "float32"), ("Pair", "int32"), ("SFPyOther", "double")):
        with pytest.raises(ValueError):
            rtsg.register_field_type(name, kind)
    scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Full\nDEF S Script { inputOutput SFPyPair pair 1 2 inputOutput MFPyPair pairs [ ] "
                       "inputOutput SFPyMass mass 1.5 inputOutput SFPyCount count 3 inputOutput SFPyTag tag 0x01 }", scripts=False)
    node = scene["S"]
    assert node.field_types["pair"] == "SFPyPair" and node.field_types["pairs"] == "MFPyPair"
    assert node.pair.tolist() == [1, 2] and node.mass == 1.5 and node.count == 3 and node.tag == b"\x01" and node.pairs == ()
    node.pair, node.pairs = [3, 4.5], [[1, 2], "3 4"]
    node.mass, node.count, node.tag = 2, 7, b"\x00\xff"
    assert node.pair.tolist() == [3, 4.5] and [one.tolist() for one in node.pairs] == [[1, 2], [3, 4]]
    assert node.mass == 2 and node.count == 7 and node.tag == b"\x00\xff"
    for given in ([1], [1, 2, 3], "1", "x", None, b"12", {}):
        with pytest.raises((ValueError, TypeError), match="SFPyPair|S.pair"):
            node.pair = given
    with pytest.raises(ValueError):
        node.count = 1.5
    scene.define("Weighed", {"load": ("SFPyPair", "inputOutput", [5, 6])})
    assert scene.create("Weighed").load.tolist() == [5, 6]


def test_numbers_that_do_not_fit():
    scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Immersive\nDEF S Switch { } DEF I IndexedFaceSet { }")
    for node, name, good in ((scene["S"], "whichChoice", 2), (scene["I"], "coordIndex", [0, 1, -1])):
        setattr(node, name, good)
        wrong = 2**31 if isinstance(good, int) else [2**31]
        with pytest.raises(ValueError, match="32 bits"):
            setattr(node, name, wrong)
        with pytest.raises(TypeError):
            setattr(node, name, 1.5 if isinstance(good, int) else [1.5])
        assert np.array_equal(getattr(node, name), good)


def test_bools_are_also_one_and_zero():
    scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Full\nDEF L PointLight { } DEF T BooleanSequencer { }")
    for given, value in ((0, False), (1, True), (np.int64(0), False), (np.True_, True)):
        scene["L"].on = given
        assert scene["L"].on is value
    scene["T"].keyValue = [1, 0, 1]
    assert scene["T"].keyValue.tolist() == [True, False, True]
    for wrong, error in ((2, ValueError), (-1, ValueError), (1.0, TypeError), ("TRUE", TypeError)):
        with pytest.raises(error, match="SFBool"):
            scene["L"].on = wrong
    with pytest.raises(ValueError, match="MFBool"):
        scene["T"].keyValue = [0, 2]


def test_numbers_that_are_none_are_kept_as_they_are():
    """What a sensor gives may be no number: it is a value like any other, and the hash counts its bits."""
    hashes = []
    for _ in range(2):
        scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Immersive\nDEF P Coordinate { }")
        scene["P"].point = [[math.nan, math.inf, -math.inf]]
        assert math.isnan(scene["P"].point[0, 0]) and scene["P"].point[0, 1:].tolist() == [math.inf, -math.inf]
        scene.frame(0)
        hashes.append(scene.hash)
    assert hashes[0] == hashes[1]


def test_texts_and_nodes():
    scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Immersive\nDEF T Text { } DEF A Shape { } DEF B Appearance { } DEF G Group { }")
    scene["T"].string = ["one", "two"]
    assert scene["T"].string == ("one", "two")
    with pytest.raises(TypeError, match="sequence"):
        scene["T"].string = "one"
    scene["A"].appearance = scene["B"]
    assert scene["A"].appearance == scene["B"] and scene["A"].geometry is None
    scene["A"].appearance = None
    scene["G"].children = [scene["A"]]
    assert scene["G"].children == (scene["A"],)
    other = rtsg.Scene()
    with pytest.raises(ValueError, match="another scene"):
        scene["A"].appearance = other.create("Appearance")
    with pytest.raises(rtsg.Error, match="cycle"):
        scene["G"].children = [scene["G"]]


def test_pictures_in_fields_have_the_top_row_first():
    scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Immersive\nDEF T PixelTexture { image 2 2 3 0x010203 0x040506 0x070809 0x0A0B0C }")
    image = scene["T"].image
    assert image.shape == (2, 2, 3) and image[1, 0].tolist() == [1, 2, 3] and image[0, 1].tolist() == [10, 11, 12]
    scene["T"].image = image[:, :, :1]
    assert scene["T"].text_of("image").split()[:4] == ["2", "2", "1", "0x1"] or scene["T"].image.shape == (2, 2, 1)
    scene["T"].image = image
    assert np.array_equal(scene["T"].image, image)
    with pytest.raises(TypeError, match="uint8"):
        scene["T"].image = image.astype(float)
