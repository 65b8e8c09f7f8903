#!/usr/bin/env python3
"""Judges what examples/demo/run left in a folder, says so on the terminal, and writes report.html. Standard library only.

Exit status 1 if anything is not as it has to be.
"""
import array
import base64
import datetime
import html
import json
import math
import mimetypes
import os
import platform
import struct
import sys
import wave
from pathlib import Path

out = Path(sys.argv[1])


def read(name):
    return json.loads((out / name).read_text().splitlines()[-1])


def levels(name):
    """Samples, rate, channels, peak and RMS in dB below full scale, of a 24-bit WAV."""
    with wave.open(str(out / name)) as wav:
        frames, channels, width = wav.getnframes(), wav.getnchannels(), wav.getsampwidth()
        data = wav.readframes(frames)
    assert width == 3, "24-bit sound expected"
    wide = bytearray(4 * (len(data) // 3))
    wide[1::4], wide[2::4], wide[3::4] = data[0::3], data[1::3], data[2::3]
    samples = array.array("i", wide)
    if sys.byteorder == "big":
        samples.byteswap()
    full = 2.0**31
    peak = max((abs(s) for s in samples), default=0) / full
    rms = [math.sqrt(sum((s / full) ** 2 for s in samples[c::channels]) / max(1, frames)) for c in range(channels)]
    decibels = lambda x: 20 * math.log10(x) if x > 0 else -math.inf
    return frames, wav.getframerate(), channels, decibels(peak), [decibels(r) for r in rms]


def mcap_messages(name):
    """The JSON messages of an MCAP file with uncompressed chunks, as (topic, message)."""
    data, topics = (out / name).read_bytes(), {}
    text = lambda at: (data[at + 4:at + 4 + struct.unpack_from("<I", data, at)[0]].decode(), at + 4 + struct.unpack_from("<I", data, at)[0])

    def walk(at, end):
        while at + 9 <= end:
            kind, length = struct.unpack_from("<BQ", data, at)
            body, at = at + 9, at + 9 + length
            if kind == 6:  # a chunk: times, size, checksum, compression, then records
                yield from walk(text(body + 28)[1] + 8, at)
            elif kind == 4:  # a channel
                topics[struct.unpack_from("<H", data, body)[0]] = text(body + 4)[0]
            elif kind == 5:
                yield topics[struct.unpack_from("<H", data, body)[0]], json.loads(data[body + 22:at])
            elif kind == 15:  # the end of the data: the rest is an index
                return

    yield from walk(8, len(data))


def sets_that_move(sets):
    """Of the states in the log: the first, and those whose changes place something anew."""
    place = {"translation", "rotation", "scale", "scaleOrientation", "center", "whichChoice", "point"}
    return sum(k == 0 or any(change.get("field") in place for change in s["changes"]) for k, s in enumerate(sets))


serve, mirror, replay, diff = read("serve.jsonl"), read("mirror.json"), read("replay.json"), read("diff.json")
info, listen = read("info.json"), read("listen.json")
samples, rate, channels, peak, rms = levels("replica.wav")
seconds, fps = float(sys.argv[2]), 1  # what was asked for
sets = [message for topic, message in mcap_messages("mirror.mcap") if topic == "/rtsg/changes"]
moved = sets_that_move(sets)
pictures = sorted(p.name for p in out.glob("replica-*.png"))
log_bytes = (out / "session.rlog").stat().st_size

checks = [
    (mirror["equal"] and mirror["divergences"] == 0,
     f"replica: {mirror['frames']} frames applied, the state hash equal to the origin's in every one"),
    (mirror["hash"] == serve["hash"] and mirror["sequence"] == serve["sequence"],
     f"replica and origin ended in the same state, {serve['hash']}"),
    (mirror["gaps"] == 0, "no frame was lost on the way"),
    (replay["verified"] == replay["frames"] and replay["first_divergence"] is None,
     f"replay: {replay['verified']} of {replay['frames']} recorded states verified"),
    (diff["equal"], "the origin's log and the replica's log agree state by state"),
    (len(pictures) == mirror["pictures"] == math.ceil(seconds * fps) and mirror["missing"] is None,
     f"{len(pictures)} pictures of the replica, one a second from the origin's start"),
    (channels == 2 and samples == round(seconds * rate) and -40 < min(rms) and peak <= -0.5,
     f"{samples} samples of stereo sound, {seconds:g} s to the sample: peak {peak:.1f} dB, mean {rms[0]:.1f} and {rms[1]:.1f} dB re full scale"),
    (len(mirror["picture_states"]) == len(pictures) and mirror["picture_states"] == mirror["sound_states"],
     f"each picture and the sound of its instant are of one state: {', '.join(map(str, mirror['picture_states'][:3]))}, … {mirror['picture_states'][-1]}"),
    (mirror["flattenings"] == 1 and mirror["worlds"] == 1,
     "pictures and sound share one flattening and one BVH"),
    (mirror["commits"] == moved,
     f"{mirror['commits']} commits of it for {moved} states that place something anew, of {mirror['frames']}"),
]
good = all(ok for ok, _ in checks)

numbers = [
    ("scene", f"{info['nodes']} nodes, {info['triangles']} triangles, {info['routes']} routes, {info['sounds']} sound nodes"),
    ("origin", f"{serve['frames']} frames in {serve['seconds']:.1f} s: {serve['fps']:.1f} frames a second"),
    ("mirror", f"{mirror['bytes']} bytes over TCP, {mirror['bytes_per_frame']:.0f} a frame with the first snapshot"),
    ("log", f"{log_bytes} bytes, {log_bytes / replay['frames']:.0f} a frame with its keyframes"),
    ("followed", f"{mirror['seconds']:.1f} s; pictures and sound were at most {mirror['behind_s']:.1f} s of the scene behind"),
]

print()
for ok, text in checks:
    print(("  proved  " if ok else "  FAILED  ") + text)
print()
for name, text in numbers:
    print(f"  {name:9} {text}")

band = "{:g}".format


def figures(source):
    rows = (("EDT", "EDT_s", "s", 2), ("T20", "T20_s", "s", 2), ("T30", "T30_s", "s", 2), ("C80", "C80_db", "dB", 1),
            ("D50", "D50", "", 2), ("Ts", "Ts_s", "s", 3), ("G", "G_db", "dB", 1))
    cell = lambda v, places: "–" if v is None else f"{v:.{places}f}"
    head = "".join(f"<th>{band(hz)} Hz</th>" for hz in source["bands_hz"])
    body = "".join(f"<tr><th>{name} {unit}</th>" + "".join(f"<td>{cell(v, places)}</td>" for v in source[key]) + "</tr>"
                   for name, key, unit, places in rows)
    return f"<h3>{html.escape(source['source'])}</h3><div class='wide'><table><tr><th></th>{head}</tr>{body}</table></div>"


def embedded(name):
    """The file within the page, so that the page can be sent to somebody alone."""
    kind = mimetypes.guess_type(name)[0] or "application/octet-stream"
    return f"data:{kind};base64,{base64.b64encode((out / name).read_bytes()).decode()}"


COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")


def chart(title, unit, lines, labels):
    """Lines of (name, values, half widths of 95 % intervals or None) over `labels`, one a value; as SVG."""
    width, height, left, top, bottom = 480, 250, 44, 34, 50
    values = [v + (w[i] if w else 0) for _, vs, w in lines for i, v in enumerate(vs) if v is not None]
    most = max(values, default=1) or 1
    step = 10 ** math.floor(math.log10(most))
    step = next(step * k for k in (.2, .5, 1, 2) if most / (step * k) <= 5.0001)
    most = step * math.ceil(most / step - 1e-9)
    count = len(labels)
    x = lambda i: left + (width - left - 16) * (i / max(1, count - 1))
    y = lambda v: height - bottom - (height - bottom - top) * v / most
    parts = [f'<text x="{left}" y="18" font-weight="bold">{html.escape(title)}</text>']
    for k in range(round(most / step) + 1):
        parts.append(f'<path d="M{left} {y(k * step):.1f}H{width - 16}" stroke="#e3e3e3"/>'
                     f'<text x="{left - 6}" y="{y(k * step) + 4:.1f}" text-anchor="end">{k * step:g}</text>')
    for i in range(0, count, max(1, math.ceil(count / 6))):
        parts.append(f'<text x="{x(i):.1f}" y="{height - bottom + 18}" text-anchor="middle">{html.escape(labels[i])}</text>')
    for n, (name, vs, widths) in enumerate(lines):
        color = COLORS[n % len(COLORS)]
        known = [(i, v) for i, v in enumerate(vs) if v is not None]
        if widths:
            parts += [f'<path d="M{x(i):.1f} {y(max(0, v - widths[i])):.1f}V{y(v + widths[i]):.1f}" stroke="{color}" stroke-width="3" opacity=".35"/>'
                      for i, v in known]
        points = " ".join(f"{x(i):.1f},{y(v):.1f}" for i, v in known)
        parts.append(f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="1.6"/>'
                     f'<text x="{left + 150 * n}" y="{height - 6}" fill="{color}">{html.escape(name)}</text>')
    parts.append(f'<text x="{width - 16}" y="18" text-anchor="end" fill="#555">{html.escape(unit)}</text>')
    return f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{html.escape(title)}" font-size="15">{"".join(parts)}</svg>'


def charts():
    times = [s["t"] for s in sets]
    traffic = chart("Changes in each state", "time (s)", [("fields", [len(s["changes"]) for s in sets[1:]], None)],
                    [f"{t - times[0]:.0f}" for t in times[1:]])
    bands = [f"{hz:g}" for hz in listen["sources"][0]["bands_hz"]]
    decay = chart("T20 (s), with 95 % intervals", "octave band (Hz)",
                  [(s["source"], s["T20_s"], s["ci95"]["T20_s"]) for s in listen["sources"]], bands)
    return traffic, decay


traffic, decay = charts()
made = (f"{datetime.datetime.now(datetime.timezone.utc):%d %B %Y, %H:%M} UTC, {sys.argv[3]}, {platform.system()} on {platform.machine()}, "
        f"{os.cpu_count()} cores")

page = f"""<!doctype html><html lang="en"><meta charset="utf-8"><title>RTSG demonstration</title>
<meta name="viewport" content="width=device-width">
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; }}
img {{ max-width: 100%; border-radius: 4px; }} .strip {{ display: grid; gap: 6px; grid-template-columns: repeat(4, 1fr); }}
table {{ border-collapse: collapse; font-size: 14px; }} td, th {{ padding: 2px 10px 2px 0; text-align: right; white-space: nowrap; }}
.wide {{ overflow-x: auto; }} .text td {{ white-space: normal; overflow-wrap: anywhere; }} .text td:first-child {{ white-space: nowrap; }} li {{ overflow-wrap: anywhere; }} svg {{ width: 100%; max-width: 40rem; height: auto; }} audio, video {{ max-width: 100%; }}
th:first-child, td:first-child {{ text-align: left; }} .ok {{ color: #17713a; }} .no {{ color: #b00020; font-weight: bold; }}
code {{ background: #f2f2f2; padding: 1px 4px; border-radius: 3px; }}
</style>
<h1>One scene, seen, heard, mirrored, logged and replayed</h1>
<p>{html.escape(made)}</p>
<img src="{embedded("hall.png")}" alt="The hall, from the log">
<h2>What was proved</h2><ul>
{"".join(f'<li class="{"ok" if ok else "no"}">{"" if ok else "FAILED: "}{html.escape(text)}</li>' for ok, text in checks)}</ul>
<h2>Numbers</h2><table class="text">{"".join(f"<tr><td>{name}</td><td style='text-align:left'>{html.escape(text)}</td></tr>" for name, text in numbers)}</table>
{traffic}
<h2>Sound of the replica</h2>
<p>What the listener at the viewpoint hears: direct sound with delay and Doppler, reflections traced anew as the sources move.</p>
<audio controls src="{embedded("replica.wav")}"></audio>
<h2>Pictures of the replica, one a second</h2>
<div class="strip">{"".join(f'<img src="{embedded(name)}" alt="{name}">' for name in pictures)}</div>
<h2>The session, replayed from its log</h2>
<video controls loop playsinline src="{embedded("hall.mp4")}" aria-label="The session as a film with sound"></video>
<h2>The hall's acoustics at the start</h2>
<p>ISO 3382 figures by octave band, {listen['rays']} rays, {listen['seconds']:.1f} s of computing.</p>
{decay}
{"".join(figures(source) for source in listen["sources"])}
<h2>How it was made</h2>
<ol><li><code>rtsg serve hall.x3dv --record session.rlog</code>: runs the scene in real time and publishes every frame as one change set.</li>
<li><code>rtsg mirror tcp://127.0.0.1:… --render … --listen …</code>: another process; a snapshot, then frames, into a replica
that the light tracer and the acoustic tracer follow. After each frame the replica's state hash is compared with the origin's.</li>
<li><code>rtsg replay session.rlog --verify</code>, <code>--diff mirror.rlog</code>, <code>--seek … --render hall.png</code>,
<code>--render hall.mp4 --listen hall.mp4</code>.</li></ol>
<p>Beside this page, where it was made: <a href="session.rlog">session.rlog</a>, <a href="mirror.rlog">mirror.rlog</a>, <a href="replica.x3dv">replica.x3dv</a>
(the replica saved as a document), <a href="replica.wav">replica.wav</a>, and the JSON that this page was made from.</p>
</html>
"""
(out / "report.html").write_text(page)
print(f"\n  report    {out / 'report.html'}")
sys.exit(0 if good else 1)
