// glTF 2.0 as X3D: nodes are Transforms, primitives are Shapes with PhysicalMaterials, cameras are viewpoints, lights
// are lights, skins are HAnimHumanoids, and animations are TimeSensors with interpolators.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <set>

#include <fmt/format.h>

#include <rtsg/core/portable_math.h>

#include "gltf_animation.h"

namespace rtsg::detail {

using nlohmann::json;

namespace {

/// The rotation of a matrix of three unit columns, as a quaternion (Shepperd 1978: the largest component first).
std::array<double, 4> quaternionOfAxes(const double (&m)[3][3]) {
    const double trace = m[0][0] + m[1][1] + m[2][2];
    std::array<double, 4> q{};
    int maximum = 3;
    double largest = trace;
    for (int i = 0; i < 3; ++i)
        if (m[i][i] > largest) {
            largest = m[i][i];
            maximum = i;
        }
    if (maximum == 3) {
        q = {m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1], 1 + trace};
    } else {
        const int j = (maximum + 1) % 3, k = (maximum + 2) % 3;
        const auto at = [&](int i) -> double& { return q[static_cast<std::size_t>(i)]; };
        at(maximum) = 1 + m[maximum][maximum] - m[j][j] - m[k][k];
        at(j) = m[j][maximum] + m[maximum][j];
        at(k) = m[k][maximum] + m[maximum][k];
        at(3) = m[k][j] - m[j][k];
    }
    const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (double& one : q) one /= length;
    return q;
}

constexpr std::uint64_t kPart = 256, kJoint = 1024;  // bytes of the nodes of a primitive, and of a joint

class GltfImporter {
    using Names = GltfNames::List;

  public:
    GltfImporter(GltfFile& file, DocumentHandler& handler, std::string_view clip)
        : file_(file), out_(handler), names_(file), meshes_(file, handler, names_), clip_(clip) {}

    bool run() {
        const json& root = file_.root();
        const std::size_t nodes = GltfFile::list(root, "nodes").size();
        given_.assign(nodes, false);
        above_.assign(nodes, kNoIndex);
        findAnimated();
        beginImported(out_, "from glTF 2.0", meshes_.hasTangents() ? "4.1" : "4.0");
        for (const char* key : {"generator", "copyright"})
            if (const std::string text = GltfFile::text(GltfFile::object(root, "asset"), key); !text.empty())
                out_.meta(key, text, {});
        const std::size_t first = GltfFile::list(root, "scenes").empty() ? kNoIndex : 0;
        const json* scene = file_.item("scenes", GltfFile::index(root, "scene").value_or(first));
        if (scene) {
            writeNodes(GltfFile::list(*scene, "nodes"));
        } else {
            for (std::size_t i = 0; i < nodes; ++i)
                if (!isChild_.contains(i)) writeTree(i);
            if (std::ranges::find(given_, false) != given_.end())
                file_.fault("the glTF file's nodes are no tree; those that are below themselves are left out");
        }
        for (const auto& [node, mesh, skin] : skinned_) writeFigures(node, mesh, skin);
        GltfAnimations(file_, out_, names_, meshes_, figures_, [&](std::size_t node) {
            return node < given_.size() && given_[node];
        }).write(clip_);
        meshes_.writeVariants();
        out_.endDocument();
        return true;
    }

  private:
    void findAnimated() {
        for (const json& animation : GltfFile::list(file_.root(), "animations"))
            for (const json& channel : GltfFile::list(animation, "channels"))
                if (const auto node = GltfFile::index(GltfFile::object(channel, "target"), "node")) {
                    const std::string path = GltfFile::text(GltfFile::object(channel, "target"), "path");
                    if (path == "weights") morphed_.insert(*node);
                    if (GltfAnimations::moves(path)) animated_.insert(*node);
                }
        const json& nodes = GltfFile::list(file_.root(), "nodes");
        for (std::size_t i = 0; i < nodes.size(); ++i)
            for (const json& child : GltfFile::list(nodes[i], "children")) {
                if (!child.is_number_unsigned()) continue;
                const auto below = child.get<std::size_t>();
                isChild_.insert(below);
                if (below < above_.size()) above_[below] = i;
            }
    }

    // ---- the hierarchy, with a stack of its own
    void writeNodes(const json& list) {
        for (const json& one : list)
            if (one.is_number_unsigned()) writeTree(one.get<std::size_t>());
    }
    void writeTree(std::size_t root) {
        struct Open {
            const json* node;
            std::size_t next;
        };
        std::vector<Open> open;
        const auto begin = [&](std::size_t index) {
            const json* node = file_.item("nodes", index);
            if (!node) return;  // which has been told
            if (given_[index])
                return file_.fault(fmt::format(
                    "node {} of the glTF file is there twice, as nodes are no tree; it is given once", index));
            given_[index] = true;
            const bool inside = !open.empty();
            out_.beginNode(
                "Transform",
                animated_.contains(index) ? names_.of(Names::nodes, index) : names_.authored(Names::nodes, index),
                inside ? "children" : "", {});
            writeTransform(*node, index);
            writeContent(*node, index);
            open.push_back({node, 0});
        };
        begin(root);
        while (!open.empty()) {
            Open& top = open.back();
            const json& children = GltfFile::list(*top.node, "children");
            if (top.next == children.size()) {
                out_.endNode({});
                open.pop_back();
                continue;
            }
            const json& child = children[top.next++];
            if (child.is_number_unsigned()) begin(child.get<std::size_t>());
        }
    }
    void writeTransform(const json& node, std::size_t number) {
        const auto set = [&](const char* field, Value value) { out_.setField(field, std::move(value), {}); };
        if (const auto m = GltfFile::numbers(node, "matrix", 16)) {
            if (node.contains("translation") || node.contains("rotation") || node.contains("scale"))
                file_.fault(
                    fmt::format("node {} of the glTF file has a matrix, and more that says where it is", number));
            if (!isPlain(*m))
                file_.fault(fmt::format(
                    "node {} of the glTF file has a matrix that is no translation, rotation and scale; what "
                    "is nearest to it is taken",
                    number));
            return writeMatrix(*m);
        }
        if (const auto r = GltfFile::numbers(node, "rotation", 4)) {
            if (std::ranges::all_of(*r, [](double one) { return one == 0; }))
                file_.fault(
                    fmt::format("node {} of the glTF file has a rotation of length 0; it does not turn", number));
            set("rotation", Value(rotationOf(r->data())));
        }
        if (const auto s = GltfFile::numbers(node, "scale", 3)) set("scale", Value(vectorOf(*s)));
        if (const auto t = GltfFile::numbers(node, "translation", 3)) set("translation", Value(vectorOf(*t)));
    }
    /// Whether its columns are at right angles, and its last row is 0 0 0 1.
    static bool isPlain(const std::vector<double>& m) {
        constexpr double maximum = 1e-3;
        for (std::size_t a = 0; a < 3; ++a) {
            const double* const p = m.data() + 4 * a;
            const double* const q = m.data() + 4 * ((a + 1) % 3);
            const double dot = p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
            const double lengths =
                (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
            if (dot * dot > maximum * maximum * lengths || p[3] != 0) return false;
        }
        return m[15] == 1;
    }
    /// A matrix by columns that is a translation, a rotation and a scale; glTF allows no other.
    void writeMatrix(const std::vector<double>& m) {
        double length[3], axes[3][3];
        for (std::size_t c = 0; c < 3; ++c)
            length[c] = std::sqrt(m[4 * c] * m[4 * c] + m[4 * c + 1] * m[4 * c + 1] + m[4 * c + 2] * m[4 * c + 2]);
        const double determinant = m[0] * (m[5] * m[10] - m[6] * m[9]) - m[4] * (m[1] * m[10] - m[2] * m[9]) +
                                   m[8] * (m[1] * m[6] - m[2] * m[5]);
        if (determinant < 0) length[0] = -length[0];
        const bool good = length[0] != 0 && length[1] != 0 && length[2] != 0;
        if (good) {
            for (std::size_t r = 0; r < 3; ++r)
                for (std::size_t c = 0; c < 3; ++c) axes[r][c] = m[4 * c + r] / length[c];
            const std::array<double, 4> q = quaternionOfAxes(axes);
            out_.setField("rotation", Value(rotationOf(q.data())), {});
        }
        out_.setField("scale", Value(vectorOf({length[0], length[1], length[2]})), {});
        out_.setField("translation", Value(vectorOf({m[12], m[13], m[14]})), {});
    }
    void writeContent(const json& node, std::size_t number) {
        if (const auto camera = GltfFile::index(node, "camera")) writeCamera(*camera, GltfFile::text(node, "name"));
        const json& light = GltfFile::object(GltfFile::object(node, "extensions"), "KHR_lights_punctual");
        if (const auto index = GltfFile::index(light, "light")) writeLight(*index);
        const auto mesh = GltfFile::index(node, "mesh");
        if (!mesh) return;
        // A figure stands where its joints are, wherever its node is.
        if (const auto skin = GltfFile::index(node, "skin"))
            skinned_.push_back({number, *mesh, *skin});
        else if (const json& many = GltfFile::extension(node, "EXT_mesh_gpu_instancing"); !many.empty())
            writeInstances(*mesh, node, number, GltfFile::object(many, "attributes"));
        else
            writeMeshNode(*mesh, node, number);
    }
    /// EXT_mesh_gpu_instancing: the mesh once for each element of the attributes, which all have as many.
    void writeInstances(std::size_t mesh, const json& node, std::size_t number, const json& attributes) {
        std::size_t count = 0;
        const auto read = [&](const char* name, std::size_t size) {
            std::vector<float> all;
            std::size_t components = 0;
            if (const auto accessor = GltfFile::index(attributes, name)) all = file_.floats(*accessor, components);
            if (components != size) all.clear();
            count = std::max(count, all.size() / size);
            return all;
        };
        const auto positions = read("TRANSLATION", 3), rotations = read("ROTATION", 4), scales = read("SCALE", 3);
        const bool fits = std::ranges::all_of(std::array{positions.size() / 3, rotations.size() / 4, scales.size() / 3},
                                              [&](std::size_t its) { return its == 0 || its == count; });
        const bool moves = morphed_.contains(number) || !GltfFile::list(node, "weights").empty();
        if (!fits || count == 0 || moves) {
            file_.fault(
                fmt::format("instances at node {} of the glTF file have places of different numbers or none, or "
                            "weights of their own; the mesh stands there once",
                            number));
            return writeMeshNode(mesh, node, number);
        }
        constexpr std::uint64_t bytes = 512;  // of its nodes
        for (std::size_t i = 0; i < count && file_.mayMake(bytes); ++i) {
            GltfNode transform(out_, "Transform", "children");
            const auto three = [&](const std::vector<float>& all) {
                return Vec3f(all[3 * i], all[3 * i + 1], all[3 * i + 2]);
            };
            if (!rotations.empty()) {
                const std::array<double, 4> q{double{rotations[4 * i]}, double{rotations[4 * i + 1]},
                                              double{rotations[4 * i + 2]}, double{rotations[4 * i + 3]}};
                transform.set("rotation", rotationOf(q.data()));
            }
            if (!scales.empty()) transform.set("scale", three(scales));
            if (!positions.empty()) transform.set("translation", three(positions));
            writeMeshNode(mesh, node, number);
        }
    }

    void writeCamera(std::size_t index, const std::string& name) {
        const json* camera = file_.item("cameras", index);
        if (!camera) return;
        const std::string own = GltfFile::text(*camera, "name");
        const std::string description = own.empty() ? name : own;
        const bool flat = GltfFile::text(*camera, "type") == "orthographic";
        const json& lens = GltfFile::object(*camera, flat ? "orthographic" : "perspective");
        const double near = GltfFile::number(lens, "znear", -1), far = GltfFile::number(lens, "zfar", -1);
        if (flat && (GltfFile::number(lens, "xmag", 1) == 0 || GltfFile::number(lens, "ymag", 1) == 0))
            return file_.fault(fmt::format("camera {} of the glTF file sees nothing, by its xmag and ymag", index));
        if (lens.empty() || (far > 0 && far <= near))
            return file_.fault(fmt::format("camera {} of the glTF file has {}", index,
                                           lens.empty() ? "no lens of its type" : "its zfar before its znear"));
        GltfNode view(out_, flat ? "OrthoViewpoint" : "Viewpoint", "children",
                      names_.authoredOnce(Names::cameras, index));
        view.set("position", Vec3f(0, 0, 0));
        if (!description.empty()) view.set("description", String(description));
        if (flat) {
            const auto x = static_cast<float>(GltfFile::number(lens, "xmag", 1));
            const auto y = static_cast<float>(GltfFile::number(lens, "ymag", 1));
            view.set("fieldOfView", Array<float>{-x, -y, x, y});
        } else {
            // X3D's angle is that of the shorter side.
            const double vertical = GltfFile::number(lens, "yfov", .7854);
            const double aspect = GltfFile::number(lens, "aspectRatio", 1);
            constexpr double half = 3.14159265358979;
            if (vertical >= half || !(vertical > 0))
                return file_.fault(fmt::format("camera {} of the glTF file sees no angle below half a turn", index));
            const double angle = aspect < 1 ? 2 * portable::atan(portable::tan(vertical / 2) * aspect) : vertical;
            view.set("fieldOfView", static_cast<float>(angle));
        }
        if (near > 0) view.set("nearDistance", static_cast<float>(near));
        if (far > 0) view.set("farDistance", static_cast<float>(far));
    }
    void writeLight(std::size_t index) {
        const json& all = GltfFile::list(
            GltfFile::object(GltfFile::object(file_.root(), "extensions"), "KHR_lights_punctual"), "lights");
        if (index >= all.size()) return;
        const json& light = all[index];
        const std::string type = GltfFile::text(light, "type");
        const bool directional = type == "directional";
        GltfNode out(out_,
                     directional      ? "DirectionalLight"
                     : type == "spot" ? "SpotLight"
                                      : "PointLight",
                     "children", names_.authoredOnce(Names::lights, index));
        if (const auto color = GltfFile::numbers(light, "color", 3)) {
            const Vec3f c = vectorOf(*color);
            out.set("color", Color{c.x, c.y, c.z});
        }
        out.set("intensity", static_cast<float>(GltfFile::number(light, "intensity", 1)));
        out.set("global", true);
        if (directional) return;
        constexpr double everywhere = 1e6;
        out.set("attenuation", Vec3f(0, 0, 1));
        out.set("radius", static_cast<float>(GltfFile::number(light, "range", everywhere)));
        if (type != "spot") return;
        const json& cone = GltfFile::object(light, "spot");
        const double inner = GltfFile::number(cone, "innerConeAngle", 0);
        const double outer = GltfFile::number(cone, "outerConeAngle", .785398);
        if (inner < 0 || inner > outer)
            file_.fault(
                fmt::format("light {} of the glTF file has an inner cone that is not within its outer one", index));
        out.set("beamWidth", static_cast<float>(inner));
        out.set("cutOffAngle", static_cast<float>(outer));
    }

    // ---- meshes
    void writeMeshNode(std::size_t index, const json& node, std::size_t number) {
        const json* mesh = file_.item("meshes", index);
        if (!mesh) return;
        // Forms of its own are no use to other nodes.
        const bool own = morphed_.contains(number) || !GltfFile::list(node, "weights").empty();
        std::string def = names_.authoredOnce(Names::meshes, index);
        if (!own) {
            const auto [given, isNew] = meshGiven_.try_emplace(index);
            if (!isNew) return out_.useNode(given->second, "children", {});
            if (def.empty()) {
                // A name that one with forms of its own has had cannot be given again.
                const std::string& name = names_.of(Names::meshes, index);
                def = names_.authored(Names::meshes, index).empty() ? name : names_.take(name);
            }
            given->second = def;
        }
        GltfNode group(out_, "Group", "children", def);
        std::size_t part = 0;
        for (const json& primitive : GltfFile::list(*mesh, "primitives")) {
            if (!file_.mayMake(kPart)) break;
            meshes_.writePrimitive(primitive, formOf(*mesh, node, number, part++));
        }
    }
    GltfForm formOf(const json& mesh, const json& node, std::size_t number, std::size_t part) {
        GltfForm form;
        const json& own = GltfFile::list(node, "weights");
        for (const json& weight : own.empty() ? GltfFile::list(mesh, "weights") : own)
            form.weights.push_back(weight.is_number() ? weight.get<double>() : 0);
        if (morphed_.contains(number)) form.points = names_.points(number, part);
        return form;
    }
    struct Skinned {
        std::size_t node, mesh, skin;
    };
    /// One for each primitive, which has points of its own.
    void writeFigures(std::size_t node, std::size_t meshIndex, std::size_t skinIndex) {
        const json* mesh = file_.item("meshes", meshIndex);
        const json* it = file_.item("nodes", node);
        if (!mesh || !it) return;
        const GltfNode group(out_, "Group", {}, names_.authoredOnce(Names::meshes, meshIndex));
        std::size_t part = 0;
        for (const json& primitive : GltfFile::list(*mesh, "primitives")) {
            const auto [skin, isNew] = skins_.try_emplace(skinIndex, nullptr);
            if (isNew) skin->second = std::make_unique<GltfSkin>(file_, skinIndex, above_);
            if (!file_.mayMake(kJoint * (1 + skin->second->joints().size()))) break;
            GltfFigure figure(*skin->second, names_.of(Names::nodes, node) + "_figure" + std::to_string(part), names_);
            GltfForm form = formOf(*mesh, *it, node, part);
            form.points = names_.points(node, part++);
            writeFigure(file_, out_, meshes_, figure, primitive, form);
            figures_.push_back(std::move(figure));
        }
    }

    GltfFile& file_;
    DocumentHandler& out_;
    GltfNames names_;
    GltfMeshes meshes_;
    std::string_view clip_;  // the one that plays; empty: the first
    std::vector<bool> given_;
    std::map<std::size_t, std::string> meshGiven_;  // the DEFs of those that can be used again
    std::vector<std::size_t> above_;                // each node's, or kNoIndex
    std::vector<Skinned> skinned_;
    std::map<std::size_t, std::unique_ptr<GltfSkin>> skins_;  // by their numbers
    std::vector<GltfFigure> figures_;
    std::set<std::size_t> morphed_, animated_, isChild_;
};

}  // namespace

bool importGltf(const ImportInput& input, DocumentHandler& handler, Diagnostics& diagnostics) {
    GltfFile file(input, diagnostics);
    return file.open() && GltfImporter(file, handler, input.clip).run();
}

}  // namespace rtsg::detail
