// glTF 2.0 as X3D: nodes are Transforms, primitives are Shapes with PhysicalMaterials, cameras are viewpoints, lights
// are lights, skins are HAnimHumanoids, and animations are TimeSensors with interpolators.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>

#include "gltf_skin.h"

namespace rtsg::detail {

using nlohmann::json;

namespace {

constexpr std::size_t kNone = SIZE_MAX;

/// What a quaternion (x y z w) turns, as X3D has it.
Rotation rotationOf(const double* q) {
    const double sine = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
    Rotation result;
    if (sine == 0) return result;
    result.x = static_cast<float>(q[0] / sine);
    result.y = static_cast<float>(q[1] / sine);
    result.z = static_cast<float>(q[2] / sine);
    result.angle = static_cast<float>(2 * std::atan2(sine, q[3]));
    return result;
}

Vec3f vec3(const std::vector<double>& v) {
    return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

/// The rotation of a matrix of three unit columns, as a quaternion (Shepperd 1978: the largest component first).
std::array<double, 4> quaternionOf(const double (&m)[3][3]) {
    const double trace = m[0][0] + m[1][1] + m[2][2];
    std::array<double, 4> q{};
    int most = 3;
    double largest = trace;
    for (int i = 0; i < 3; ++i)
        if (m[i][i] > largest) {
            largest = m[i][i];
            most = i;
        }
    if (most == 3) {
        q = {m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1], 1 + trace};
    } else {
        const int j = (most + 1) % 3, k = (most + 2) % 3;
        const auto at = [&](int i) -> double& { return q[static_cast<std::size_t>(i)]; };
        at(most) = 1 + m[most][most] - m[j][j] - m[k][k];
        at(j) = m[j][most] + m[most][j];
        at(k) = m[k][most] + m[most][k];
        at(3) = m[k][j] - m[j][k];
    }
    const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (double& one : q) one /= length;
    return q;
}

class GltfImporter {
  public:
    GltfImporter(GltfFile& file, DocumentHandler& handler) : file_(file), out_(handler) {}

    bool run() {
        const json& root = file_.root();
        const std::size_t nodes = GltfFile::list(root, "nodes").size();
        given_.assign(nodes, false);
        above_.assign(nodes, kNone);
        meshGiven_.assign(GltfFile::list(root, "meshes").size(), false);
        findAnimated();
        beginImported(out_, "from glTF 2.0");
        for (const char* key : {"generator", "copyright"})
            if (const std::string text = GltfFile::text(GltfFile::object(root, "asset"), key); !text.empty())
                out_.meta(key, text);
        const json* scene = file_.item("scenes", GltfFile::index(root, "scene").value_or(0));
        if (scene) {
            writeNodes(GltfFile::list(*scene, "nodes"));
        } else {
            for (std::size_t i = 0; i < nodes; ++i)
                if (!isChild_.contains(i)) writeTree(i);
        }
        for (const auto& [node, mesh, skin] : skinned_) writeFigures(node, mesh, skin);
        const json& animations = GltfFile::list(root, "animations");
        for (std::size_t i = 0; i < animations.size(); ++i) writeAnimation(animations[i], i);
        out_.endDocument();
        return true;
    }

  private:
    /// A node of the output; closes it.
    class Node {
      public:
        Node(DocumentHandler& out, std::string_view type, std::string_view field, std::string_view def = {})
            : out_(out) {
            out_.beginNode(type, def, field, {});
        }
        ~Node() { out_.endNode({}); }
        Node(const Node&) = delete;
        Node& operator=(const Node&) = delete;
        template <class T>
        Node& set(std::string_view name, T value) {
            out_.setField(name, Value(std::move(value)), {});
            return *this;
        }

      private:
        DocumentHandler& out_;
    };

    void findAnimated() {
        for (const json& animation : GltfFile::list(file_.root(), "animations"))
            for (const json& channel : GltfFile::list(animation, "channels"))
                if (const auto node = GltfFile::index(GltfFile::object(channel, "target"), "node")) {
                    const bool weights = GltfFile::text(GltfFile::object(channel, "target"), "path") == "weights";
                    (weights ? morphed_ : animated_).insert_or_assign(*node, true);
                }
        const json& nodes = GltfFile::list(file_.root(), "nodes");
        for (std::size_t i = 0; i < nodes.size(); ++i)
            for (const json& child : GltfFile::list(nodes[i], "children")) {
                if (!child.is_number_unsigned()) continue;
                const auto below = child.get<std::size_t>();
                isChild_.insert_or_assign(below, true);
                if (below < above_.size()) above_[below] = i;
            }
    }

    static std::string defOf(std::size_t node) { return "node" + std::to_string(node); }

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
            if (!node || given_[index]) return file_.warn("the glTF file's nodes are no tree; some are left out");
            given_[index] = true;
            const bool inside = !open.empty();
            out_.beginNode("Transform", animated_.contains(index) ? defOf(index) : std::string(),
                           inside ? "children" : "", {});
            writeTransform(*node);
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
    void writeTransform(const json& node) {
        const auto set = [&](const char* field, Value value) { out_.setField(field, std::move(value), {}); };
        if (const auto m = GltfFile::numbers(node, "matrix", 16)) return writeMatrix(*m);
        if (const auto r = GltfFile::numbers(node, "rotation", 4)) set("rotation", Value(rotationOf(r->data())));
        if (const auto s = GltfFile::numbers(node, "scale", 3)) set("scale", Value(vec3(*s)));
        if (const auto t = GltfFile::numbers(node, "translation", 3)) set("translation", Value(vec3(*t)));
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
            const std::array<double, 4> q = quaternionOf(axes);
            out_.setField("rotation", Value(rotationOf(q.data())), {});
        }
        out_.setField("scale", Value(vec3({length[0], length[1], length[2]})), {});
        out_.setField("translation", Value(vec3({m[12], m[13], m[14]})), {});
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
        else
            writeMeshNode(*mesh, node, number);
    }

    void writeCamera(std::size_t index, const std::string& name) {
        const json* camera = file_.item("cameras", index);
        if (!camera) return;
        const std::string own = GltfFile::text(*camera, "name");
        const std::string description = own.empty() ? name : own;
        const bool flat = GltfFile::text(*camera, "type") == "orthographic";
        const json& lens = GltfFile::object(*camera, flat ? "orthographic" : "perspective");
        Node view(out_, flat ? "OrthoViewpoint" : "Viewpoint", "children");
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
            const double angle = aspect < 1 ? 2 * std::atan(std::tan(vertical / 2) * aspect) : vertical;
            view.set("fieldOfView", static_cast<float>(angle));
        }
        if (const double near = GltfFile::number(lens, "znear", -1); near > 0)
            view.set("nearDistance", static_cast<float>(near));
        if (const double far = GltfFile::number(lens, "zfar", -1); far > 0)
            view.set("farDistance", static_cast<float>(far));
    }
    void writeLight(std::size_t index) {
        const json& all = GltfFile::list(
            GltfFile::object(GltfFile::object(file_.root(), "extensions"), "KHR_lights_punctual"), "lights");
        if (index >= all.size()) return;
        const json& light = all[index];
        const std::string type = GltfFile::text(light, "type");
        const bool directional = type == "directional";
        Node out(out_, directional ? "DirectionalLight" : type == "spot" ? "SpotLight" : "PointLight", "children");
        if (const auto color = GltfFile::numbers(light, "color", 3)) {
            const Vec3f c = vec3(*color);
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
        out.set("beamWidth", static_cast<float>(GltfFile::number(cone, "innerConeAngle", 0)));
        out.set("cutOffAngle", static_cast<float>(GltfFile::number(cone, "outerConeAngle", .785398)));
    }

    // ---- meshes
    void writeMeshNode(std::size_t index, const json& node, std::size_t number) {
        const json* mesh = file_.item("meshes", index);
        if (!mesh) return;
        // Forms of its own are no use to other nodes.
        const bool own = morphed_.contains(number) || !GltfFile::list(node, "weights").empty();
        const std::string def = own ? std::string() : "mesh" + std::to_string(index);
        if (!own && meshGiven_[index]) return out_.useNode(def, "children", {});
        if (!own) meshGiven_[index] = true;
        Node group(out_, "Group", "children", def);
        std::size_t part = 0;
        for (const json& primitive : GltfFile::list(*mesh, "primitives"))
            writePrimitive(primitive, formOf(*mesh, node, number, part++));
    }
    /// How a primitive is formed: the weights of its targets, and the name of its points where they are animated.
    struct Form {
        std::vector<double> weights;
        std::string points;
    };
    Form formOf(const json& mesh, const json& node, std::size_t number, std::size_t part) {
        Form form;
        const json& own = GltfFile::list(node, "weights");
        for (const json& weight : own.empty() ? GltfFile::list(mesh, "weights") : own)
            form.weights.push_back(weight.is_number() ? weight.get<double>() : 0);
        if (morphed_.contains(number)) form.points = pointsOf(number, part);
        return form;
    }
    static std::string pointsOf(std::size_t node, std::size_t part) {
        return defOf(node) + "_points" + std::to_string(part);
    }
    /// Adds the targets' displacements, as much as they weigh.
    void morph(const json& primitive, const char* name, const std::vector<double>& weights, Array<Vec3f>& values) {
        const json& targets = GltfFile::list(primitive, "targets");
        for (std::size_t t = 0; t < std::min(targets.size(), weights.size()); ++t) {
            if (weights[t] == 0 || values.empty()) continue;
            const Array<Vec3f> moves = attribute<Vec3f>(targets[t], name, values.size());
            if (moves.empty()) continue;
            Vec3f* const out = values.mutableData();
            for (std::size_t i = 0; i < values.size(); ++i) out[i] += static_cast<float>(weights[t]) * moves[i];
        }
    }

    template <class T>
    static Array<T> elements(const std::vector<float>& numbers, std::size_t stride) {
        Array<T> result;
        constexpr std::size_t size = sizeof(T) / sizeof(float);
        if (stride < size) return result;
        result.resize(numbers.size() / stride);
        T* out = result.mutableData();
        if (stride == size) {
            std::copy_n(numbers.data(), result.size() * size, reinterpret_cast<float*>(out));
            return result;
        }
        for (std::size_t i = 0; i < result.size(); ++i)
            std::copy_n(numbers.data() + i * stride, size, reinterpret_cast<float*>(out + i));
        return result;
    }
    template <class T>
    Array<T> attribute(const json& attributes, const char* name, std::size_t points) {
        const auto accessor = GltfFile::index(attributes, name);
        if (!accessor) return {};
        if (std::optional<Array<T>> direct = file_.floatArray<T>(*accessor))
            return points != 0 && direct->size() != points ? Array<T>() : *std::move(direct);
        std::size_t stride = 0;
        const std::vector<float> numbers = file_.floats(*accessor, stride);
        Array<T> result;
        if constexpr (std::is_same_v<T, ColorRGBA>) {
            result.resize(stride >= 3 ? numbers.size() / stride : 0);
            for (std::size_t i = 0; i < result.size(); ++i)
                result.mutableData()[i] = {numbers[i * stride], numbers[i * stride + 1], numbers[i * stride + 2],
                                           stride > 3 ? numbers[i * stride + 3] : 1};
        } else {
            result = elements<T>(numbers, stride);
        }
        if (points != 0 && result.size() != points) return {};
        return result;
    }
    void writePrimitive(const json& primitive, const Form& form, bool skinned = false) {
        const json& attributes = GltfFile::object(primitive, "attributes");
        ImportedMesh mesh;
        mesh.points = attribute<Vec3f>(attributes, "POSITION", 0);
        const std::size_t count = mesh.points.size();
        if (count == 0) return file_.warn("a primitive of the glTF file has no positions; it is left out");
        morph(primitive, "POSITION", form.weights, mesh.points);
        Array<std::int32_t> indices;
        if (const auto accessor = GltfFile::index(primitive, "indices")) {
            indices = file_.indices(*accessor);
        } else {
            indices.resize(count);
            std::iota(indices.mutableData(), indices.mutableData() + count, 0);
        }
        std::uint32_t most = 0;  // negative ones are large
        for (const std::int32_t i : indices) most = std::max(most, static_cast<std::uint32_t>(i));
        if (most >= count)
            return file_.warn("a primitive of the glTF file has indices beyond its points; it is left out");
        const std::size_t mode = GltfFile::index(primitive, "mode").value_or(4);
        mesh.normals = attribute<Vec3f>(attributes, "NORMAL", count);
        morph(primitive, "NORMAL", form.weights, mesh.normals);
        const bool smooth = !mesh.normals.empty();
        // Of what moves, normals are made from where the points are.
        if (skinned || !form.points.empty()) mesh.normals = {};
        mesh.texCoords = attribute<Vec2f>(attributes, "TEXCOORD_0", count);
        // The origin of a picture is its upper left corner there, its lower left one here.
        for (std::size_t i = 0; i < mesh.texCoords.size(); ++i)
            mesh.texCoords.mutableData()[i].y = 1 - mesh.texCoords.mutableData()[i].y;
        mesh.colors = attribute<ColorRGBA>(attributes, "COLOR_0", count);
        mesh.smooth = smooth;  // without normals faces are flat
        mesh.pointsName = form.points;
        mesh.pointsGiven = skinned;
        const json* material = file_.item("materials", GltfFile::index(primitive, "material").value_or(kNone));
        mesh.solid = !(material && GltfFile::flag(*material, "doubleSided"));
        Node shape(out_, "Shape", skinned ? "skin" : "children");
        writeAppearance(material);
        if (mode == 0) {
            mesh.faces = {};
            return writeMesh(out_, std::move(mesh));
        }
        if (mode <= 3) return writeLines(mesh, indices, mode);
        mesh.triangles = true;
        mesh.faces = triangles(indices, mode);
        if (!mesh.faces.empty()) writeMesh(out_, std::move(mesh));
    }
    static Array<std::int32_t> triangles(const Array<std::int32_t>& indices, std::size_t mode) {
        if (mode == 4) {
            Array<std::int32_t> whole = indices;
            whole.resize(indices.size() / 3 * 3);
            return whole;
        }
        Array<std::int32_t> result;
        for (std::size_t i = 2; i < indices.size(); ++i) {
            const bool turned = mode == 5 && i % 2 != 0;
            const std::int32_t first = mode == 6 ? indices[0] : indices[turned ? i - 1 : i - 2];
            const std::int32_t second = mode == 6 ? indices[i - 1] : indices[turned ? i - 2 : i - 1];
            result.push_back(first);
            result.push_back(second);
            result.push_back(indices[i]);
        }
        return result;
    }
    void writeLines(ImportedMesh& mesh, const Array<std::int32_t>& indices, std::size_t mode) {
        Array<std::int32_t> lines;
        for (std::size_t i = 0; i < indices.size(); ++i) {
            lines.push_back(indices[i]);
            if (mode == 1 && i % 2 == 1) lines.push_back(-1);
        }
        if (mode == 2 && !indices.empty()) lines.push_back(indices[0]);
        Node set(out_, "IndexedLineSet", "geometry");
        set.set("coordIndex", std::move(lines));
        if (mesh.pointsGiven) {
            out_.useNode(mesh.pointsName, "coord", {});
        } else {
            Node coordinate(out_, "Coordinate", "coord", mesh.pointsName);
            coordinate.set("point", std::move(mesh.points));
        }
        if (mesh.colors.empty()) return;
        Node color(out_, "ColorRGBA", "color");
        color.set("color", std::move(mesh.colors));
    }

    // ---- skins
    struct Skinned {
        std::size_t node, mesh, skin;
    };
    /// A skin's joints, and what they are called.
    struct Figure {
        GltfSkin skin;
        std::string name;
        std::string joint(std::size_t i) const { return name + "_joint" + std::to_string(i); }
    };
    /// One for each primitive, which has points of its own.
    void writeFigures(std::size_t node, std::size_t meshIndex, std::size_t skinIndex) {
        const json* mesh = file_.item("meshes", meshIndex);
        const json* it = file_.item("nodes", node);
        if (!mesh || !it) return;
        std::size_t part = 0;
        for (const json& primitive : GltfFile::list(*mesh, "primitives")) {
            Figure figure{GltfSkin(file_, skinIndex, above_), defOf(node) + "_figure" + std::to_string(part)};
            Form form = formOf(*mesh, *it, node, part);
            form.points = pointsOf(node, part++);
            writeFigure(figure, primitive, form);
            figures_.push_back(std::move(figure));
        }
    }
    void writeFigure(const Figure& figure, const json& primitive, const Form& form) {
        const json& attributes = GltfFile::object(primitive, "attributes");
        Array<Vec3f> points = attribute<Vec3f>(attributes, "POSITION", 0);
        if (points.empty()) return file_.warn("a primitive of the glTF file has no positions; it is left out");
        const auto influences = figure.skin.influences(file_, attributes, points.size());
        morph(primitive, "POSITION", form.weights, points);
        Node humanoid(out_, "HAnimHumanoid", {}, figure.name);
        humanoid.set("name", String(figure.name));
        {
            Node coordinate(out_, "Coordinate", "skinCoord", form.points);
            coordinate.set("point", std::move(points));
        }
        const auto& joints = figure.skin.joints();
        for (std::size_t i = 0; i < joints.size(); ++i)
            if (joints[i].above == GltfSkin::kNone) writeJoints(figure, influences, i);
        for (std::size_t i = 0; i < joints.size(); ++i) out_.useNode(figure.joint(i), "joints", {});
        writePrimitive(primitive, form, true);
    }
    void writeJoints(const Figure& figure, const std::vector<GltfSkin::Influence>& influences, std::size_t root) {
        struct Open {
            std::size_t joint, next;
        };
        std::vector<Open> open;
        const auto begin = [&](std::size_t i) {
            const GltfSkin::Joint& joint = figure.skin.joints()[i];
            const json* node = file_.item("nodes", joint.node);
            const GltfPlace place = node ? placeOf(*node) : GltfPlace{};
            const std::string name = node ? GltfFile::text(*node, "name") : std::string();
            out_.beginNode("HAnimJoint", figure.joint(i), open.empty() ? "skeleton" : "children", {});
            const auto set = [&](const char* field, auto value) { out_.setField(field, Value(std::move(value)), {}); };
            set("name", String(name.empty() ? figure.joint(i) : name));
            set("center", joint.center);
            set("rotation", joint.rotation(place.rotation));
            set("translation", joint.translation(place.translation));
            if (const Vec3f scale = joint.scale(place.scale); scale != Vec3f(1)) {
                set("scale", scale);
                set("scaleOrientation", joint.scaleOrientation);
            }
            if (!influences[i].points.empty()) {
                set("skinCoordIndex", influences[i].points);
                set("skinCoordWeight", influences[i].weights);
            }
            open.push_back({i, 0});
        };
        begin(root);
        while (!open.empty()) {
            const std::vector<std::size_t>& below = figure.skin.joints()[open.back().joint].below;
            if (open.back().next < below.size()) {
                begin(below[open.back().next++]);
            } else {
                out_.endNode({});
                open.pop_back();
            }
        }
    }

    // ---- materials
    void writeAppearance(const json* material) {
        Node appearance(out_, "Appearance", "appearance");
        const json& it = material ? *material : kEmpty;
        const std::string mode = GltfFile::text(it, "alphaMode");
        appearance.set("alphaMode", String(mode.empty() ? "OPAQUE" : mode));
        if (mode == "MASK") appearance.set("alphaCutoff", static_cast<float>(GltfFile::number(it, "alphaCutoff", .5)));
        const json& metal = GltfFile::object(it, "pbrMetallicRoughness");
        const auto base = GltfFile::numbers(metal, "baseColorFactor", 4).value_or(std::vector<double>{1, 1, 1, 1});
        const Color color{static_cast<float>(base[0]), static_cast<float>(base[1]), static_cast<float>(base[2])};
        const auto transparency = static_cast<float>(1 - base[3]);
        const bool unlit = GltfFile::object(it, "extensions").contains("KHR_materials_unlit");
        Node out(out_, unlit ? "UnlitMaterial" : "PhysicalMaterial", "material");
        out.set(unlit ? "emissiveColor" : "baseColor", color);
        if (transparency > 0) out.set("transparency", transparency);
        if (unlit) return writeTexture(GltfFile::object(metal, "baseColorTexture"), "emissiveTexture");
        out.set("metallic", static_cast<float>(GltfFile::number(metal, "metallicFactor", 1)));
        out.set("roughness", static_cast<float>(GltfFile::number(metal, "roughnessFactor", 1)));
        if (const auto e = GltfFile::numbers(it, "emissiveFactor", 3)) {
            const double strength = GltfFile::number(
                GltfFile::object(GltfFile::object(it, "extensions"), "KHR_materials_emissive_strength"),
                "emissiveStrength", 1);
            const Vec3f c = vec3({(*e)[0] * strength, (*e)[1] * strength, (*e)[2] * strength});
            out.set("emissiveColor", Color{c.x, c.y, c.z});
        }
        const json& normal = GltfFile::object(it, "normalTexture");
        const json& occlusion = GltfFile::object(it, "occlusionTexture");
        if (normal.contains("scale")) out.set("normalScale", static_cast<float>(GltfFile::number(normal, "scale", 1)));
        if (occlusion.contains("strength"))
            out.set("occlusionStrength", static_cast<float>(GltfFile::number(occlusion, "strength", 1)));
        writeTexture(GltfFile::object(metal, "baseColorTexture"), "baseTexture");
        writeTexture(GltfFile::object(metal, "metallicRoughnessTexture"), "metallicRoughnessTexture");
        writeTexture(GltfFile::object(it, "emissiveTexture"), "emissiveTexture");
        writeTexture(normal, "normalTexture");
        writeTexture(occlusion, "occlusionTexture");
    }
    void writeTexture(const json& reference, const char* field) {
        const auto index = GltfFile::index(reference, "index");
        if (!index) return;
        if (GltfFile::index(reference, "texCoord").value_or(0) != 0)
            file_.warn("a texture of the glTF file asks for a second set of coordinates; the first is taken");
        if (GltfFile::object(reference, "extensions").contains("KHR_texture_transform"))
            file_.warn("transforms of textures of the glTF file are not imported");
        const std::string def = "texture" + std::to_string(*index);
        if (textureGiven_.contains(*index)) return out_.useNode(def, field, {});
        const json* texture = file_.item("textures", *index);
        const json* image =
            texture ? file_.item("images", GltfFile::index(*texture, "source").value_or(kNone)) : nullptr;
        if (!image) return file_.warn("a texture of the glTF file has no picture; it is left out");
        std::string url = GltfFile::text(*image, "uri");
        if (url.empty()) {
            const std::string_view bytes = file_.bufferView(GltfFile::index(*image, "bufferView").value_or(kNone));
            const std::string type = GltfFile::text(*image, "mimeType");
            url = "data:" + (type.empty() ? std::string("image/png") : type) + ";base64," + toBase64(bytes);
        }
        textureGiven_.insert_or_assign(*index, true);
        Node out(out_, "ImageTexture", field, def);
        const json* sampler = file_.item("samplers", GltfFile::index(*texture, "sampler").value_or(kNone));
        constexpr std::size_t clamp = 33071;
        if (sampler && GltfFile::index(*sampler, "wrapS") == clamp) out.set("repeatS", false);
        if (sampler && GltfFile::index(*sampler, "wrapT") == clamp) out.set("repeatT", false);
        out.set("url", Array<String>{String(url)});
    }

    // ---- animations
    void writeAnimation(const json& animation, std::size_t number) {
        const json& channels = GltfFile::list(animation, "channels");
        const json& samplers = GltfFile::list(animation, "samplers");
        double length = 0;
        std::map<std::size_t, std::vector<float>> times;
        for (const json& channel : channels) {
            const auto sampler = GltfFile::index(channel, "sampler");
            if (!sampler || *sampler >= samplers.size() || times.contains(*sampler)) continue;
            std::size_t components = 0;
            std::vector<float> keys =
                file_.floats(GltfFile::index(samplers[*sampler], "input").value_or(kNone), components);
            if (components != 1 || keys.empty()) continue;
            length = std::max(length, static_cast<double>(keys.back()));
            times.emplace(*sampler, std::move(keys));
        }
        if (times.empty() || !(length > 0)) return;
        const std::string clock = "animation" + std::to_string(number);
        {
            Node sensor(out_, "TimeSensor", {}, clock);
            sensor.set("cycleInterval", Time{length}).set("loop", true);
            if (const std::string name = GltfFile::text(animation, "name"); !name.empty())
                sensor.set("description", String(name));
        }
        for (std::size_t i = 0; i < channels.size(); ++i) {
            const auto sampler = GltfFile::index(channels[i], "sampler");
            const auto node = GltfFile::index(GltfFile::object(channels[i], "target"), "node");
            const std::string path = GltfFile::text(GltfFile::object(channels[i], "target"), "path");
            if (!sampler || !node || !times.contains(*sampler)) continue;
            const std::string def = clock + "_" + std::to_string(i);
            if (*node >= given_.size() || !given_[*node]) continue;
            if (path == "weights") {
                writeWeights(samplers[*sampler], times[*sampler], length, clock, def, *node);
                continue;
            }
            writeChannel(samplers[*sampler], times[*sampler], length, path, clock, def, defOf(*node), nullptr);
            for (const Figure& figure : figures_)
                for (std::size_t j = 0; j < figure.skin.joints().size(); ++j)
                    if (figure.skin.joints()[j].node == *node)
                        writeChannel(samplers[*sampler], times[*sampler], length, path, clock,
                                     def + "_" + figure.joint(j), figure.joint(j), &figure.skin.joints()[j]);
        }
    }
    void writeChannel(const json& sampler, const std::vector<float>& times, double length, const std::string& path,
                      const std::string& clock, const std::string& def, const std::string& target,
                      const GltfSkin::Joint* joint) {
        const std::string how = GltfFile::text(sampler, "interpolation");
        std::size_t size = 0;
        const std::vector<float> numbers = file_.floats(GltfFile::index(sampler, "output").value_or(kNone), size);
        const bool turns = path == "rotation", cubic = how == "CUBICSPLINE", step = how == "STEP";
        if (cubic) file_.warn("splines of the glTF file's animations are played as lines through their keys");
        // A spline has two tangents beside each value.
        const std::size_t each = cubic ? 3 : 1, first = cubic ? 1 : 0;
        if (size != (turns ? 4u : 3u) || numbers.size() != times.size() * each * size)
            return file_.warn("an animation of the glTF file has another number of values than keys; it is left out");
        Array<float> keys;
        Array<Rotation> rotations;
        Array<Vec3f> places;
        const auto add = [&](double key, std::size_t i) {
            keys.push_back(static_cast<float>(key));
            const float* v = numbers.data() + (i * each + first) * size;
            if (turns && joint) {
                rotations.push_back(joint->rotation(glm::normalize(glm::dquat(v[3], v[0], v[1], v[2]))));
            } else if (turns) {
                const double q[4] = {v[0], v[1], v[2], v[3]};
                rotations.push_back(rotationOf(q));
            } else if (joint) {
                const glm::dvec3 value(v[0], v[1], v[2]);
                places.push_back(path == "scale" ? joint->scale(value) : joint->translation(value));
            } else {
                places.push_back({v[0], v[1], v[2]});
            }
        };
        for (std::size_t i = 0; i < times.size(); ++i) {
            const double key = static_cast<double>(times[i]) / length;
            if (step && i > 0) add(key, i - 1);
            add(key, i);
        }
        {
            Node out(out_, turns ? "OrientationInterpolator" : "PositionInterpolator", {}, def);
            out.set("key", std::move(keys));
            if (turns)
                out.set("keyValue", std::move(rotations));
            else
                out.set("keyValue", std::move(places));
        }
        out_.route(clock, "fraction_changed", def, "set_fraction", {});
        out_.route(def, "value_changed", target, path, {});
    }

    /// Of what weighs more and less over time, the points at each key: between keys both go along straight lines.
    void writeWeights(const json& sampler, const std::vector<float>& times, double length, const std::string& clock,
                      const std::string& def, std::size_t nodeIndex) {
        const json* node = file_.item("nodes", nodeIndex);
        const json* mesh = node ? file_.item("meshes", GltfFile::index(*node, "mesh").value_or(kNone)) : nullptr;
        if (!mesh) return;
        std::size_t size = 0;
        const std::vector<float> numbers = file_.floats(GltfFile::index(sampler, "output").value_or(kNone), size);
        const std::string how = GltfFile::text(sampler, "interpolation");
        const bool cubic = how == "CUBICSPLINE", step = how == "STEP";
        const std::size_t each = cubic ? 3 : 1, groups = times.size() * each;
        if (size != 1 || numbers.empty() || numbers.size() % groups != 0)
            return file_.warn("an animation of the glTF file has another number of values than keys; it is left out");
        if (cubic) file_.warn("splines of the glTF file's animations are played as lines through their keys");
        const std::size_t targets = numbers.size() / groups;
        std::size_t part = 0;
        for (const json& primitive : GltfFile::list(*mesh, "primitives")) {
            const std::string name = def + "_part" + std::to_string(part);
            const std::string points = pointsOf(nodeIndex, part++);
            const Array<Vec3f> rest = attribute<Vec3f>(GltfFile::object(primitive, "attributes"), "POSITION", 0);
            constexpr std::size_t most = std::size_t{1} << 26;  // points in all keys
            if (rest.empty() || rest.size() > most / (2 * times.size())) {
                file_.warn("animated weights of the glTF file move too many points; they rest");
                continue;
            }
            Array<float> keys;
            Array<Vec3f> values;
            const auto add = [&](double key, std::size_t i) {
                const float* first = numbers.data() + (i * each + (cubic ? 1 : 0)) * targets;
                Array<Vec3f> form = rest;
                morph(primitive, "POSITION", std::vector<double>(first, first + targets), form);
                keys.push_back(static_cast<float>(key));
                values.append({form.data(), form.size()});
            };
            for (std::size_t i = 0; i < times.size(); ++i) {
                const double key = static_cast<double>(times[i]) / length;
                if (step && i > 0) add(key, i - 1);
                add(key, i);
            }
            Node(out_, "CoordinateInterpolator", {}, name)
                .set("key", std::move(keys))
                .set("keyValue", std::move(values));
            out_.route(clock, "fraction_changed", name, "set_fraction", {});
            out_.route(name, "value_changed", points, "point", {});
        }
    }

    inline static const json kEmpty = json::object();
    GltfFile& file_;
    DocumentHandler& out_;
    std::vector<bool> given_, meshGiven_;
    std::vector<std::size_t> above_;  // each node's, or kNone
    std::vector<Skinned> skinned_;
    std::vector<Figure> figures_;
    std::map<std::size_t, bool> morphed_, animated_, isChild_, textureGiven_;
};

}  // namespace

bool importGltf(const ImportInput& input, DocumentHandler& handler, Diagnostics& diagnostics) {
    GltfFile file(input, diagnostics);
    return file.open() && GltfImporter(file, handler).run();
}

}  // namespace rtsg::detail
