// Blender in the background, with a script that builds the room and takes its time.
#include "cycles.h"

#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <fmt/format.h>

#include "bench.h"

namespace rtsg::bench {

namespace {

constexpr const char* kSetUp = R"PY(
import array, bpy, math, mathutils, os, struct, sys, tempfile, time

given = sys.argv[sys.argv.index("--") + 1:]
side, samples = int(given[0]), int(given[1])
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
c = scene.cycles
c.device, c.samples = "CPU", samples
c.use_adaptive_sampling = c.use_denoising = False
c.max_bounces = c.diffuse_bounces = c.glossy_bounces = c.transmission_bounces = 128
c.sample_clamp_direct = c.sample_clamp_indirect = c.blur_glossy = 0
c.pixel_filter_type = "BOX"
c.filter_width = 1
r = scene.render
r.resolution_x = r.resolution_y = side
r.resolution_percentage = 100
r.threads_mode, r.threads = "FIXED", 1
r.image_settings.file_format, r.image_settings.color_depth = "OPEN_EXR", "32"
linear = lambda v: [x / 12.92 if x <= .04045 else ((x + .055) / 1.055) ** 2.4 for x in v] + [1]

def material(color, **more):
    m = bpy.data.materials.new("m")
    m.use_nodes = True
    m.node_tree.nodes.clear()
    out = m.node_tree.nodes.new("ShaderNodeOutputMaterial")
    shader = m.node_tree.nodes.new("ShaderNodeBsdfPrincipled" if more else "ShaderNodeBsdfDiffuse")
    shader.inputs[0].default_value = linear(color)
    for name, value in more.items():
        shader.inputs[name].default_value = value
    m.node_tree.links.new(shader.outputs[0], out.inputs[0])
    return m

)PY";

constexpr const char* kRoomInBlender = R"PY(
def box(size, place, m):
    x, y, z = (v / 2 for v in size)
    corners = [(i * x, k * y, l * z) for i in (-1, 1) for k in (-1, 1) for l in (-1, 1)]
    mesh = bpy.data.meshes.new("box")
    mesh.from_pydata(corners, [], [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
    mesh.materials.append(m)
    o = bpy.data.objects.new("box", mesh)
    o.location = place
    scene.collection.objects.link(o)

box((4, 3, 4), (0, 0, 0), material((.87, .87, .87)))
box((.8, 1, .8), (.6, -1, 0), material((.2, .5, .8), Roughness=.4, Metallic=.5))
bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=.5, location=(-.6, -1, -.5))
ball = bpy.context.object
bpy.ops.object.shade_smooth()
ball.data.materials.append(material((.8, .3, .2), Roughness=.5, Specular=.2))
glow = bpy.data.materials.new("glow")
glow.use_nodes = True
nodes, links = glow.node_tree.nodes, glow.node_tree.links
nodes.clear()
shines, side_seen, front = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeMath")
front.operation = "SUBTRACT"
front.inputs[0].default_value = 1
links.new(side_seen.outputs["Backfacing"], front.inputs[1])
links.new(front.outputs[0], shines.inputs["Strength"])
links.new(shines.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs[0])
for x in (-.75, .75):
    mesh = bpy.data.meshes.new("lamp")
    mesh.from_pydata([(-.15, 0, -.15), (.15, 0, -.15), (.15, 0, .15), (-.15, 0, .15)], [], [(0, 1, 2, 3)])
    mesh.materials.append(glow)
    o = bpy.data.objects.new("lamp", mesh)
    o.location = (x, 1.49, -.75)
    scene.collection.objects.link(o)
camera = bpy.data.cameras.new("camera")
camera.angle, camera.clip_start = 1, .01
eye = bpy.data.objects.new("camera", camera)
eye.location = (0, 0, 1.9)
scene.collection.objects.link(eye)
scene.camera = eye

)PY";

/// Makes the scene of UnderSky::write() in Blender.
constexpr const char* kSkyInBlender = R"PY(
def sent(kind, count):
    values = array.array(kind)
    values.fromfile(file, count)
    return values

with open(given[2], "rb") as file:
    right, up, forward, place = (sent("d", 3) for i in range(4))
    tangent, meshes = sent("d", 1)[0], []
    for i in range(sent("I", 1)[0]):
        corners, triangles = sent("I", 2)
        mesh = bpy.data.meshes.new("mesh")
        mesh.vertices.add(corners)
        mesh.vertices.foreach_set("co", sent("f", 3 * corners))
        mesh.loops.add(3 * triangles)
        mesh.loops.foreach_set("vertex_index", sent("I", 3 * triangles))
        mesh.polygons.add(triangles)
        mesh.polygons.foreach_set("loop_start", range(0, 3 * triangles, 3))
        mesh.polygons.foreach_set("loop_total", [3] * triangles)
        mesh.update()
        meshes.append(mesh)
    colors = {}
    for i in range(sent("I", 1)[0]):
        mesh, color, matrix = meshes[sent("I", 1)[0]], tuple(sent("f", 3)), sent("d", 12)
        if color not in colors:
            colors[color] = material(color)
        o = bpy.data.objects.new("object", mesh)
        if not mesh.materials:
            mesh.materials.append(None)
        o.material_slots[0].link = "OBJECT"
        o.material_slots[0].material = colors[color]
        columns = [list(matrix[3 * k:3 * k + 3]) for k in range(4)]
        o.matrix_world = mathutils.Matrix([[columns[k][row] for k in range(4)] for row in range(3)] + [[0, 0, 0, 1]])
        scene.collection.objects.link(o)
scene.world = bpy.data.worlds.new("sky")
scene.world.use_nodes = True
scene.world.node_tree.nodes["Background"].inputs[0].default_value = (1, 1, 1, 1)
camera = bpy.data.cameras.new("camera")
camera.angle, camera.clip_start, camera.clip_end = 2 * math.atan(tangent), .001, 1e6
eye = bpy.data.objects.new("camera", camera)
eye.matrix_world = mathutils.Matrix(
    [[right[row], up[row], -forward[row], place[row]] for row in range(3)] + [[0, 0, 0, 1]])
scene.collection.objects.link(eye)
scene.camera = eye

)PY";

/// Two pictures of different seeds; how far they are apart tells how far each is from the truth.
constexpr const char* kRender = R"PY(
pictures, seconds = [], 0
with tempfile.TemporaryDirectory() as folder:
    for seed in (1, 2):
        c.seed = seed
        r.filepath = os.path.join(folder, "p.exr")
        start = time.process_time()
        bpy.ops.render.render(write_still=True)
        seconds += time.process_time() - start
        image = bpy.data.images.load(r.filepath)
        pictures.append(image.pixels[:])
        bpy.data.images.remove(image)
squares, sums = 0, [0, 0, 0]
for at in range(0, side * side * 4, 4):
    a, b = (p[at:at + 3] for p in pictures)
    mean = [(x + y) / 2 for x, y in zip(a, b)]
    sums = [x + y for x, y in zip(sums, mean)]
    brightest = mean.index(max(mean))
    squares += ((a[brightest] - b[brightest]) / (mean[brightest] + .01)) ** 2 / 2
print("RTSG", bpy.app.version_string.split()[0], seconds / 2, math.sqrt(squares / (side * side)), sum(sums) / (3 * side * side))
)PY";

}  // namespace

bool hasCycles() {
    return isInstalled("blender");
}

namespace {

/// `more`: what the script is given besides.
std::optional<CyclesPicture> cycles(const char* content, int side, int samples, const std::string& more) {
    const std::filesystem::path script =
        std::filesystem::temp_directory_path() / fmt::format("rtsg_cycles_{}.py", ::getpid());
    std::ofstream(script) << kSetUp << content << kRender;
    const std::string command =
        fmt::format("blender -b --factory-startup -noaudio -t 1 --python-exit-code 1 -P {} -- {} {} {} 2>/dev/null",
                    script.string(), side, samples, more);
    std::optional<CyclesPicture> result;
    if (std::FILE* output = ::popen(command.c_str(), "r")) {
        char line[1024];
        while (std::fgets(line, sizeof line, output)) {
            std::istringstream words(line);
            std::string first;
            CyclesPicture found;
            if (words >> first >> found.version >> found.seconds >> found.error >> found.mean && first == "RTSG")
                result = found;
        }
        ::pclose(output);
    }
    std::filesystem::remove(script);
    return result;
}

}  // namespace

std::optional<CyclesPicture> cyclesRoom(int side, int samples) {
    return cycles(kRoomInBlender, side, samples, {});
}

std::optional<CyclesPicture> cyclesScene(const std::filesystem::path& meshes, int side, int samples) {
    return cycles(kSkyInBlender, side, samples, "'" + meshes.string() + "'");
}

}  // namespace rtsg::bench
