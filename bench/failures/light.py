"""Situations in which methods for light fail. Truths are closed forms for a small lamp above a plate, changed by what stands between."""
import math

from situation import Outcome, Situation

LAMP_RADIUS, LAMP_HEIGHT, RADIANCE = .05, 2.0, 10.0
BARE = math.pi * RADIANCE * LAMP_RADIUS**2 / LAMP_HEIGHT**2  # the irradiance of a sphere
# Incoherent reflection between the two surfaces of glass at normal incidence (Hecht, Optics, 9.6): T = (1-R)/(1+R).
PANE = 1 - 2 * .04 / 1.04

DARK = "ambientIntensity 0"
LAMP = (f"Transform {{ translation 0 0 {LAMP_HEIGHT} children Shape {{ appearance Appearance {{ material Material {{ diffuseColor 0 0 0 "
        f"emissiveColor 10 10 10 {DARK} }} }} geometry Sphere {{ radius {LAMP_RADIUS} }} }} }}\n")
POINT = "PointLight { location 0 0 2 intensity 1 attenuation 0 0 1 radius 100 }\n"
START = "NavigationInfo { headlight FALSE }\nViewpoint { position 0 -5 2.5 orientation 1 0 0 1.1 }\n"


def plate(size=4):
    return f"Shape {{ appearance Appearance {{ material Material {{ diffuseColor .5 .5 .5 {DARK} }} }} geometry Rectangle2D {{ size {size} {size} }} }}\n"


def glass(geometry, at="0 0 0", index=1.5):
    return (f"Transform {{ translation {at} children Shape {{ appearance Appearance {{ material Material {{ diffuseColor 0 0 0 transparency 1 {DARK} "
            f'metadata MetadataSet {{ name "RTSG" value [ MetadataFloat {{ name "refractiveIndex" value {index} }} ] }} }} }} geometry {geometry} }} }}\n')


def mirror(geometry, place):
    return (f"Transform {{ {place} children Shape {{ appearance Appearance {{ material Material {{ diffuseColor 0 0 0 {DARK} "
            f'metadata MetadataSet {{ name "RTSG" value [ MetadataFloat {{ name "reflectivity" value 1 }} ] }} }} }} geometry {geometry} }} }}\n')


def linear(value):
    """Light of a display value (IEC 61966-2-1)."""
    return value / 12.92 if value <= .04045 else ((value + .055) / 1.055)**2.4


def said_of(answer, warning):
    """What an answer of measure or render says of itself."""
    if answer is None:
        return warning
    for key, text in (("reached", "reached: false"), ("unreached", "unreached"), ("hidden_light", "hidden_light"), ("missing", "missing")):
        value = answer.get(key)
        if value is False or (value and key != "reached"):
            return text if value is False else f"{text}: {value:.3g}" if isinstance(value, float) else f"{text}: {value}"
    return warning


def measured(program, text, truth, tolerance=.05, at="0,0,0.0001,0,0,1", samples=1 << 20, seed=1, method="measure", **note):
    answer, warning = program.object("measure", program.scene(text), "--irradiance", at, "--error", .02, "--samples", samples, "--seed", seed, "--json")
    value = answer["irradiance"][1] if answer else None
    return Outcome(method, value, truth, tolerance, "E", said_of(answer, warning), **note)


def image_mean(program, text, method, *options, size="64x36"):
    """Mean radiance of a picture (linear), and what the program says of it."""
    picture = program.folder / "mean.exr"
    picture.unlink(missing_ok=True)
    answer, warning = program.object("render", program.scene(text), "-o", picture, "--size", size, "--integrator", method, "--json", "--color-space", "linear", *options)
    if not picture.exists():
        return None, warning
    return program.mean(picture), said_of(answer, warning)


def behind_things(program):
    side = LAMP_HEIGHT / (LAMP_HEIGHT**2 + 2.0**2)**1.5 * LAMP_HEIGHT**2 * BARE  # of the lamp's image, 2 m aside
    pane = glass("Box { size 4 4 .006 }", "0 0 1")
    wall = mirror("Rectangle2D { size 4 8 }", "translation 1 0 0 rotation 0 1 0 -1.5707963")
    yield Situation("light", "a bare lamp", "nothing: this is the control", "lamp's solid angle",
                    [measured(program, START + plate() + LAMP, BARE)], START + plate() + LAMP)
    panes = [measured(program, START + plate() + LAMP + pane, BARE * PANE, .08, seed=seed, method=f"measure, seed {seed}") for seed in (1, 2, 3)]
    yield Situation("light", "a lamp behind a pane", "a shadow ray to the lamp ends at the glass", "bare lamp times (1-R)/(1+R)", panes,
                    START + plate() + LAMP + pane)
    bulb = glass("Sphere { radius .12 }", "0 0 2") + glass("Sphere { radius .115 }", "0 0 2", 1)
    yield Situation("light", "a lamp in a glass bulb", "glass all around: no ray finds a small lamp by chance", "bare lamp times (1-R)/(1+R)",
                    [measured(program, START + plate() + LAMP + bulb, BARE * PANE, .1)], START + plate() + LAMP + bulb)
    yield Situation("light", "a lamp in a mirror", "its second way is by the mirror alone", "lamp and its image",
                    [measured(program, START + plate() + LAMP + wall, BARE + side, .05)], START + plate() + LAMP + wall)
    point = math.pi / LAMP_HEIGHT**2
    yield Situation("light", "a point light in a mirror", "no ray meets a point by chance", "light and its image",
                    [measured(program, START + plate() + POINT + wall, point + side / BARE * point, .05)], START + plate() + POINT + wall)
    ball = glass("Sphere { radius .3 }", "0 0 1")
    yield Situation("light", "a caustic of a point light", "a ball of glass gathers a point light on the plate: no ray meets a point by chance",
                    "more light than without the ball (a lower bound)",
                    [measured(program, START + plate() + POINT + ball, point, .0, note="truth is above this")], START + plate() + POINT + ball)


def many_and_small(program):
    count = 100
    lights, truth = [], 0.0
    for i in range(count):
        for k in range(count):
            x, y = (i + .5 - count / 2) * .04, (k + .5 - count / 2) * .04
            lights.append(f"PointLight {{ location {x:.4f} {y:.4f} 2 intensity .0001 attenuation 0 0 1 radius 100 global TRUE }}\n")
            truth += math.pi * .0001 * 2 / (x * x + y * y + 4)**1.5
    yield Situation("light", "10,000 lamps", "a loop over all lamps takes too long; choosing among them is noise", "sum over the lamps",
                    [measured(program, START + plate() + "".join(lights), truth, .05)])
    hole, height = .02, 1.0
    lid = []
    for dx, dy, sx, sy in ((-1.005, 0, 1.99, 4), (1.005, 0, 1.99, 4), (0, -1.005, .02, 1.99), (0, 1.005, .02, 1.99)):
        lid.append(f"Transform {{ translation {dx} {dy} {height} children Shape {{ appearance Appearance {{ material Material {{ diffuseColor 0 0 0 {DARK} }} }} "
                   f"geometry Box {{ size {sx} {sy} .0002 }} }} }}\n")
    glow = (f"Transform {{ translation 0 0 2 rotation 1 0 0 3.14159265 children Shape {{ appearance Appearance {{ material Material {{ diffuseColor 0 0 0 "
            f"emissiveColor 10 10 10 {DARK} }} }} geometry Rectangle2D {{ size 3 3 }} }} }}\n")
    keyhole = START + plate() + glow + "".join(lid)
    yield Situation("light", "a keyhole", "one sample in 10,000 to the panel passes through the hole", "radiance times the hole's solid angle",
                    [measured(program, keyhole, RADIANCE * hole * hole / height**2, .1, samples=1 << 22)])
    leaves = "".join(f"Transform {{ translation 0 0 {1 + i * .01:.2f} children Shape {{ appearance Appearance {{ material Material {{ diffuseColor 0 0 0 {DARK} "
                     f"transparency .9 }} }} geometry Rectangle2D {{ size 4 4 solid FALSE }} }} }}\n" for i in range(40))
    yield Situation("light", "40 clear leaves", "every ray meets 40 surfaces, and each takes a tenth", ".9 to the power of 40",
                    [measured(program, START + plate() + LAMP + leaves, BARE * .9**40, .05)])


def scales(program):
    for name, factor in (("a dim lamp (a billionth)", 1e-9), ("a bright lamp (a billion)", 1e9)):
        text = START + plate() + LAMP.replace("10 10 10", f"{10 * factor:g} {10 * factor:g} {10 * factor:g}")
        yield Situation("light", name, "floors and thresholds that are not relative", "bare lamp, scaled (below 1 a colour is a display value)",
                        [measured(program, text, BARE * (factor if factor > 1 else linear(10 * factor) / 10))])
    for name, factor in (("a room of a tenth of a millimetre", 1e-4), ("a room of 100 km", 1e5)):
        text = START + f"Transform {{ scale {factor} {factor} {factor} children [ {plate()} {LAMP} ] }}\n"
        yield Situation("light", name, "offsets from surfaces in metres", "bare lamp: it does not depend on the scale",
                        [measured(program, text, BARE, at=f"0,0,{.0001 * factor:g},0,0,1")])
    for distance in (1e4, 1e6, 1e8):
        text = START + f"Transform {{ translation {distance:g} 0 0 children [ {plate()} {LAMP} ] }}\n"
        yield Situation("light", f"{distance:g} m from the origin", "single precision: a lamp of 5 cm has few bits left", "bare lamp",
                        [measured(program, text, BARE, at=f"{distance:.0f},0,0.01,0,0,1")])


def surfaces(program):
    look = "NavigationInfo { headlight FALSE }\nViewpoint { position 0 0 3 fieldOfView .4 }\n"

    def glowing(colour, extra=""):
        return f"Shape {{ appearance Appearance {{ material Material {{ diffuseColor 0 0 0 emissiveColor {colour} {DARK} }} }} geometry Rectangle2D {{ size 4 4 }} {extra} }}\n"

    together = look + glowing(".2 .2 .2") + glowing("1 1 1")
    outcomes = []
    for method in ("whitted", "path"):
        value, said = image_mean(program, together, method, "--spp", 4)
        nearest = min((linear(.2), 1.0), key=lambda shown: abs(shown - (value or 0)))
        outcomes.append(Outcome(method, value, nearest, .001, "L", said, "one of the two, everywhere"))
    yield Situation("light", "faces that coincide", "which is in front is decided by rounding: spots", "one of the two faces, everywhere", outcomes)
    furnace = ("NavigationInfo { headlight FALSE }\nViewpoint { position 0 0 3 fieldOfView .2 }\n"
               "EnvironmentLight { intensity 1 color 1 1 1 global TRUE }\nBackground { skyColor 1 1 1 }\n"
               "Shape { appearance Appearance { material PhysicalMaterial { baseColor 1 1 1 metallic 1 roughness %s } } geometry Sphere { radius 1 } }\n")
    for roughness in (.1, .6, 1.0):
        value, said = image_mean(program, furnace % roughness, "path", "--spp", 256, "--shadows", "none")
        yield Situation("light", f"a white metal of roughness {roughness:g} under a white sky", "a microfacet model of single scattering loses light",
                        "1: it reflects all, and all around is 1", [Outcome("path", value, 1.0, .03, "L", said)])
    room = ("NavigationInfo { headlight FALSE }\nViewpoint { position 0 0 0 }\nShape { appearance Appearance { material Material { diffuseColor .9 .9 .9 "
            f"emissiveColor .1 .1 .1 {DARK} }} }} geometry Box {{ size 4 4 4 solid FALSE }} }}\n")
    value, said = image_mean(program, room, "path", "--spp", 256)
    yield Situation("light", "a furnace of glowing walls", "light comes after many bounces", "emission / (1 - reflectance)",
                    [Outcome("path", value, linear(.1) / (1 - linear(.9)), .03, "L", said)])
    slivers = "".join(f"{i * 1e-7:.9f} -1 {i % 2} {i * 1e-7 + 1e-8:.9f} 1 {i % 2} {i * 1e-7:.9f} 1 {i % 2}, " for i in range(50))
    broken = (START + plate() + LAMP + f"Shape {{ appearance Appearance {{ material Material {{ }} }} geometry TriangleSet {{ solid FALSE coord Coordinate {{ point [ {slivers} "
              "5 5 5, 5 5 5, 5 5 5, 6 6 6, 7 7 7, 8 8 8 ] } } }\n")
    yield Situation("light", "triangles without area", "normals of zero length, hits at NaN", "bare lamp, but for slivers of a millionth",
                    [measured(program, broken, BARE, .05)])


def situations(program):
    for group in (behind_things, many_and_small, scales, surfaces):
        yield from group(program)
