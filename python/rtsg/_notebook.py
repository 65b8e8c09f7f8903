"""How scenes, logs and sounds show themselves in notebooks: a picture, a time line, a player."""
import base64
import html
import io
import struct
import wave
import zlib

import numpy as np

_PICTURE = {"width": 480, "height": 270, "samples": 4}
_WIDE, _HIGH = 640, 60  # of a time line


def png(picture):
    """A picture, height x width x 3 bytes, as a PNG file."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width, _ = picture.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), picture.reshape(height, -1)], axis=1)  # no filter
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) + chunk(b"IDAT", zlib.compress(rows.tobytes()))
            + chunk(b"IEND", b""))


def scene_png(scene):
    """The scene as the bound viewpoint sees it now; nothing of one that is closed."""
    return None if scene.closed else png(scene.render(**_PICTURE))


def wav(samples, rate):
    """n x channels floats as a WAV file of 16 bits."""
    file = io.BytesIO()
    with wave.open(file, "wb") as out:
        out.setnchannels(samples.shape[1])
        out.setsampwidth(2)
        out.setframerate(rate)
        out.writeframes((np.clip(samples, -1, 1) * 32767).astype("<i2").tobytes())
    return file.getvalue()


def sound_html(sound):
    """A player; where only figures were asked for, their reverberation times."""
    if len(sound.samples):
        data = base64.b64encode(wav(sound.samples[:, :2], sound.sample_rate)).decode()
        return f'<audio controls src="data:audio/wav;base64,{data}"></audio>'
    rows = "".join(f"<tr><td>{html.escape(one['source'])}</td>" + "".join(f"<td>{t:.2f} &plusmn; {i:.2f}</td>" for t, i in
                                                                         zip(one["T30_s"], one["ci95"]["T30_s"])) + "</tr>" for one in sound.sources)
    bands = "".join(f"<th>{band:g}</th>" for band in (sound.sources[0]["bands_hz"] if sound.sources else ()))
    return f"<table><tr><th>T30 in s, by Hz</th>{bands}</tr>{rows}</table>"


def log_html(log):
    """The time line: how much was written when, the whole states, what is damaged, and where the log is."""
    if log.scene.closed:
        return None
    said, places = log.summary, log._keyframes + [(log.summary["bytes"], log.summary["seconds"])]
    seconds = max(said["seconds"], 1e-9)
    across = _WIDE / seconds
    rates = [((b - a) / max(t - s, 1e-9), s, t) for (a, s), (b, t) in zip(places, places[1:]) if t > s]
    most = max((rate for rate, _, _ in rates), default=1)
    marks = [f'<rect x="{s * across:.1f}" width="{max((t - s) * across, 1):.1f}" y="{_HIGH * (1 - rate / most):.1f}" height="{_HIGH * rate / most:.1f}" '
             f'fill="#9bd"><title>{rate / 1e3:.3g} kB/s from {s:g} s</title></rect>' for rate, s, t in rates]
    for place in log.damage:
        at = np.interp(place.offset, [p[0] for p in places], [p[1] for p in places]) * across
        marks.append(f'<rect x="{at:.1f}" width="2" y="0" height="{_HIGH}" fill="#c22"><title>{place.length} bytes are damaged</title></rect>')
    marks.append(f'<line x1="{log.time * across:.1f}" x2="{log.time * across:.1f}" y1="0" y2="{_HIGH}" stroke="#333"><title>t = {log.time:g} s</title></line>')
    words = f"{said['states']} states in {said['seconds']:g} s, {said['bytes'] / 1e3:.4g} kB, {said['nodes']} nodes"
    words += "" if said["closed"] else ", not closed"
    words += f", {said['damaged']} places damaged" if said["damaged"] else ""
    return (f'<div>{words}<br><svg width="{_WIDE}" height="{_HIGH}" style="border:1px solid #aaa">{"".join(marks)}</svg>'
            f'<br>0 s to {said["seconds"]:g} s; at {log.time:g} s</div>')
