#!/usr/bin/env python3
"""Is docs/nodes.md true of the node tables and of the behaviours that there are?

Every node type that acts, by the @acts tags of core/spec, has one row there. A row that says "runs" must name a type that
the core has a behaviour for, or one of ELSEWHERE; a row that says "holds" one that has none. Where a clause names the node's own section (9.4.2),
it is the one of its place: sections stand in the order of the alphabet within a component.
Exit status 1, a line for each row at fault.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent.parent)
BEHAVIOURS = ("behaviour", "sensors", "animation")  # rooms of core that have behaviours
# Types that act in another way than by a behaviour of theirs, and the file that has it.
ELSEWHERE = {"Anchor": "core/src/sensors/pointing.cpp", "Script": "scripts/src/engine/engine.cpp", "Inline": "documents/src/build/inline.cpp",
             "InlineGeometry": "documents/src/build/inline_geometry.cpp",
             "FontLibrary": "documents/src/media/font_reports.cpp", "Text": "renderers/geometry/src/text", "Analyser": "audio/src", "AudioClip": "audio/src", "AudioDestination": "audio/src",
             "BiquadFilter": "audio/src", "BufferAudioSource": "audio/src", "ChannelMerger": "audio/src",
             "ChannelSelector": "audio/src", "ChannelSplitter": "audio/src", "Convolver": "audio/src", "Delay": "audio/src",
             "DynamicsCompressor": "audio/src", "Gain": "audio/src", "ListenerPointSource": "audio/src",
             "OscillatorSource": "audio/src", "StreamAudioDestination": "audio/src", "StreamAudioSource": "audio/src", "WaveShaper": "audio/src",
             "OscillatorSource": "audio/src", "StreamAudioSource": "audio/src", "WaveShaper": "audio/src",
             **{name: "physics/src/engine" for name in (
                 "BallJoint", "CollidableOffset", "CollidableShape", "CollisionSensor", "DoubleAxisHingeJoint", "MotorJoint", "RigidBody",
                 "RigidBodyCollection", "SingleAxisHingeJoint", "SliderJoint", "UniversalJoint")},
             "TextureProjector": "renderers/light/src/tables", "TextureProjectorParallel": "renderers/light/src/tables"}


def tables():
    """Concrete type -> when it acts."""
    types = {}
    for path in sorted((ROOT / "core" / "spec").glob("*.x3dspec")):
        for line in path.read_text().splitlines():
            head = re.match(r"(abstract|node) (\w+)(?: : (.*?))?(?: level .*| @.*)?$", line)
            if head:
                acts = re.search(r"@acts\((\w+)\)", line)
                bases = [base.strip() for base in (head[3] or "").split(",") if base.strip()]
                types[head[2]] = (head[1], bases, acts[1] if acts else None)

    def acts(name):
        _, bases, own = types.get(name, (None, [], None))
        return own or next((found for found in map(acts, bases) if found), None)

    return {name: acts(name) for name, (kind, _, _) in types.items() if kind == "node"}


def places():
    """Concrete type -> its place among those of its component, from 1."""
    components, component = {}, None
    for path in sorted((ROOT / "core" / "spec").glob("*.x3dspec")):
        for line in path.read_text().splitlines():
            head = re.match(r"(component|node) (\w+)", line)
            if head and head[1] == "component":
                component = head[2]
            elif head and "@since(4.1)" not in line:
                components.setdefault(component, []).append(head[2])
    return {name: place for names in components.values() for place, name in enumerate(sorted(names), 1)}


def behaviours():
    found = set()
    for path in (path for room in BEHAVIOURS for path in (ROOT / "core" / "src" / room).glob("*.cpp")):
        text = path.read_text()
        if path.name != "mobility.cpp":
            found |= set(re.findall(r"(?:push_back\(\{|add\(|bindable<)x3d::(\w+)", text))
        for listed in re.findall(r"append<\w+,([^>]*)>", text):
            found |= set(re.findall(r"x3d::(\w+)", listed))
    return found


def main():
    acting = {name for name, acts in tables().items() if acts in ("always", "onInput")}
    runs = behaviours()
    faults, listed, place = [], {}, places()
    path = ROOT / "docs" / "nodes.md"
    for number, line in enumerate(path.read_text().splitlines(), 1):
        row = re.match(r"\| (\w+) \| ([\w.]+) \| (runs|holds)\b", line)
        if not row:
            continue
        name, clause, does = row.groups()
        section = re.fullmatch(r"\d+\.4\.(\d+)", clause)
        if section and int(section[1]) != place.get(name):
            faults.append(f"{path}:{number}: {name} is number {place.get(name)} of its component, not {section[1]}")
        if name in listed:
            faults.append(f"{path}:{number}: {name} is there twice")
        listed[name] = does
        there = name in runs or (name in ELSEWHERE and (ROOT / ELSEWHERE[name]).exists())
        if name not in acting and name not in runs:
            faults.append(f"{path}:{number}: {name} is no type that acts")
        elif there != (does == "runs"):
            faults.append(f"{path}:{number}: {name} {'has' if there else 'has no'} behaviour")
    faults += [f"{path}: {name} is missing" for name in sorted(acting - set(listed))]
    print("\n".join(faults) or f"{len(listed)} types, {sum(does == 'runs' for does in listed.values())} of them run")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
