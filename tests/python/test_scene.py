"""Scenes: reading, nodes and fields by their names, edits, frames, and what goes wrong."""
import math

import numpy as np
import pytest

import rtsg
from conftest import MOVING, ROOT


def test_a_file_is_read_and_run(hall):
    assert len(hall) > 200 and hall.now == 0
    changes = hall.frame(0.5)
    assert changes.time == hall.now == 0.5 and len(changes) > 0
    again = rtsg.load(ROOT / "examples/demo/hall.x3dv")
    again.frame(0.5)
    assert hall.hash == again.hash and len(hall.hash) == 32


def test_an_error_has_file_line_and_code(tmp_path):
    file = tmp_path / "wrong.x3dv"
    file.write_text("#X3D V4.0 utf8\nPROFILE Immersive\nShape { appearence NULL }\n")
    with pytest.raises(rtsg.Error) as raised:
        rtsg.load(file)
    error = raised.value
    assert (error.file, error.line, error.column, error.code) == (str(file), 3, 9, "parse")
    assert "appearence" in error.text and str(error).startswith(f"{file}:3:9: ")
    with pytest.raises(rtsg.Error, match=r"\[file\]"):
        rtsg.load(tmp_path / "missing.x3d")


def test_what_is_usable_of_a_faulty_file_is_there_when_asked_for():
    with pytest.warns(rtsg.DiagnosticWarning, match="appearence"):
        scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Immersive\nShape { appearence NULL }\nDEF A Group { }", partial=True)
    assert scene["A"].type_name == "Group"
    assert [d.severity for d in scene.diagnostics] == ["error"]


def test_nothing_usable_is_an_error():
    for text in ("", "\n", "no scene at all {"):
        with pytest.raises(rtsg.Error) as raised:
            rtsg.loads(text)
        assert raised.value.file == "text"
    with pytest.raises(rtsg.Error):
        rtsg.loads("", partial=True)


def test_names_that_are_not_there(moving):
    with pytest.raises(KeyError):
        moving["NOBODY"]
    with pytest.raises(AttributeError, match="did you mean translation"):
        moving["BOX"].transaltion
    with pytest.raises(rtsg.NoSuchField):
        moving["BOX"].transaltion = 0, 0, 0
    assert "BOX" in moving and "NOBODY" not in moving
    assert not hasattr(moving["BOX"], "rotated")


def test_fields_that_are_words_of_python_are_items():
    scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Immersive\nDEF L PointLight { global FALSE }")
    assert scene["L"]["global"] is False
    scene["L"]["global"] = True
    assert scene["L"]["global"] is True


def test_nodes_are_made_found_and_removed():
    scene = rtsg.Scene()
    box = scene.create("Transform", def_name="BOX", translation=(0, 1, 0))
    scene.root.add_child(box)
    shape = scene.create("Shape", geometry=scene.create("Box", size=(1, 2, 3)))
    box.add_child(shape)
    scene.frame(0)
    assert scene["BOX"] == box and hash(scene["BOX"]) == hash(box)
    assert box.children == (shape,) and shape.geometry.size.tolist() == [1, 2, 3]
    assert box.parent_nodes == [(scene.root, "children")]
    assert scene.nodes("X3DGeometryNode") == [shape.geometry]
    assert scene[f"#{shape.node_id}"] == shape == scene.node(shape.node_id)
    assert list(scene) == scene.nodes() and len(list(scene)) == len(scene) - 1 == 3  # without the root
    assert scene.remove(box) == 3
    assert not shape.is_alive and len(scene) == 1
    with pytest.raises(rtsg.NoSuchName, match="gone"):
        shape.geometry


def test_what_hangs_elsewhere_too_stays():
    scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Immersive\nDEF A Group { children DEF C Group { } }\nDEF B Group { children USE C }")
    assert scene.remove(scene["A"]) == 1
    assert scene["B"].children == (scene["C"],)


def test_a_piece_of_text_is_added(moving):
    added = moving.add("DEF LAMP PointLight { intensity .5 } WorldInfo { title \"one\" }")
    assert [node.type_name for node in added] == ["PointLight", "WorldInfo"]
    assert moving["LAMP"] in moving.root.children
    count = len(moving)
    with pytest.raises(rtsg.Error, match="parse"):
        moving.add("PointLight { intensty 1 }")
    assert len(moving) == count


def test_a_create_that_fails_leaves_nothing():
    scene = rtsg.Scene()
    count = len(scene)
    with pytest.raises(ValueError):
        scene.create("Transform", translation=(1, 2))
    with pytest.raises(rtsg.Error):
        scene.create("Trasnform")
    assert len(scene) == count


def test_routes(moving):
    assert ("CLOCK.fraction_changed", "WAY.set_fraction") in moving.routes
    moving.remove_route("WAY.value_changed", "BOX.translation")
    moving.frame(0)
    moving.frame(1)
    assert moving["BOX"].translation.tolist() == [0, 0, 0]
    with pytest.raises(rtsg.Error):
        moving.add_route("CLOCK.fraction_changed", "BOX.translation")


def test_events_arrive_in_the_next_frame(moving):
    moving.send("CLOCK.enabled", False)
    assert moving["CLOCK"].enabled is True
    moving.frame(0)
    assert moving["CLOCK"].enabled is False
    moving["WAY"].send_event("set_fraction", .5)
    moving.frame(1)
    assert moving.value("BOX.translation").tolist() == [2, 0, 0]
    with pytest.raises(rtsg.Error, match="input"):
        moving["WAY"].set_fraction = .5
    with pytest.raises(rtsg.Error, match="input"):
        moving["WAY"].set_fraction


@pytest.mark.parametrize("time", [0.5, math.nan, math.inf])
def test_a_frame_that_cannot_be_raises_and_changes_nothing(moving, time):
    moving.frame(1.0)
    before = moving.hash
    with pytest.raises(rtsg.Error) as raised:
        moving.frame(time)
    assert raised.value.code == "cascade" and moving.now == 1.0 and moving.hash == before
    moving.frame(1.5)


def test_many_nodes_are_set_at_once():
    scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Immersive\n" + "Transform { }\n" * 100)
    nodes = scene.nodes("Transform")
    places = np.arange(300, dtype=float).reshape(100, 3)
    scene.set_each(nodes, "translation", places)
    assert np.array_equal([node.translation for node in nodes], places)
    with pytest.raises(ValueError, match="99 values for 100 nodes"):
        scene.set_each(nodes, "translation", places[1:])
    with pytest.raises(ValueError, match="one type"):
        scene.set_each([scene.root, nodes[0]], "translation", places[:2])
    with pytest.raises(TypeError, match="takes nodes"):
        scene.set_each(["T"], "translation", places[:1])


def test_nodes_have_names_and_no_numbers(moving):
    with pytest.raises(TypeError, match="not iterable"):
        list(moving.root)
    with pytest.raises(TypeError, match="def_name: expected str"):
        moving["BOX"].def_name = 7


def test_a_scene_is_written_and_read_again(moving, tmp_path):
    moving.frame(0.5)
    for name in ("a.x3d", "a.x3dv.gz", "a.rtsgb"):
        moving.save(tmp_path / name)
        again = rtsg.load(tmp_path / name)
        assert again["BOX"].translation.tolist() == moving["BOX"].translation.tolist()
    assert again.hash == moving.hash  # of the state, which .rtsgb holds
    with pytest.raises(rtsg.Error, match="already"):
        moving.save(tmp_path / "a.x3d", replace=False)


def test_urls_open_what_is_allowed(tmp_path):
    (tmp_path / "inside").mkdir()
    (tmp_path / "part.x3dv").write_text("#X3D V4.0 utf8\nPROFILE Immersive\nGroup { }")
    main = tmp_path / "inside" / "main.x3dv"
    main.write_text("#X3D V4.0 utf8\nPROFILE Immersive\nDEF I Inline { url \"../part.x3dv\" }")
    with pytest.raises(rtsg.Error, match="allow"):
        rtsg.load(main)
    assert len(rtsg.load(main, allow=[tmp_path])) == 3


def test_a_closed_scene_says_so(moving):
    box = moving["BOX"]
    with moving:
        pass
    assert moving.closed and "closed" in repr(moving) and "closed" in repr(box)
    for use in (lambda: box.translation, lambda: moving.frame(0), lambda: moving["BOX"], lambda: moving.render()):
        with pytest.raises(rtsg.Closed):
            use()
    moving.close()


def test_a_script_that_fails_is_a_warning():
    scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Full\nDEF S Script { inputOnly SFBool go url \"ecmascript: function go() { nobody(); }\" }")
    scene.send("S.go", True)
    with pytest.warns(rtsg.DiagnosticWarning, match="nobody"):
        scene.frame(0)
    assert any("nobody" in d.text and d.severity == "warning" for d in scene.diagnostics), scene.diagnostics


def test_texts_are_measured_where_somebody_hears_of_it():
    scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Full\nDEF T Text { string \"words\" } DEF S TextureTransform { }\n"
                       "ROUTE T.textBounds TO S.scale")
    scene.frame(0)
    scene.frame(1)
    assert scene["S"].scale[0] > 1 and scene["S"].scale[0] != scene["S"].scale[1]


def test_what_is_said_of_a_scene_once_is_said_once(moving, recwarn):
    for k in range(10):
        moving.frame(k)
    assert not recwarn.list
    assert MOVING  # the scene has nothing to complain of


@pytest.mark.parametrize("name", ["tone.mka", "tone.webm", "tone.aac"])
def test_packed_sounds_without_pictures_have_a_length(name):
    scene = rtsg.loads(f'#X3D V4.0 utf8\nPROFILE Immersive\nSound {{ source DEF CLIP AudioClip {{ url "{name}" }} }}', base=ROOT / "tests/audio/scene/data")
    for k in range(3):
        scene.frame(k / 10)
    if any("module" in one.code for one in scene.diagnostics):
        pytest.skip("films are not read here")
    assert scene["CLIP"].duration_changed > 0
