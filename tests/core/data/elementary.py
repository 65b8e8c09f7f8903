#!/usr/bin/env python3
"""Writes elementary.txt beside itself: arguments of the functions of rtsg/core/portable_math.h, and what these are by mpmath with 200 bits.

A line has the function, its one or two arguments, and the result as two doubles: the nearest, and the nearest to what is then missing. The
arguments are random ones over the whole domain, the ends of the domain, multiples of a quarter turn as near as doubles come, and those of 2,000
whose results lie nearest to the middle between two doubles. Needs mpmath (python3-mpmath); the file is the same on every run.
"""
import math
import pathlib
import random
import sys

from mpmath import mp, mpf

mp.prec = 200
LARGEST, LEAST = sys.float_info.max, 5e-324
ONE = {name: getattr(mp, name) for name in ("sin", "cos", "tan", "asin", "acos", "atan", "exp", "expm1", "log", "log1p", "sinh", "cosh", "tanh", "asinh",
                                            "acosh", "atanh")}
ONE["cbrt"] = lambda x: mp.sign(x) * mp.cbrt(abs(x))
ONE["log2"] = lambda x: mp.log(x) / mp.log(2)
ONE["log10"] = lambda x: mp.log(x) / mp.log(10)
TWO = {"atan2": mp.atan2, "pow": mp.power, "hypot": mp.hypot}
# Where most of the interest lies; the domain beyond which there is no finite result; and points of the domain that are apart.
RANGES = {"sin": (-10, 10), "cos": (-10, 10), "tan": (-10, 10), "asin": (-1, 1), "acos": (-1, 1), "atan": (-4, 4), "exp": (-745.1, 709.7),
          "expm1": (-38, 709.7), "log": (LEAST, 20), "log1p": (-1 + 2**-53, 20), "log2": (LEAST, 20), "log10": (LEAST, 20), "sinh": (-710, 710),
          "cosh": (-710, 710), "tanh": (-22, 22), "asinh": (-20, 20), "acosh": (1, 20), "atanh": (-1 + 2**-53, 1 - 2**-53), "cbrt": (-8, 8)}
WIDE = {"sin", "cos", "tan", "atan", "log", "log1p", "log2", "log10", "asinh", "acosh", "cbrt"}  # up to the largest number
QUARTERS = [1, 2, 3, 5, 101, 1000003, 2**20 - 1, 2**31 + 1, 10**15, 2**60 + 3]


def exact(function, *arguments):
    precision = mp.prec
    # What cancels inside of mpmath must not count, and no result may be between two because of that.
    mp.prec = 1400 if abs(arguments[0]) > 1e15 else 500
    try:
        value = function(*(mpf(a) for a in arguments))
    finally:
        mp.prec = precision
    return +value


def split(value):
    """The nearest double, and the nearest to the rest."""
    high = float(value)  # rounds to nearest, subnormal numbers too
    return high, float(value - mpf(high)) if math.isfinite(high) else 0.0


def middleness(value):
    """How far from the middle between two doubles, in units of the last place."""
    high, low = split(value)
    return abs(abs(low) / math.ulp(high) - .5) if math.isfinite(high) and high else 1


def arguments(name, chance):
    low, high = map(float, RANGES[name])
    inside = lambda: chance.uniform(low, high)
    far = lambda: math.ldexp(chance.uniform(.5, 1), chance.randrange(-1000, 1020)) * (1 if low >= 0 or name == "log1p" else chance.choice((-1, 1)))
    near = lambda: max(low, min(high, math.ldexp(chance.uniform(-1, 1), -chance.randrange(0, 40)) + (1 if name.startswith("log") and name != "log1p" else 0)))
    points = {low, high, .5, 1.0, math.nextafter(1, 2), 1e-5, 2**-28, 2**-30, 1e-300} | ({0.1, 0.3, 2.0} if high > 2 else set())
    if low < 0:
        points |= {-p for p in points if -p >= low} | {LEAST, -.5}
    if name in WIDE:
        points |= {LARGEST, 1e22, 2.0**40, 1e5} | {far() for _ in range(10)}
    if name in ("sin", "cos", "tan"):
        points |= {float(k * mp.pi / 2) for k in QUARTERS} | {math.ldexp(6381956970095103, 797), -math.ldexp(6381956970095103, 797), math.ldexp(1, 1000)}
    points |= {inside() for _ in range(10)} | {near() for _ in range(8)}
    many = [inside() for _ in range(1000)] + [near() for _ in range(1000)]
    hardest = sorted((middleness(exact(ONE[name], x)), x) for x in many if low <= x <= high)[:8]
    return sorted({x for x in points if low <= x <= high or name in WIDE and x > low} | {x for _, x in hardest})


def pairs(name, chance):
    any_ = lambda: math.ldexp(chance.uniform(-1, 1), chance.randrange(-40, 40))
    found = [(any_(), any_()) for _ in range(40)] + [(1.5, 2.0), (-3.0, 3.0), (1e-310, 1e-300), (1e300, 1e299), (1e-200, 1e200), (-2.0, -1e-160)]
    if name == "pow":
        found = [(abs(a), b) for a, b in found]
        for _ in range(40):
            base = math.ldexp(chance.uniform(.5, 1), chance.randrange(-1000, 1000))
            found.append((base, chance.uniform(-745, 709) / math.log(base)))
        for _ in range(20):
            base = 1 + math.ldexp(chance.uniform(-1, 1), -chance.randrange(1, 50))
            if base != 1:
                found.append((base, chance.uniform(-745, 709) / math.log(base)))
        found += [(-3.0, 5.0), (-1.5, -3.0), (10.0, 308.0), (10.0, -323.0), (2.0, -1074.0), (LEAST, .25)]
        found = [(a, b) for a, b in found if b and a and (a == 1 or abs(b * math.log(abs(a))) < 744)]
    return found


def main():
    lines = []
    for name in ONE:
        for x in arguments(name, random.Random(name)):
            lines.append((name, (x,), split(exact(ONE[name], x))))
    for name in TWO:
        for pair in pairs(name, random.Random(name)):
            lines.append((name, pair, split(exact(TWO[name], *pair))))
    lines = [line for line in lines if math.isfinite(line[2][0])]
    path = pathlib.Path(__file__).with_suffix(".txt")
    path.write_text("".join(" ".join((name, *(value.hex() for value in (*given, *result)))) + "\n" for name, given, result in lines))
    print(f"{path}: {len(lines)} lines, {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
