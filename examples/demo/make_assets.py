#!/usr/bin/env python3
"""Makes the demo's textures and sounds; Python's standard library only, same bytes every time.

The results are kept beside this script, so that hall.x3dv works on its own.
"""
import math
import random
import struct
import wave
import zlib
from pathlib import Path

HERE = Path(__file__).resolve().parent


def write_png(name, width, height, pixel):
    rows = b"".join(
        b"\0" + bytes(max(0, min(255, round(v))) for x in range(width) for v in pixel(x, y)) for y in range(height))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    (HERE / name).write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
        chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))


def noise(seed, cells, size):
    """Smooth value noise in [0, 1] that repeats after `size` pixels."""
    rng = random.Random(seed)
    grid = [[rng.random() for _ in range(cells)] for _ in range(cells)]

    def at(x, y):
        u, v = x * cells / size, y * cells / size
        i, j = int(u), int(v)
        fu, fv = u - i, v - j
        fu, fv = fu * fu * (3 - 2 * fu), fv * fv * (3 - 2 * fv)
        g = lambda a, b: grid[a % cells][b % cells]
        top = g(i, j) * (1 - fu) + g(i + 1, j) * fu
        bottom = g(i, j + 1) * (1 - fu) + g(i + 1, j + 1) * fu
        return top * (1 - fv) + bottom * fv

    return at


def marble(size=256):
    """Two by two tiles, light and dark, with veins and a joint between them."""
    broad, fine = noise(1, 6, size), noise(2, 23, size)

    def pixel(x, y):
        dark = (x < size // 2) != (y < size // 2)
        vein = abs(math.sin((x + y) * math.pi / 64 + 7 * broad(x, y) + 2 * fine(x, y))) ** 8
        base = (58, 52, 56) if dark else (214, 205, 190)
        gain = 1 + (0.7 if dark else -0.22) * vein + 0.14 * (fine(x, y) - 0.5)
        joint = min(x % (size // 2), y % (size // 2)) < 2
        return tuple(c * gain * (0.45 if joint else 1) for c in base)

    write_png("marble.png", size, size, pixel)


def wood(size=256):
    """Boards along y, each with a grain of its own."""
    broad, fine = noise(3, 5, size), noise(4, 40, size)

    def pixel(x, y):
        board = x // 64
        grain = 0.5 + 0.5 * math.sin((x * 0.32 + 5 * broad((x + 61 * board) % size, y // 3 % size)) * 2)
        gain = 0.72 + 0.2 * grain + 0.12 * fine(x, y) + 0.05 * (board % 2)
        if x % 64 < 2:
            gain *= 0.4
        return (146 * gain, 92 * gain, 52 * gain)

    write_png("wood.png", size, size, pixel)


def write_wav(name, samples, rate=24000):
    peak = max(abs(s) for s in samples)
    with wave.open(str(HERE / name), "wb") as out:
        out.setnchannels(1)
        out.setsampwidth(2)
        out.setframerate(rate)
        out.writeframes(b"".join(struct.pack("<h", round(s / peak * 29000)) for s in samples))


def chimes(rate=24000):
    """Four bells of a pentatonic scale; dry, so that the hall can be heard. Ends where it begins."""
    length = 2 * rate
    out = [0.0] * length
    for k, note in enumerate((587.33, 880.0, 659.26, 987.77)):
        start = k * length // 4
        for i in range(length):
            t = i / rate
            strike = min(1.0, t / 0.004)
            value = sum(a * math.sin(2 * math.pi * note * r * t) * math.exp(-d * t)
                        for a, r, d in ((1, 1, 5), (0.5, 2.76, 9), (0.25, 5.4, 14)))
            out[(start + i) % length] += strike * value
    write_wav("chimes.wav", out, rate)


def motor(rate=24000):
    """A small clockwork engine: twelve ticks a second over a hum. Ends where it begins."""
    rng = random.Random(5)
    length = rate
    out = []
    for i in range(length):
        t = i / rate
        tick = math.exp(-180 * (t * 12 % 1) / 12) * (rng.random() * 2 - 1)
        hum = 0.35 * math.sin(2 * math.pi * 110 * t) + 0.2 * math.sin(2 * math.pi * 220 * t + 1)
        out.append(tick + hum)
    write_wav("motor.wav", out, rate)


if __name__ == "__main__":
    marble()
    wood()
    chimes()
    motor()
