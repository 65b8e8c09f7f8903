"""Pictures, picking and measured light against what the program makes, and against closed forms."""
import math
import os
import subprocess

import numpy as np
import pytest

import rtsg
from conftest import ROOT

LAMP = """#X3D V4.0 utf8
PROFILE Interchange
DEF FLOOR Shape { appearance Appearance { material DEF PAINT Material { diffuseColor 0 0 0 emissiveColor 1 0 0 } } geometry Box { size 4 1 4 } }
DEF VIEW Viewpoint { position 0 0 10 }
"""


def test_a_picture_is_what_the_program_draws(hall, tmp_path):
    size = {"width": 64, "height": 36, "samples": 1}
    file = tmp_path / "a.png"
    subprocess.run([os.environ["RTSG_PROGRAM"], "render", ROOT / "examples/demo/hall.x3dv", "-o", file, "--size", "64x36", "--spp", "1"],
                   check=True, capture_output=True)
    matplotlib = pytest.importorskip("matplotlib.image")
    expected = (matplotlib.imread(file)[:, :, :3] * 255).round().astype(np.uint8)
    hall.frame(0)
    assert np.array_equal(hall.render(**size), expected)
    assert np.array_equal(hall.render(**size, format="rgba")[:, :, :3], expected)


def test_the_forms_of_a_picture():
    scene = rtsg.loads(LAMP)
    picture = scene.render(width=32, height=16)
    assert picture.shape == (16, 32, 3) and picture.dtype == np.uint8
    assert picture[8, 16].tolist() == [255, 0, 0] and picture[0, 0].tolist() == [0, 0, 0]
    linear = scene.render(width=32, height=16, format="linear")
    assert linear.shape == (16, 32, 4) and linear.dtype == np.float32 and linear[8, 16].tolist() == [1, 0, 0, 1]
    scene["PAINT"].emissiveColor = 0, 1, 0
    assert scene.render(width=32, height=16)[8, 16].tolist() == [0, 255, 0]


def test_the_data_of_pixels():
    scene = rtsg.loads(LAMP)
    data = scene.render_layers(["depth", "normal", "position", "ids", "albedo", "motion"], width=32, height=18, samples=1)
    assert data["depth"].shape == (18, 32) and data["normal"].shape == data["position"].shape == (18, 32, 3)
    assert data["motion"].shape == (18, 32, 2) and data["ids"].dtype == np.uint32
    floor = scene["FLOOR"]
    seen = data["ids"] == floor.node_id
    assert seen.any() and not seen.all() and set(np.unique(data["ids"])) == {0, floor.node_id}
    assert np.isinf(data["depth"][~seen]).all() and np.isfinite(data["depth"][seen]).all()
    assert np.allclose(np.linalg.norm(data["normal"][seen], axis=1), 1, atol=1e-5)
    assert np.allclose(10 - data["position"][seen][:, 2], data["depth"][seen], atol=1e-4)


def test_options_that_are_wrong(hall):
    with pytest.raises(TypeError, match="no option heigth"):
        hall.render(heigth=2)
    with pytest.raises(ValueError, match='"whitted", "path"'):
        hall.render(integrator="ogre")
    with pytest.raises(ValueError, match="a layer is one of"):
        hall.render_layers(["dpeth"])
    for name, value, said in (("width", 8.0, "a whole number, not 8.0"), ("samples", "4", "a whole number, not '4'"), ("seed", -1, "from 0, not -1"),
                              ("panorama", "yes", "True or False, not 'yes'"), ("integrator", 3, "a text, not 3"), ("viewpoint", None, "a text, not None")):
        with pytest.raises(TypeError, match=f"the option {name} is .*{said}"):
            hall.render(**{name: value})
        with pytest.raises(TypeError, match=f"the option {name} is .*{said}"):
            hall.render_layers(["depth"], **{name: value})
    with pytest.raises(rtsg.Error):
        hall.render(width=0)
    with pytest.raises(rtsg.Error, match="NOBODY"):
        hall.render(viewpoint="NOBODY")


def test_an_error_that_is_not_reached_is_a_warning(hall):
    hall.frame(0)
    with pytest.warns(rtsg.DiagnosticWarning, match="more than 4 samples"):
        data = hall.render_layers([], width=32, height=18, samples=4, error=1e-4, integrator="path")
    assert data["interval"].shape == (18, 32, 3)


def test_what_a_ray_meets():
    scene = rtsg.loads(LAMP)
    pick = scene.pick((1, 5, 2), (0, -2, 0))
    assert pick.node == scene["FLOOR"] and pick.path == (scene["FLOOR"],)
    assert pick.point.tolist() == [1, .5, 2] and pick.normal.tolist() == [0, 1, 0] and pick.distance == 4.5
    assert scene.pick((1, 5, 2), (0, 1, 0)) is None and scene.pick((1, 5, 2), (0, -1, 0), maximum=4) is None
    assert scene.nearest((0, 3, 0)).distance == 2.5
    assert scene.sweep((0, 3, 0), 1, (0, -5, 0)).distance == pytest.approx(1.5)
    assert scene.pick_pixel(320, 200).node == scene["FLOOR"]
    with pytest.raises(ValueError, match="outside"):
        scene.pick_pixel(640, 0)
    with pytest.raises(rtsg.Error):
        scene.pick((0, 0, 0), (0, 0, 0))


def test_light_that_falls_on_a_place_is_pi_head_on():
    scene = rtsg.loads("#X3D V4.0 utf8\nPROFILE Interchange\nDirectionalLight { direction 0 -1 0 }\n"
                       "Shape { appearance Appearance { material Material { diffuseColor 0 0 0 } } geometry Box { } }")
    for tilt in (0, math.pi / 3):
        found = scene.irradiance((0, 2, 0), (math.sin(tilt), math.cos(tilt), 0), error=.01)
        assert found.reached and abs(found.luminous - math.pi * math.cos(tilt)) <= found.luminous_interval + 1e-6
    with pytest.raises(ValueError):
        scene.irradiance((0, 2, 0), (0, 1, 0), error=0)


def test_a_picture_of_a_state_of_a_log(moving, tmp_path):
    with moving.record(tmp_path / "a.rlog"):
        pictures = []
        for k in range(5):
            moving.frame(k / 4)
            pictures.append(moving.render(width=32, height=18))
    log = rtsg.Log(tmp_path / "a.rlog")
    log.seek(.5)
    assert np.array_equal(log.scene.render(width=32, height=18), pictures[2])
