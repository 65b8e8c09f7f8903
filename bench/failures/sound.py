"""Situations in which methods for sound fail. Truths are closed forms, or energy balance."""
import math

from situation import Outcome, Situation

BAND = 5  # 1 kHz among the octaves from 31.5 Hz


def look(absorption, diffuse=.5):
    rest = 1 - absorption
    return (f"appearance Appearance {{ material Material {{ }} acousticProperties AcousticProperties {{ absorption {absorption:g} diffuse {rest * diffuse:.4f} "
            f"specular {rest * (1 - diffuse):.4f} }} }}")


def box(low, high, absorption, solid="FALSE", diffuse=.5):
    middle, size = ([(a + b) / 2 for a, b in zip(low, high)], [b - a for a, b in zip(low, high)])
    return (f"Transform {{ translation {middle[0]:g} {middle[1]:g} {middle[2]:g} children Shape {{ {look(absorption, diffuse)} "
            f"geometry Box {{ size {size[0]:g} {size[1]:g} {size[2]:g} solid {solid} }} }} }}\n")


def sheet(corners, absorption, diffuse=.5):
    points = ", ".join(" ".join(f"{x:g}" for x in corner) for corner in corners)
    faces = " ".join(f"{i} {i + 1} {i + 2} {i + 3} -1" for i in range(0, len(corners), 4))
    return (f"Shape {{ {look(absorption, diffuse)} geometry IndexedFaceSet {{ solid FALSE coordIndex [ {faces} ] coord Coordinate {{ point [ {points} ] }} }} }}\n")


def source(at):
    return (f"Transform {{ translation {at[0]:g} {at[1]:g} {at[2]:g} children Sound {{ minFront 1000 minBack 1000 maxFront 2000 maxBack 2000 spatialize TRUE "
            'source AudioClip { loop TRUE url "data:audio/wav;base64,UklGRiYAAABXQVZFZm10IBAAAAABAAEAgD4AAAB9AAACABAAZGF0YQIAAAD/fw==" } } }\n')


def listener(at):
    return f"Viewpoint {{ position {at[0]:g} {at[1]:g} {at[2]:g} }}\n"


def figures(program, text, *options):
    """The figures of the first source, and what the program says beside them."""
    answer, said = program.object("listen", program.scene(text), "--metrics", "--temperature", 20, *options)
    if not answer or not answer.get("sources"):
        return None, said
    first = answer["sources"][0]
    if not said and first["escaped"][BAND] > .01:
        said = f"escaped: {first['escaped'][BAND]:.2f}"
    if not said and first["two_slopes"][BAND]:
        said = f"two_slopes: true, late_slope_s: {first['late_slope_s'][BAND]:.2f}"
    return first, said


def value_of(first, key):
    if first is None:
        return None
    found = first[key]
    return found[BAND] if isinstance(found, list) else found


def eyring(volume, surface, absorption, air=.00107):
    """T60 by Eyring's formula with ISO 9613-1's loss in air (20 C, 50 %, 1 kHz: 4.66 dB/km)."""
    return 24 * math.log(10) / 343.2 * volume / (-surface * math.log(1 - absorption) + 4 * air * volume)


def rooms(program):
    room = box((0, 0, 0), (8, 6, 7), .1, diffuse=.9)
    first, said = figures(program, listener((6, 1.7, 5)) + room + source((2, 1.5, 2)))
    yield Situation("sound", "a diffuse room", "nothing: this is the control", "Eyring with loss in air",
                    [Outcome("listen --metrics, T20", value_of(first, "T20_s"), eyring(336, 292, .1), .05, "s", said)])
    tiny = box((0, 0, 0), (.9, .8, 1), .05)
    first, said = figures(program, listener((.6, .4, .7)) + tiny + source((.2, .3, .2)))
    outcome = Outcome("listen --metrics, Schroeder's frequency", value_of(first, "schroeder_hz"), 2000 * math.sqrt(eyring(.72, 4.84, .05) / .72), .1, "Hz", said,
                      "figures below it are of rays where there are modes")
    yield Situation("sound", "a box of a metre", "rays where single modes ring", "2000 sqrt(T/V)", [outcome])
    coupled = (sheet([(0, 0, 0), (0, 0, 8), (8, 0, 8), (8, 0, 0), (0, 5, 0), (8, 5, 0), (8, 5, 8), (0, 5, 8), (0, 0, 0), (0, 5, 0), (0, 5, 8), (0, 0, 8),
                                (0, 0, 0), (8, 0, 0), (8, 5, 0), (0, 5, 0), (0, 0, 8), (0, 5, 8), (8, 5, 8), (8, 0, 8),
                                (8, 0, 0), (8, 0, 7), (8, 5, 7), (8, 5, 0), (8, 2, 7), (8, 2, 8), (8, 5, 8), (8, 5, 7)], .02, .9)
               + sheet([(8, 0, 0), (8, 0, 8), (14, 0, 8), (14, 0, 0), (8, 5, 0), (14, 5, 0), (14, 5, 8), (8, 5, 8), (14, 0, 0), (14, 0, 8), (14, 5, 8), (14, 5, 0),
                        (8, 0, 0), (14, 0, 0), (14, 5, 0), (8, 5, 0), (8, 0, 8), (8, 5, 8), (14, 5, 8), (14, 0, 8)], .5, .9))
    first, said = figures(program, listener((12, 1.7, 3)) + coupled + source((10, 1.5, 5)))
    late = value_of(first, "late_slope_s")
    outcome = Outcome("listen --metrics, late slope", late, eyring(320, 288, .02 + 2 / 288 * .8), .25, "s", said, "T20 is of neither slope")
    yield Situation("sound", "a dead room beside a lively one", "one figure for a decay of two slopes", "Eyring for the lively room with its door", [outcome])
    opened = sheet([(0, 0, 0), (0, 0, 6), (8, 0, 6), (8, 0, 0), (0, 0, 0), (8, 0, 0), (8, 5, 0), (0, 5, 0)], .05)
    first, said = figures(program, listener((6, 1.7, 4)) + opened + source((2, 1.5, 2)))
    yield Situation("sound", "a floor and one wall outdoors", "a reverberation time where nothing reverberates", "there is none",
                    [Outcome("listen --metrics, T20", value_of(first, "T20_s"), None, 0, "s", said)])
    anechoic = box((0, 0, 0), (5, 5, 5), 1)
    first, said = figures(program, listener((3, 1.7, 4)) + anechoic + source((2, 1.5, 2)))
    yield Situation("sound", "a room that absorbs all", "a slope of nothing", "there is none", [Outcome("listen --metrics, T20", value_of(first, "T20_s"), None, 0, "s", said)])


def places(program):
    room = box((0, 0, 0), (8, 6, 7), .1)
    solid = box((3, 0, 3), (5, 6, 5), .1, "TRUE")
    for name, at, ear in (("a source in a solid", (4, 1.5, 4), (1, 1.7, 1)), ("an ear in a solid", (1, 1.5, 1), (4, 1.7, 4))):
        first, said = figures(program, listener(ear) + room + solid + source(at))
        yield Situation("sound", name, "rays that start inside meet faces from behind", "none: nothing passes through",
                        [Outcome("listen --metrics, G", value_of(first, "G_db"), None, 0, "dB", said)])
    closed = box((0, 0, 0), (4, 3, 4), .1) + box((4.2, 0, 0), (8, 3, 4), .1)
    first, said = figures(program, listener((6, 1.7, 2)) + closed + source((2, 1.5, 2)))
    yield Situation("sound", "a wall between source and ear", "no path: figures of nothing", "none",
                    [Outcome("listen --metrics, G", value_of(first, "G_db"), None, 0, "dB", said)])
    first, said = figures(program, listener((2, 1.5, 2)) + room + source((2, 1.5, 2)))
    yield Situation("sound", "an ear in its source", "1/r at r = 0", "a finite G", [Outcome("listen --metrics, G is finite", float(math.isfinite(value_of(first, "G_db") or math.inf)), 1, 0, "", said)])
    # Maekawa (1968) with Kurze and Anderson's formula; a screen of 3 m, 5 m to each side, on the ground that absorbs.
    ground = sheet([(-200, 0, -200), (-200, 0, 200), (200, 0, 200), (200, 0, -200)], 1)
    screen = sheet([(-100, 0, 0), (100, 0, 0), (100, 3, 0), (-100, 3, 0)], 1)
    here, there = (0, 1, -5), (0, 1, 5)
    free, _ = figures(program, listener(there) + ground + source(here))
    behind, said = figures(program, listener(there) + ground + screen + source(here))
    straight, none = figures(program, listener(there) + ground + screen + source(here), "--diffraction", 0)
    longer = 2 * math.hypot(5, 2) - 10
    fresnel = 2 * longer * 1000 / 343.2
    argument = math.sqrt(2 * math.pi * fresnel)
    loss = 5 + 20 * math.log10(argument / math.tanh(argument))
    heard = value_of(free, "G_db") - value_of(behind, "G_db") if free and behind and value_of(behind, "G_db") is not None else None
    yield Situation("sound", "a thin screen outdoors", "rays stop at edges", "Kurze and Anderson's formula of Maekawa's chart",
                    [Outcome("listen --metrics, loss", heard, loss, 4, "dB", said, "a chart of measurements: 3 dB"),
                     Outcome("--diffraction 0, G", value_of(straight, "G_db"), None, 0, "dB", none, "nothing bends")])


def gallery(program):
    """A whispering gallery: grazing reflections along a round wall, which rays of one seed find and others miss."""
    n, radius = 48, 10.0
    corners = []
    for i in range(n):
        a, b = 2 * math.pi * i / n, 2 * math.pi * (i + 1) / n
        x, z, u, w = radius * math.cos(a), radius * math.sin(a), radius * math.cos(b), radius * math.sin(b)
        corners += [(x, 0, z), (u, 0, w), (u, 3, w), (x, 3, z)]
    wall = sheet(corners, .02, .02)
    place, ear = (9.6, 1.5, 0), (-9.6, 1.5, 0)
    values = []
    for rays in (20000, 400000):
        first, said = figures(program, listener(ear) + wall + source(place), "--rays", rays)
        values.append((value_of(first, "G_db"), said, first))
    half_width = values[0][2]["ci95"]["G_db"][BAND] if values[0][2] else None
    yield Situation("sound", "a whispering gallery", "energy in few grazing paths: few rays find them", "20 times the rays",
                    [Outcome("listen --metrics, G", values[0][0], values[1][0], max(1.0, half_width or 0), "dB", values[0][1], f"+-{half_width:.2f} told" if half_width else "")])


def situations(program):
    for group in (rooms, places, gallery):
        yield from group(program)
