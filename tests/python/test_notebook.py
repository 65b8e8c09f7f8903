"""What notebooks show: a picture of a scene, a log's time line, a sound's player. No notebook is needed."""
import base64
import io
import re
import struct
import wave
import xml.etree.ElementTree
import zlib

import numpy as np

import rtsg
from conftest import ROOT


def pixels(png):
    """Of a PNG file without filters."""
    assert png.startswith(b"\x89PNG\r\n\x1a\n")
    at, data, size = 8, b"", None
    while at < len(png):
        length, kind = struct.unpack_from(">I4s", png, at)
        body = png[at + 8:at + 8 + length]
        assert struct.unpack_from(">I", png, at + 8 + length)[0] == zlib.crc32(kind + body)
        size = struct.unpack(">II", body[:8]) if kind == b"IHDR" else size
        data += body if kind == b"IDAT" else b""
        at += 12 + length
    rows = np.frombuffer(zlib.decompress(data), np.uint8).reshape(size[1], 1 + 3 * size[0])
    assert (rows[:, 0] == 0).all()
    return rows[:, 1:].reshape(size[1], size[0], 3)


def test_a_scene_is_a_picture(moving):
    moving.frame(0)
    shown = pixels(moving._repr_png_())
    assert (shown == moving.render(width=480, height=270, samples=4)).all() and shown.any()
    moving.close()
    assert moving._repr_png_() is None


def test_a_log_is_a_time_line(moving, tmp_path):
    with moving.record(tmp_path / "a.rlog", keyframe_seconds=.5):
        for k in range(120):
            moving.frame(k / 60)
    log = rtsg.Log(tmp_path / "a.rlog")
    log.seek(1)
    shown = xml.etree.ElementTree.fromstring(log._repr_html_().replace("<br>", "<br/>"))
    text = "".join(shown.itertext())
    assert f"{log.summary['states']} states" in text and "at 1 s" in text and "damaged" not in text
    assert len(shown.findall(".//rect")) >= 1 and float(shown.find(".//line").get("x1")) == round(640 / log.summary["seconds"], 1)
    data = bytearray((tmp_path / "a.rlog").read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "b.rlog").write_bytes(data)
    assert "bytes are damaged" in rtsg.Log(tmp_path / "b.rlog")._repr_html_()
    log.close()
    assert log._repr_html_() is None


def test_a_sound_is_a_player_or_a_table():
    room = rtsg.load(ROOT / "examples/room.x3dv")
    room.frame(0)
    heard = room.listen(.1, metrics=False, sample_rate=16000)
    data = re.fullmatch(r'<audio controls src="data:audio/wav;base64,([^"]+)"></audio>', heard._repr_html_())[1]
    with wave.open(io.BytesIO(base64.b64decode(data))) as file:
        assert (file.getnchannels(), file.getframerate(), file.getnframes()) == (2, 16000, 1600)
        samples = np.frombuffer(file.readframes(1600), "<i2").reshape(-1, 2) / 32767
    assert np.abs(samples - heard.samples).max() < 1e-4
    table = room.listen(0, rays=500)._repr_html_()
    assert table.startswith("<table>") and "RINGING" in table and "&plusmn;" in table
