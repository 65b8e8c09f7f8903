#!/usr/bin/env python3
"""Files that nest without end, or that hold one thing without end: each verb ends with status 0 or 1, and never by a signal.

usage: hostile_files.py --program RTSG [--deep N] [--stack KB] [--kinds REGEX] [--growth [N]]

Without --deep and --stack it is 5,000 deep with 256 KB; in the long form (RTSG_LONG) a million with the 8 MB that are usual.

Each kind of nesting is written N deep, and read by `info`, `validate`, `convert`, `render` and more, each with a stack of KB kilobytes. Status 1
needs an error on the last lines. With --growth each kind of repetition is written N and 2 N times, and the CPU time of `validate` is compared:
more than 2.3 times as much is a fault. Exit status 1 and a line for each fault.
"""
import argparse
import json
import os
import pathlib
import re
import resource
import subprocess
import sys
import tempfile

VRML = "#X3D V4.0 utf8\nPROFILE Full\n"
XML = '<X3D version="4.0" profile="Full"><Scene>{}</Scene></X3D>'
GLTF = {"asset": {"version": "2.0"}, "scene": 0}
TRIANGLE = '<source id="p"><float_array id="a" count="9">0 0 0 1 0 0 0 1 0</float_array><technique_common><accessor source="#a" count="3" ' \
    'stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>'
COLLADA = '<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset/><library_geometries>' \
    '<geometry id="g"><mesh>' + TRIANGLE + '<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="1">' \
    '<input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry></library_geometries><library_visual_scenes>' \
    '<visual_scene id="s">{}</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>'


def each(text, count, joint=""):
    return joint.join(text.replace("@", str(i)).replace("%", str(i - 1)) for i in range(1, count + 1))


def script(program):
    return VRML + 'DEF S Script { directOutput TRUE url "ecmascript:' + program.replace("\\", "\\\\").replace('"', '\\"') + '" }\n'


# What nests: the name of the file, and its text for a depth.
DEEP = {
    "nodes.x3d": lambda n: XML.format("<Group>" * n + "<Shape><Box/></Shape>" + "</Group>" * n),
    "nodes.x3dv": lambda n: VRML + "Group{children " * n + "Shape{geometry Box{}}" + "}" * n,
    "lists.wrl": lambda n: "#VRML V2.0 utf8\n" + "Group{children [" * n + "Shape{geometry Box{}}" + "]}" * n,
    "nodes.json": lambda n: '{"X3D":{"@version":"4.0","@profile":"Full","Scene":{"-children":[' + '{"Group":{"-children":[' * n + "]}}" * n + "]}}}",
    "arrays.json": lambda n: '{"X3D":{"@version":"4.0","@profile":"Full","Scene":{"-children":[{"Transform":{"@translation":' + "[" * n + "]" * n + "}}]}}}",
    "metadata.x3dv": lambda n: VRML + "Group{metadata " + "MetadataSet{value " * n + "MetadataString{}" + "}" * n + "}",
    "unknown.x3dv": lambda n: VRML + "Gruop{cihldren " * n + "}" * n,
    "switches.x3dv": lambda n: VRML + "Switch{whichChoice 0 children " * n + "Shape{geometry Box{}}" + "}" * n,
    "transforms.x3dv": lambda n: VRML + "Transform{rotation 0 1 0 .1 children " * n + "DEF B Shape{geometry Box{}}" + "}" * n,
    "braces.x3dv": lambda n: VRML + "Group{children Gruop{x " + "[" * n + "]" * n + "}}",
    "use.x3dv": lambda n: VRML + "DEF G0 Shape{geometry Box{}}\n" + each("DEF G@ Group{children USE G%}\n", n),
    "use_twice.x3dv": lambda n: VRML + "DEF G0 Shape{geometry Box{}}\n" + each("DEF G@ Group{children [USE G% USE G%]}\n", min(n, 3000)),
    "use.x3d": lambda n: XML.format('<Group DEF="G0"/>' + each('<Group DEF="G@"><Group USE="G%"/></Group>', n)),
    "routes.x3dv": lambda n: VRML + "DEF T0 BooleanToggle{}\n" + each("DEF T@ BooleanToggle{} ROUTE T%.toggle TO T@.toggle\n", n),
    "proto_bodies.x3dv": lambda n: VRML + "PROTO P0 [] {Group{}}\n" + each("PROTO P@ [] {P%{}}\n", n) + f"P{n}{{}}",
    "proto_declarations.x3dv": lambda n: VRML + "PROTO P [] {" * n + "Group{}" + "}" * n + "P{}",
    "proto_declarations.x3d": lambda n: XML.format('<ProtoDeclare name="P"><ProtoBody>' * n + "<Group/>" + "</ProtoBody></ProtoDeclare>" * n),
    "proto_defaults.x3dv": lambda n: VRML + "PROTO P [initializeOnly MFNode c " + "Group{children " * n + "}" * n + "] {Group{children IS c}} P{}",
    "proto_values.x3dv": lambda n: VRML + "PROTO P [inputOutput MFNode c []] {Group{children IS c}}\n" + "P{c " * n + "}" * n,
    "proto_body.x3dv": lambda n: VRML + "PROTO P [] {" + "Group{children " * n + "}" * n + "} P{}",
    "scripts.x3dv": lambda n: VRML + "Script{inputOutput SFNode s " * n + "NULL" + "}" * n,
    "inline.x3dv": lambda n: VRML + 'Inline{url "inline.x3dv"}',
    "extern.x3dv": lambda n: VRML + 'EXTERNPROTO E [] "extern.x3dv#E"\nE{}',
    "extern_chain.x3dv": lambda n: VRML + each('EXTERNPROTO E@ [] "extern_chain.x3dv#E%"\n', n) + f"E{n}{{}}",
    "entities.x3d": lambda n: '<!DOCTYPE X3D [<!ENTITY e0 "x">' + each('<!ENTITY e@ "&e%;">', n) + "]>" + XML.format(f'<WorldInfo title="&e{n};"/>'),
    "entities_before.x3d": lambda n: "<!DOCTYPE X3D [" + each('<!ENTITY e% "&e@;">', n) + f'<!ENTITY e{n} "x">]>' + XML.format('<WorldInfo title="&e0;"/>'),
    "entity_content.x3d": lambda n: '<!DOCTYPE X3D [<!ENTITY e0 "<Group/>">' + each('<!ENTITY e@ "<Group>&e%;</Group>">', n) + "]>" + XML.format(f"&e{n};"),
    "entity_defaults.x3d": lambda n: '<!DOCTYPE X3D [<!ENTITY e0 "x">' + each('<!ENTITY e@ "&e%;">', n) + f'<!ATTLIST Group DEF CDATA "&e{n};">]>' + XML.format("<Group/>"),
    "parameter_entities.x3d": lambda n: '<!DOCTYPE X3D [<!ENTITY % e0 "">' + "".join(f'<!ENTITY % e{i} "%e{i - 1};">' for i in range(1, n)) + f"%e{n - 1};]>" + XML.format(""),
    "content_model.x3d": lambda n: "<!DOCTYPE X3D [<!ELEMENT a " + "(" * n + "b" + ")" * n + ">]>" + XML.format(""),
    "divisions.html": lambda n: "<!DOCTYPE html><html><body>" + "<div>" * n + XML.format("<Group/>") + "</div>" * n + "</body></html>",
    "elements.urdf": lambda n: '<robot name="r"><link name="a">' + "<x>" * n + "</x>" * n + "</link></robot>",
    "links.urdf": lambda n: '<robot name="r"><link name="l0"/>' + each('<link name="l@"/><joint name="j@" type="revolute"><parent link="l%"/><child link="l@"/></joint>', min(n, 100000)) + "</robot>",
    "mimics.urdf": lambda n: '<robot name="r"><link name="l0"/>' + each('<link name="l@"/><joint name="j@" type="revolute"><parent link="l0"/><child link="l@"/><mimic joint="j%"/></joint>', min(n, 100000)) + "</robot>",
    "entities.urdf": lambda n: '<!DOCTYPE robot [<!ENTITY e0 "x">' + each('<!ENTITY e@ "&e%;">', n) + f']><robot name="&e{n};"><link name="a"/></robot>',
    "nodes.dae": lambda n: COLLADA.format("<node>" * n + '<instance_geometry url="#g"/>' + "</node>" * n),
    "elements.dae": lambda n: COLLADA.format("<node/>" + "<extra>" * n + "</extra>" * n),
    "nodes.gltf": lambda n: json.dumps({**GLTF, "scenes": [{"nodes": [0]}], "nodes": [{"children": [i + 1]} for i in range(n)] + [{}]}),
    "extras.gltf": lambda n: '{"asset":{"version":"2.0"},"scene":0,"scenes":[{}],"extras":' + "[" * n + "]" * n + "}",
    "objects.gltf": lambda n: '{"asset":{"version":"2.0"},"scene":0,"scenes":[{}],"extras":' + '{"a":' * n + "0" + "}" * n + "}",
    "script_objects.x3dv": lambda n: script(f"function initialize() {{ var a = []; for (var i = 0; i < {n}; ++i) a = [a]; print(a.length); JSON.stringify(a); }}"),
    "script_text.x3dv": lambda n: script(f"function initialize() {{ JSON.parse('['.repeat({n}) + ']'.repeat({n})); }}"),
    "script_program.x3dv": lambda n: script("function initialize() { return " + "(" * n + "1" + ")" * n + "; }"),
    "script_nodes.x3dv": lambda n: script(f"function initialize() {{ Browser.currentScene.rootNodes = Browser.createVrmlFromString('Group{{children '.repeat({n}) + '}}'.repeat({n})); }}"),
    "script_chain.x3dv": lambda n: script(f"function initialize() {{ var g = Browser.currentScene.createNode('Group'); for (var i = 0; i < {n}; ++i) {{ var h = Browser.currentScene.createNode('Group'); h.children = [g]; g = h; }} Browser.currentScene.addRootNode(g); }}"),
}

# What repeats.
MANY = {
    "attributes.x3d": lambda n: XML.format("<Group " + each('a@="@" ', n) + "/>"),
    "attributes_lines.x3d": lambda n: XML.format("<Group " + each('a@="@"\n', n) + "/>"),
    "bad_values.x3d": lambda n: XML.format("<Script>" + each('<field name="f@" type="SFInt32" accessType="initializeOnly" value="x"/>', n) + "</Script>"),
    "bad_elements.x3d": lambda n: XML.format(each('<Transform translation="x@"/>', n)),
    "unknown_nodes.x3d": lambda n: XML.format(each("<N@/>", n)),
    "unknown_nodes.x3dv": lambda n: VRML + each("N@{}\n", n),
    "unknown_fields.x3dv": lambda n: VRML + "Group{" + each("a@ @ ", n) + "}",
    "defs.x3dv": lambda n: VRML + each("DEF D@ Group{}", n),
    "one_line_errors.x3dv": lambda n: VRML + each("Group{a @}", n),
    "same_defs.x3dv": lambda n: VRML + each("DEF A Group{}\n", n),
    "routes.x3dv": lambda n: VRML + "DEF A BooleanToggle{}\n" + each("DEF B@ BooleanToggle{} ROUTE A.toggle TO B@.toggle\n", n),
    "routes_in.x3dv": lambda n: VRML + "DEF A BooleanToggle{}\n" + each("DEF B@ BooleanToggle{} ROUTE B@.toggle TO A.toggle\n", n),
    "same_routes.x3dv": lambda n: VRML + "DEF A BooleanToggle{} DEF B BooleanToggle{}\n" + each("ROUTE A.toggle TO B.toggle\n", n),
    "bad_routes.x3dv": lambda n: VRML + "DEF A Group{}\n" + each("ROUTE A.x@ TO A.y@\n", n),
    "script_fields.x3dv": lambda n: VRML + "Script{" + each("initializeOnly SFInt32 f@ 1\n", n) + "}",
    "script_nodes.x3dv": lambda n: VRML + "Script{" + each("initializeOnly SFNode f@ Group{}\n", n) + "}",
    "script_types.x3dv": lambda n: VRML + each("Script{initializeOnly SFInt32 f@ 1}\n", n),
    "proto_fields.x3dv": lambda n: VRML + "PROTO P [" + each("inputOutput SFInt32 f@ 1\n", n) + "] {Group{}} P{}",
    "proto_fields.x3d": lambda n: XML.format('<ProtoDeclare name="P"><ProtoInterface>' + each('<field name="f@" type="SFInt32" accessType="inputOutput" value="1"/>', n) + '</ProtoInterface><ProtoBody><Group/></ProtoBody></ProtoDeclare><ProtoInstance name="P">' + each('<fieldValue name="f@" value="2"/>', n) + "</ProtoInstance>"),
    "is.x3dv": lambda n: VRML + "PROTO P [" + each("inputOutput SFBool f@ TRUE\n", n) + "] {Group{" + "} Group{".join(f"visible IS f{i}" for i in range(1, n + 1)) + "}} P{}",
    "is_one.x3dv": lambda n: VRML + "PROTO P [inputOutput SFBool f TRUE] {" + "Group{visible IS f}" * n + "} P{}",
    "is_script.x3dv": lambda n: VRML + "PROTO P [" + each("inputOutput SFInt32 f@ 1\n", n) + "] {Script{" + each("inputOutput SFInt32 g@ IS f@\n", n) + "}} P{}",
    "is_bad.x3dv": lambda n: VRML + "PROTO P [" + each("inputOutput SFInt32 f@ 1\n", n) + "] {Group{" + each("visible IS g@\n", n) + "}} P{}",
    "protos.x3dv": lambda n: VRML + each("PROTO P@ [] {Group{}} P@{}\n", n),
    "unused_protos.x3dv": lambda n: VRML + each("PROTO P@ [] {Group{}}\n", n),
    "same_protos.x3dv": lambda n: VRML + each("PROTO P [] {Group{}}\n", n),
    "protos_in_body.x3dv": lambda n: VRML + "PROTO P [] {" + each("PROTO Q@ [] {Group{}}\n", n) + "Group{}} P{}",
    "externs.x3dv": lambda n: VRML + each('EXTERNPROTO E@ [] "none.x3dv#E@" E@{}\n', n),
    "inlines.x3dv": lambda n: VRML + each('Inline{url "none@.x3dv"}\n', n),
    "imports.x3dv": lambda n: VRML + 'DEF I Inline{url "none.x3dv"}\n' + each("IMPORT I.a@ AS b@\n", n) + each("EXPORT b@\n", n),
    "exports.x3dv": lambda n: VRML + each("DEF D@ Group{} EXPORT D@ AS E@\n", n),
    "children.x3dv": lambda n: VRML + "Group{children [" + "Group{}" * n + "]}",
    "urls.x3dv": lambda n: VRML + "Inline{url [" + each('"none@" ', n) + "]}",
    "strings.x3dv": lambda n: VRML + "Text{string [" + each('"none@" ', n) + "]}",
    "strings.x3d": lambda n: XML.format("<Text string='" + each('"none@" ', n) + "'/>"),
    "comments.x3dv": lambda n: VRML + each("#@\n", n) + "Group{}",
    "comments.x3d": lambda n: XML.format(each("<!--@-->", n)),
    "meta.x3d": lambda n: '<X3D version="4.0" profile="Full"><head>' + each('<meta name="a@" content="b"/>', n) + "</head><Scene/></X3D>",
    "units.x3d": lambda n: '<X3D version="4.0" profile="Full"><head>' + each('<unit category="length" name="a@" conversionFactor="2"/>', n) + "</head><Scene/></X3D>",
    "components.x3d": lambda n: '<X3D version="4.0" profile="Full"><head>' + each('<component name="a@" level="1"/>', n) + "</head><Scene/></X3D>",
    "texts.x3d": lambda n: XML.format("<Script>" + each("a@;<!-- -->", n) + "</Script>"),
    "sections.x3d": lambda n: XML.format("<Script>" + each("<![CDATA[a@;]]>", n) + "</Script>"),
    "entities.x3d": lambda n: "<!DOCTYPE X3D [" + each('<!ENTITY e@ "x">', min(n, 9999)) + "]>" + XML.format("<Group/>" * n),
    "attlist.x3d": lambda n: "<!DOCTYPE X3D [<!ATTLIST Group " + each('a@ CDATA "x"\n', n) + ">]>" + XML.format("<Group/>" * n),
    "entity_attributes.x3d": lambda n: "<!DOCTYPE X3D [<!ENTITY e '<Group " + each('a@="@" ', n) + "/>'>]>" + XML.format("&e;" + " " * n),
    "characters.x3d": lambda n: XML.format("<WorldInfo title='" + "&#65;&#66;" * n + "'/>"),
    "keys.json": lambda n: '{"X3D":{"@version":"4.0","@profile":"Full","Scene":{"-children":[{"Group":{' + each('"@a@":1', n, ",") + "}}]}}}",
    "children.json": lambda n: '{"X3D":{"@version":"4.0","@profile":"Full","Scene":{"-children":[' + each('{"Group":{"@DEF":"D@"}}', n, ",") + "]}}}",
    "values.json": lambda n: '{"X3D":{"@version":"4.0","@profile":"Full","Scene":{"-children":[{"Coordinate":{"@point":[' + each("@,1,2", n, ",") + "]}}]}}}",
    "numbers.x3dv": lambda n: VRML + "IndexedFaceSet{coord Coordinate{point [" + each("@ 1 2,", n) + "]} coordIndex [" + each("@ 0 1 -1 ", n) + "]}",
    "polygon.x3dv": lambda n: VRML + "IndexedFaceSet{coord Coordinate{point [" + each("@ 1 2,", n) + "]} coordIndex [" + each("@ ", n) + "]}",
    "joints.x3dv": lambda n: VRML + "HAnimHumanoid{skeleton HAnimJoint{name \"humanoid_root\" children [" + each('DEF J@ HAnimJoint{name "j@"}\n', n) + "]}}",
    "layers.x3dv": lambda n: VRML + "LayerSet{layers [" + "Layer{}" * n + "]}",
    "sensors.x3dv": lambda n: VRML + each("Group{children [TouchSensor{} Shape{geometry Box{}}]}\n", n),
    "viewpoints.x3dv": lambda n: VRML + each('Viewpoint{description "@"}\n', n),
    "lights.x3dv": lambda n: VRML + "PointLight{}\n" * n,
    "nodes.gltf": lambda n: json.dumps({**GLTF, "scenes": [{"nodes": list(range(n))}], "nodes": [{"name": f"n{i}"} for i in range(n)]}),
    "same_names.gltf": lambda n: json.dumps({**GLTF, "scenes": [{"nodes": list(range(n))}], "nodes": [{"name": "n"} for i in range(n)]}),
    "extensions.gltf": lambda n: json.dumps({**GLTF, "scenes": [{}], "extensionsUsed": [f"X{i}" for i in range(n)], "extensions": {f"X{i}": {} for i in range(n)}}),
    "links.urdf": lambda n: '<robot name="r"><link name="l0"/>' + each('<link name="l@"/><joint name="j@" type="fixed"><parent link="l0"/><child link="l@"/></joint>', n) + "</robot>",
    "materials.urdf": lambda n: '<robot name="r"><link name="l0"/>' + each('<material name="m@"><color rgba="1 0 0 1"/></material>', n) + "</robot>",
    "groups.obj": lambda n: "v 0 0 0\nv 1 0 0\nv 0 1 0\n" + each("g g@\nusemtl m@\nf 1 2 3\n", n),
    "properties.ply": lambda n: "ply\nformat ascii 1.0\nelement vertex 1\n" + each("property float p@\n", n) + "end_header\n" + "0 " * n + "\n",
    "elements.ply": lambda n: "ply\nformat ascii 1.0\n" + each("element e@ 0\nproperty float x\n", n) + "end_header\n",
    "solids.stl": lambda n: each("solid s@\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid s@\n", n),
}


def run(program, stack, *arguments):
    """Status, the end of what it says, and CPU seconds."""
    def bounded():
        resource.setrlimit(resource.RLIMIT_STACK, (stack << 10, stack << 10))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    process = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, errors="replace", preexec_fn=bounded, check=False,
                             timeout=7200, stdin=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return process.returncode, process.stderr[-2000:], after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def commands(file):
    """Each verb that reads a file, and what it writes where the next one reads it."""
    folder = file.parent
    yield ["info", file]
    yield ["validate", file]
    for name in ("out.x3d", "out.x3dv", "out.json"):
        yield ["convert", file, folder / name]
    yield ["render", file, "-o", folder / "out.png", "--size", "16x9"]
    yield ["run", file, "--for", "0.1s"]
    if file.name in ("nodes.x3dv", "use.x3dv", "nodes.gltf", "script_chain.x3dv", "proto_values.x3dv"):
        yield ["record", file, "-o", folder / "out.rlog", "--for", "0.1s"]
        yield ["replay", folder / "out.rlog", "--verify"]
        yield ["diff", file, file]
        yield ["convert", file, folder / "out.glb"]
        yield ["convert", file, folder / "out.rtsgb"]
        yield ["info", folder / "out.rtsgb"]
        for name in ("flatten-protos", "flatten-transforms", "share", "statistics", "drop-defaults", "short-names", "index", "portable"):
            yield ["convert", file, folder / f"{name}.x3dv", "--filter", name]


def deep(program, count, stack, kinds, folder):
    faults = 0
    for name, text in DEEP.items():
        if not kinds.search(name):
            continue
        file = folder / name
        file.write_text(text(count))
        for command in commands(file):
            status, said, seconds = run(program, stack, *command)
            shown = f"{name}: {' '.join(map(str, [command[0], *command[2:]]))}"
            good = status in (0, 1) and (status == 0 or re.search(r"error|not equal|differ", said))
            faults += not good
            last = said.strip().rsplit("\n", 1)[-1][:160] if not good or status else ""
            print(f"{'' if good else 'FAULT: '}{shown.replace(str(folder) + '/', '')}: status {status}, {seconds:.2f} CPU-s {last}", flush=True)
        for one in folder.iterdir():
            one.unlink()
    return faults


def growth(program, count, kinds, folder):
    faults = 0
    for name, text in MANY.items():
        if not kinds.search(name):
            continue
        file, seconds = folder / name, []
        for size in (count, 2 * count):
            file.write_text(text(size))
            seconds.append(min(run(program, 8192, "validate", file)[2] for _ in range(2)))
        factor = seconds[1] / max(seconds[0], .02)
        bad = factor > 2.3 and seconds[1] > .3
        faults += bad
        print(f"{'FAULT: ' if bad else ''}{name}: {seconds[0]:.2f} and {seconds[1]:.2f} CPU-s, factor {factor:.2f}", flush=True)
        file.unlink()
    return faults


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", required=True, type=lambda path: str(pathlib.Path(path).resolve()))
    is_long = bool(os.environ.get("RTSG_LONG"))
    parser.add_argument("--deep", type=int, default=1_000_000 if is_long else 5000)
    parser.add_argument("--stack", type=int, default=8192 if is_long else 256, help="kilobytes")
    parser.add_argument("--kinds", type=re.compile, default=re.compile(""))
    parser.add_argument("--growth", type=int, nargs="?", const=20_000)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        if options.growth:
            faults = growth(options.program, options.growth, options.kinds, folder)
        else:
            faults = deep(options.program, options.deep, options.stack, options.kinds, folder)
    print(f"{faults} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
