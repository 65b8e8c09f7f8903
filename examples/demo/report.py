#!/usr/bin/env python3
"""Judges what examples/demo/run left in a folder, says so on the terminal, and writes report.html. Standard library only.

Exit status 1 if anything is not as it has to be.
"""
import array
import base64
import datetime
import io
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


def samples_of(name):
    """Of a 24-bit WAV: its samples as 32-bit integers, channel by channel in turn, their rate, and how many channels."""
    with wave.open(str(out / name)) as wav:
        frames, rate, channels, width = wav.getnframes(), wav.getframerate(), wav.getnchannels(), wav.getsampwidth()
        data = wav.readframes(frames)
    assert width == 3, "24-bit sound expected"
    wide = bytearray(4 * (len(data) // 3))
    wide[1::4], wide[2::4], wide[3::4] = data[0::3], data[1::3], data[2::3]
    samples = array.array("i", wide)
    if sys.byteorder == "big":
        samples.byteswap()
    return samples, rate, channels


def levels(samples, channels):
    """Peak, and RMS of each channel, in dB below full scale."""
    full, frames = 2.0**31, len(samples) // channels
    peak = max((abs(s) for s in samples), default=0) / full
    rms = [math.sqrt(sum((s / full) ** 2 for s in samples[c::channels]) / max(1, frames)) for c in range(channels)]
    decibels = lambda x: 20 * math.log10(x) if x > 0 else -math.inf
    return decibels(peak), [decibels(r) for r in rms]


def smaller(samples, rate, channels):
    """The same sound as a 16-bit WAV of half the rate, a third of the bytes: what a page can carry."""
    near, far = 0.3066, -0.0566  # a half-band filter of seven taps: below a sixth of the rate it passes all
    halved = array.array("h", bytes(2 * channels * (len(samples) // channels // 2)))
    for c in range(channels):
        x = samples[c::channels]
        x = array.array("i", [0, 0, 0]) + x + array.array("i", [0, 0, 0, 0])
        for i in range(len(halved) // channels):
            k = 2 * i + 3
            v = x[k] / 2 + near * (x[k - 1] + x[k + 1]) + far * (x[k - 3] + x[k + 3])
            halved[i * channels + c] = max(-32768, min(32767, round(v / 65536)))
    if sys.byteorder == "big":
        halved.byteswap()
    out = io.BytesIO()
    with wave.open(out, "wb") as wav:
        wav.setnchannels(channels)
        wav.setsampwidth(2)
        wav.setframerate(rate // 2)
        wav.writeframes(halved.tobytes())
    return out.getvalue()


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
heard, rate, channels = samples_of("replica.wav")
samples = len(heard) // channels
peak, rms = levels(heard, channels)
seconds, fps = float(sys.argv[2]), 1  # what was asked for
sets = [message for topic, message in mcap_messages("mirror.mcap") if topic == "/rtsg/changes"]
moved = sets_that_move(sets)
pictures = sorted(p.name for p in out.glob("replica-*.jpg"))
log_bytes = (out / "session.rlog").stat().st_size



def size(count):
    """Bytes as people say them."""
    for unit, of in (("MB", 1e6), ("kB", 1e3)):
        if count >= of:
            return f"{count / of:.{0 if count >= 10 * of else 1}f} {unit}"
    return f"{count:.0f} bytes"


def several(count, one, more=None):
    return f"{count:,} {one if count == 1 else more or one + 's'}"


checks = [
    (mirror["equal"] and mirror["divergences"] == 0,
     f"The replica had the origin's state hash in each of {mirror['frames']:,} states."),
    (mirror["hash"] == serve["hash"] and mirror["sequence"] == serve["sequence"],
     f"Replica and origin ended in the same state, number {serve['sequence']:,}, with the hash {serve['hash']}."),
    (mirror["gaps"] == 0 and serve["lost"] == 0, "No state and no mirror was lost on the way."),
    (replay["verified"] == replay["frames"] and replay["first_divergence"] is None,
     f"The log, replayed, led to {replay['verified']:,} of {replay['frames']:,} recorded states, bit for bit."),
    (diff["equal"], "The origin's log and the replica's log agree in every state."),
    (len(pictures) == mirror["pictures"] == math.ceil(seconds * fps) and mirror["missing"] is None,
     f"All {several(len(pictures), 'picture')} of the replica are there, one a second from the origin's start."),
    (channels == 2 and samples == round(seconds * rate) and -40 < min(rms) and peak <= -0.5,
     f"Its stereo sound is {seconds:g} s long to the sample, and neither silent nor clipped: {rms[0]:.0f} and {rms[1]:.0f} dB on average, "
     f"{peak:.1f} dB at most, where 0 dB is full scale."),
    (len(mirror["picture_states"]) == len(pictures) and mirror["picture_states"] == mirror["sound_states"],
     f"Each picture and the sound of its instant were made of one state (numbers {', '.join(map(str, mirror['picture_states'][:3]))} to "
     f"{mirror['picture_states'][-1]})."),
    (mirror["flattenings"] == 1 and mirror["worlds"] == 1,
     "Pictures and sound shared one flattened scene and one bounding volume hierarchy."),
    (mirror["commits"] == moved,
     f"That hierarchy was updated {several(mirror['commits'], 'time')}: once for each of the {moved:,} states that place something anew."),
]
good = all(ok for ok, _ in checks)

# A state for the document, one for each frame, and those that loaded files make between frames.
loaded = mirror["frames"] - 1 - serve["frames"]
counts = (f"Why {serve['frames']:,}, {mirror['frames']:,} and {serve['sequence']:,}? The origin ran {several(serve['frames'], 'frame')}. "
          f"Each makes a state, and so does the document itself"
          + (f"; {several(loaded, 'more was', 'more were')} made between frames, when a file that the scene names had been loaded" if loaded else "")
          + f": {several(mirror['frames'], 'state')}. They are numbered from 2, as 1 is the scene before its document is in it: the last "
          f"is number {serve['sequence']:,}."
          + (f" {several(mirror['frames'] - moved, 'state')} moved nothing." if mirror["frames"] > moved else ""))

numbers = [
    ("scene", f"{several(info['nodes'], 'node')}, {several(info['triangles'], 'triangle')}, {several(info['routes'], 'route')}, {several(info['sounds'], 'source')} of sound"),
    ("origin", f"{several(serve['frames'], 'frame')} in {serve['seconds']:.1f} s, {serve['fps']:.1f} a second"),
    ("mirror", f"{size(mirror['bytes'])} over TCP, {size(mirror['bytes_per_frame'])} a state, the first snapshot included"),
    ("log", f"{size(log_bytes)}, {size(log_bytes / replay['frames'])} a state, keyframes included"),
    ("drawing", f"pictures and sound of every state were {mirror['behind_s']:.1f} s of scene time behind at most, as "
                f"{several(os.cpu_count(), 'core')} drew them while the session ran"),
]

print()
for ok, text in checks:
    print(("  proved  " if ok else "  FAILED  ") + text)
print()
for name, text in numbers:
    print(f"  {name:9} {text}")



def band(hz):
    return f"{hz:g} Hz" if hz < 1000 else f"{hz / 1000:g} kHz"


def is_below(source, hz):
    """Whether the octave begins below the Schroeder frequency: there a room has single modes, which no ray knows."""
    return hz / math.sqrt(2) < source["schroeder_hz"]


def figures(source):
    rows = (("EDT", "early decay, s", "EDT_s", 2), ("T20", "reverberation, s", "T20_s", 2), ("T30", "reverberation, s", "T30_s", 2),
            ("C80", "clarity, dB", "C80_db", 1), ("D50", "definition", "D50", 2), ("Ts", "centre time, ms", "Ts_s", 0), ("G", "strength, dB", "G_db", 1))
    scale = {"Ts_s": 1000}
    below = [' class="below"' if is_below(source, hz) else "" for hz in source["bands_hz"]]

    def cell(key, value, half, places, grey):
        if value is None:
            return f"<td{grey}>–</td>"
        value, half = (v and v * scale.get(key, 1) for v in (value, half))
        interval = "" if half is None else f"<br><small>± {half:.{places}f}</small>"
        return f"<td{grey}>{value:.{places}f}{interval}</td>"

    head = "".join(f"<th{grey}>{band(hz)}</th>" for hz, grey in zip(source["bands_hz"], below))
    body = "".join(f"<tr><th>{name} <small>{what}</small></th>"
                   + "".join(cell(key, *one, places, grey) for *one, grey in zip(source[key], source["ci95"][key], below)) + "</tr>"
                   for name, what, key, places in rows)
    return f"<h3>{html.escape(source['source'])}</h3><div class='wide'><table><tr><th></th>{head}</tr>{body}</table></div>"


def embedded(name, content=None):
    """The file within the page, so that the page can be sent to somebody alone."""
    kind = mimetypes.guess_type(name)[0] or "application/octet-stream"
    return f"data:{kind};base64,{base64.b64encode(content or (out / name).read_bytes()).decode()}"


def shown(name, text, alt):
    return f'<figure><img src="{embedded(name)}" alt="{html.escape(alt)}"><figcaption>{html.escape(text)}</figcaption></figure>'


COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")


def chart(title, unit, lines, labels, grey=0, times=None):
    """Lines of (name, values, half widths of 95 % intervals or None) over `labels`, one a value, or over `times` from 0 on; as SVG. The first `grey` values do
    not count."""
    width, height, left, top, bottom = 480, 250, 44, 34, 50
    values = [v + (w[i] if w else 0) for _, vs, w in lines for i, v in enumerate(vs) if v is not None]
    most = max(values, default=1) or 1
    step = 10 ** math.floor(math.log10(most))
    step = next(step * k for k in (.2, .5, 1, 2) if most / (step * k) <= 5.0001)
    most = step * math.ceil(most / step - 1e-9)
    count = len(times or labels)
    last = times[-1] if times and times[-1] > 0 else max(1, count - 1)
    across = lambda t: left + (width - left - 16) * (t / last)
    x = lambda i: across(times[i] if times else i)
    y = lambda v: height - bottom - (height - bottom - top) * v / most
    parts = [f'<text x="{left}" y="18" font-weight="bold">{html.escape(title)}</text>']
    if grey:
        parts.append(f'<rect x="{left}" y="{top}" width="{across(grey - .5) - left:.1f}" height="{height - bottom - top}" fill="#ececec"/>')
    for k in range(round(most / step) + 1):
        parts.append(f'<path d="M{left} {y(k * step):.1f}H{width - 16}" stroke="#e3e3e3"/>'
                     f'<text x="{left - 6}" y="{y(k * step) + 4:.1f}" text-anchor="end">{k * step:g}</text>')
    marks = [(t, f"{t:g}") for t in range(0, int(last) + 1, max(1, math.ceil(last / 6)))] if times else list(enumerate(labels))[::max(1, math.ceil(count / 6))]
    for at, label in marks:
        parts.append(f'<text x="{across(at):.1f}" y="{height - bottom + 18}" text-anchor="middle">{html.escape(label)}</text>')
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
    traffic = chart("Fields changed in each state", "time (s)", [("fields", [len(s["changes"]) for s in sets[1:]], None)], None,
                    times=[t - times[0] for t in times[1:]])
    first = listen["sources"][0]
    decay = chart("T20 (s), with 95 % intervals", "octave band (Hz)",
                  [(s["source"], s["T20_s"], s["ci95"]["T20_s"]) for s in listen["sources"]], [f"{hz:g}" for hz in first["bands_hz"]],
                  sum(is_below(first, hz) for hz in first["bands_hz"]))
    return traffic, decay


traffic, decay = charts()
made = (f"{datetime.datetime.now(datetime.timezone.utc):%d %B %Y, %H:%M} UTC, {sys.argv[3]}, {platform.system()} on {platform.machine()}, "
        f"{os.cpu_count()} cores")

page = f"""<!doctype html><html lang="en"><meta charset="utf-8"><title>RTSG demonstration</title>
<meta name="viewport" content="width=device-width">
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; }}
img {{ max-width: 100%; border-radius: 4px; display: block; }} .strip {{ display: grid; gap: 10px 6px; grid-template-columns: repeat(auto-fill, minmax(11rem, 1fr)); }}
figure {{ margin: 0; }} figcaption, .soft {{ color: #555; font-size: 14px; }} video {{ width: 640px; }} .below, .below small {{ color: #999; }} small {{ color: #555; }}
table {{ border-collapse: collapse; font-size: 14px; }} td, th {{ padding: 2px 10px 2px 0; text-align: right; white-space: nowrap; }}
.wide {{ overflow-x: auto; }} .text td {{ white-space: normal; overflow-wrap: anywhere; }} .text td:first-child {{ white-space: nowrap; }} li {{ overflow-wrap: anywhere; }} svg {{ width: 100%; max-width: 40rem; height: auto; }} audio, video {{ max-width: 100%; }}
th:first-child, td:first-child {{ text-align: left; }} .ok {{ color: #17713a; }} .no {{ color: #b00020; font-weight: bold; }}
code {{ background: #f2f2f2; padding: 1px 4px; border-radius: 3px; }}
</style>
<h1>One scene, seen, heard, mirrored, logged and replayed</h1>
<p>{html.escape(made)}</p>
{shown("hall.jpg", f"The hall {seconds * .3:g} s after the start, drawn from the log with 8 samples a pixel.", "The hall, from the log")}
<h2>What was proved</h2><ul>
{"".join(f'<li class="{"ok" if ok else "no"}">{"" if ok else "FAILED: "}{html.escape(text)}</li>' for ok, text in checks)}</ul>
<h2>Numbers</h2><table class="text">{"".join(f"<tr><td>{name}</td><td style='text-align:left'>{html.escape(text)}</td></tr>" for name, text in numbers)}</table>
<p class="soft">{html.escape(counts)}</p>
{traffic}
<p class="soft">How many fields each state changed after the first snapshot: what moves all the time, and now and then a chime.</p>
<h2>Sound of the replica</h2>
<audio controls src="{embedded("replica.wav", smaller(heard, rate, channels))}"></audio>
<p class="soft">What the listener at the viewpoint hears: direct sound with delay and Doppler, reflections traced anew as the sources move.
Here at {rate // 2000} kHz and 16 bits; replica.wav beside this page has all of it.</p>
<h2>Pictures of the replica, one a second</h2>
<div class="strip">{"".join(shown(name, f"{t:g} s, state {state}", f"The replica at {t:g} s") for name, t, state in zip(pictures, mirror["picture_times"], mirror["picture_states"]))}</div>
<h2>The session, replayed from its log</h2>
<figure><video controls loop playsinline src="{embedded("hall.mp4")}" poster="{embedded(pictures[0])}" aria-label="The session as a film with sound"></video>
<figcaption>All {seconds:g} s with their sound, drawn anew from the log at 12 pictures a second.</figcaption></figure>
<h2>The hall's acoustics at the start</h2>
<p>Figures of ISO 3382 by octave band, each with the half width of its 95 % interval, from {listen['rays']:,} rays in {listen['seconds']:.1f} s.
Octaves below the hall's Schroeder frequency, {listen["sources"][0]["schroeder_hz"]:.0f} Hz, are grey: there a hall has single modes, of which rays know
nothing.</p>
{decay}
{"".join(figures(source) for source in listen["sources"])}
<h2>How it was made</h2>
<ol><li><code>rtsg serve hall.x3dv --record session.rlog</code>: runs the scene in real time and publishes every frame as one change set.</li>
<li><code>rtsg mirror tcp://127.0.0.1:… --render … --listen …</code>: another process; a snapshot, then frames, into a replica
that the light tracer and the acoustic tracer follow. After each frame the replica's state hash is compared with the origin's.</li>
<li><code>rtsg replay session.rlog --verify</code>, <code>--diff mirror.rlog</code>, <code>--seek … --render hall.jpg</code>,
<code>--render hall.mp4 --listen hall.mp4</code>.</li></ol>
<p>Beside this page, where it was made: <a href="session.rlog">session.rlog</a>, <a href="mirror.rlog">mirror.rlog</a>, <a href="replica.x3dv">replica.x3dv</a>
(the replica saved as a document), <a href="replica.wav">replica.wav</a>, and the JSON that this page was made from.</p>
</html>
"""
(out / "report.html").write_text(page)
print(f"\n  report    {out / 'report.html'}")
sys.exit(0 if good else 1)
