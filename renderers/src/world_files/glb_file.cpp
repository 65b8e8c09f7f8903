// Writes GLB: lists of JSON objects, and the bytes that they refer to.
#include "glb_file.h"

#include <algorithm>
#include <cmath>

#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/field_text.h>
#include <rtsg/core/placement.h>
#include <rtsg/core/x3d.h>

namespace rtsg::mesh_files {

namespace {

constexpr std::size_t kFloats = 5126, kIntegers = 5125;

template <class T>
T fieldOf(const Node* node, std::string_view name, T otherwise) {
    const FieldIndex index = node ? node->type().findExact(name) : kNoField;
    if (index == kNoField || node->type().fields[index].type != FieldTypeOf<T>::value) return otherwise;
    return *static_cast<const T*>(node->storage(index));
}

glm::dquat quaternionOf(const Rotation& r) {
    const glm::dvec3 axis(r.x, r.y, r.z);
    const double length = glm::length(axis);
    return length > 0 ? glm::angleAxis(double{r.angle}, axis / length) : glm::dquat(1, 0, 0, 0);
}

std::string numbersOf(const glm::dvec3& v) {
    return fmt::format("[{},{},{}]", v.x, v.y, v.z);
}

std::string matrixMember(const glm::dmat4& m) {
    std::string text;
    for (int c = 0; c < 4; ++c)
        for (int r = 0; r < 4; ++r) text += fmt::format("{}{}", text.empty() ? "" : ",", m[c][r]);
    return "\"matrix\":[" + text + "]";
}

glm::dmat4 matrixOf(const WorldFromLocal& m) {
    glm::dmat4 result(1);
    for (int c = 0; c < 4; ++c)
        for (int r = 0; r < 3; ++r) result[c][r] = m[c][r];
    return result;
}

bool areAlike(const glm::dmat4& a, const glm::dmat4& b) {
    double size = 1, apart = 0;
    for (int c = 0; c < 4; ++c)
        for (int r = 0; r < 3; ++r) {
            size = std::max(size, std::abs(b[c][r]));
            apart = std::max(apart, std::abs(a[c][r] - b[c][r]));
        }
    return apart <= 1e-6 * size;
}

/// Whether a translation, a rotation and a scale can express a Transform.
bool isPlain(const Node& transform) {
    using T = x3d::Transform;
    const Vec3f s = transform.get(T::scale);
    return transform.get(T::scaleOrientation).angle == 0 || (s.x == s.y && s.y == s.z);
}

}  // namespace

GlbWriter::GlbWriter(const Scene& scene, const Shapes& shapes, Diagnostics& diagnostics)
    : scene_(scene), shapes_(shapes) {
    findMovers(diagnostics);
    for (const Instance* instance : shapes.instances) addShape(*instance);
    for (const Placed& placed : shapes.flattener.placed())
        if (placed.id) addPlaced(placed);
    addClips();
}

bool GlbWriter::fits() const {
    return binary_.size() + accessors_.text.size() + nodes_.size() * 256 < 0xF0000000u;
}

void GlbWriter::findMovers(Diagnostics& diagnostics) {
    std::size_t leftOut = 0, skins = 0;
    clips_ = findClips(scene_, leftOut);
    for (GlbClip& clip : clips_)
        leftOut += std::erase_if(clip.channels, [&](const GlbChannel& channel) {
            const bool plain = isPlain(scene_.node(channel.transform));
            if (plain) movers_.insert(channel.transform);
            return !plain;
        });
    scene_.forEachNode([&](const Node& node) { skins += node.is(x3d::HAnimHumanoid::type); });
    if (leftOut != 0)
        diagnostics.warning({},
                            fmt::format("{} things that clocks move are none of glTF's here (points, colours, joints, "
                                        "what turns its scale): they stand as they do now",
                                        leftOut));
    if (skins != 0)
        diagnostics.warning({}, fmt::format("{} figures are written as they stand now, without joints", skins));
}

// ---- places --------------------------------------------------------------------------------------------------------

std::size_t GlbWriter::addNode(std::size_t parent, std::string members) {
    nodes_.push_back({std::move(members), {}});
    (parent == kRoot ? roots_ : nodes_[parent].children).push_back(nodes_.size() - 1);
    return nodes_.size() - 1;
}

std::string GlbWriter::nameOf(NodeId node) const {
    const std::string_view name = scene_.name(node);
    return name.empty() ? std::string() : ",\"name\":" + jsonString(name);
}

/// A Transform rotates and scales around its centre: the node stands there, and its children are moved back.
std::size_t GlbWriter::moverNode(std::size_t parent, const Node& transform, const std::vector<NodeId>& path) {
    const auto [found, isNew] = moverNodes_.try_emplace(path, 0);
    if (!isNew) return found->second;
    using T = x3d::Transform;
    const glm::dvec3 place = glm::dvec3(transform.get(T::translation)) + glm::dvec3(transform.get(T::center));
    const glm::dquat q = quaternionOf(transform.get(T::rotation));
    found->second = addNode(
        parent, fmt::format(R"("translation":{},"rotation":[{},{},{},{}],"scale":{}{})", numbersOf(place), q.x, q.y,
                            q.z, q.w, numbersOf(glm::dvec3(transform.get(T::scale))), nameOf(transform.id())));
    nodesOfMover_.emplace(transform.id(), found->second);
    return found->second;
}

std::size_t GlbWriter::placeOf(const std::vector<NodeId>& path, const WorldFromLocal& worldFromLocal,
                               glm::dmat4& matrix) {
    const glm::dmat4 world = matrixOf(worldFromLocal);
    matrix = world;
    if (movers_.empty()) return kRoot;
    // The path's own Transforms say where it leads; a Billboard or a layout may say otherwise, and then nothing moves.
    glm::dmat4 all(1);
    for (const NodeId id : path) all = all * parentFromLocal(scene_, scene_.node(id));
    if (!areAlike(all, world)) return kRoot;
    std::size_t parent = kRoot;
    matrix = glm::dmat4(1);
    for (std::size_t i = 0; i < path.size(); ++i) {
        const Node& node = scene_.node(path[i]);
        if (!movers_.contains(path[i])) {
            matrix = matrix * parentFromLocal(scene_, node);
            continue;
        }
        const std::vector<NodeId> here(path.begin(), path.begin() + static_cast<std::ptrdiff_t>(i) + 1);
        if (matrix != glm::dmat4(1) && !moverNodes_.contains(here)) parent = addNode(parent, matrixMember(matrix));
        parent = moverNode(parent, node, here);
        matrix = glm::translate(glm::dmat4(1), -glm::dvec3(node.get(x3d::Transform::center)));
    }
    return parent;
}

void GlbWriter::addShape(const Instance& instance) {
    glm::dmat4 matrix(1);
    const std::size_t parent = placeOf(shapes_.flattener.path(instance.id), instance.worldFromLocal, matrix);
    const std::size_t mesh = meshNumber(shapes_.meshOf(instance), instance);
    addNode(parent, fmt::format(R"("mesh":{},{}{})", mesh, matrixMember(matrix), nameOf(instance.shape)));
}

void GlbWriter::addPlaced(const Placed& placed) {
    const Node* node = scene_.find(placed.node);
    if (!node) return;
    if (node->is(x3d::Viewpoint::type) || node->is(x3d::OrthoViewpoint::type))
        addCamera(placed, *node);
    else if (node->is(x3d::DirectionalLight::type) || node->is(x3d::PointLight::type) || node->is(x3d::SpotLight::type))
        addLight(placed, *node);
}

void GlbWriter::addPlacedNode(const Placed& placed, const glm::dmat4& local, const std::string& members) {
    glm::dmat4 matrix(1);
    const std::size_t parent = placeOf(shapes_.flattener.placedPath(placed.id), placed.worldFromLocal, matrix);
    addNode(parent, members + "," + matrixMember(matrix * local) + nameOf(placed.node));
}

void GlbWriter::addCamera(const Placed& placed, const Node& node) {
    const double near = double{fieldOf(&node, "nearDistance", -1.0f)},
                 far = double{fieldOf(&node, "farDistance", -1.0f)};
    std::string lens, type = "perspective";
    if (node.is(x3d::Viewpoint::type)) {
        // X3D's angle is that of the shorter side: of pictures that are wider than high, glTF's.
        lens = fmt::format(R"("yfov":{},"znear":{})", node.get(x3d::Viewpoint::fieldOfView), near > 0 ? near : .01);
        if (far > 0) lens += fmt::format(R"(,"zfar":{})", far);
    } else {
        const Array<float>& sides = node.get(x3d::OrthoViewpoint::fieldOfView);
        type = "orthographic";
        const bool four = sides.size() >= 4;
        lens = fmt::format(R"("xmag":{},"ymag":{},"znear":{},"zfar":{})", four ? (sides[2] - sides[0]) / 2 : 1,
                           four ? (sides[3] - sides[1]) / 2 : 1, near > 0 ? near : 0, far > 0 ? far : 1e4);
    }
    const std::string name = fieldOf(&node, "description", String()).str();
    const std::size_t number = cameras_.add(fmt::format(R"({{"type":"{0}","{0}":{{{1}}}{2}}})", type, lens,
                                                        name.empty() ? "" : ",\"name\":" + jsonString(name)));
    const glm::dmat4 local = glm::translate(glm::dmat4(1), glm::dvec3(fieldOf(&node, "position", Vec3f(0)))) *
                             glm::mat4_cast(quaternionOf(fieldOf(&node, "orientation", Rotation{})));
    addPlacedNode(placed, local, fmt::format("\"camera\":{}", number));
}

void GlbWriter::addLight(const Placed& placed, const Node& node) {
    const bool directional = node.is(x3d::DirectionalLight::type), spot = node.is(x3d::SpotLight::type);
    if (!fieldOf(&node, "on", true)) return;
    const Color color = fieldOf(&node, "color", Color{1, 1, 1});
    std::string text = fmt::format(R"({{"type":"{}","color":[{},{},{}],"intensity":{})",
                                   directional ? "directional"
                                   : spot      ? "spot"
                                               : "point",
                                   color.r, color.g, color.b, fieldOf(&node, "intensity", 1.0f));
    if (!directional) text += fmt::format(R"(,"range":{})", fieldOf(&node, "radius", 100.0f));
    if (spot) {
        const float outer = std::clamp(fieldOf(&node, "cutOffAngle", .7854f), 1e-3f, 1.5707f);
        const float inner = std::clamp(fieldOf(&node, "beamWidth", .5890f), 0.0f, outer * .999f);
        text += fmt::format(R"(,"spot":{{"innerConeAngle":{},"outerConeAngle":{}}})", inner, outer);
    }
    const std::size_t number = lights_.add(text + "}");
    extensions_.insert("KHR_lights_punctual");
    // It shines along -z of its node.
    const glm::dvec3 way(fieldOf(&node, "direction", Vec3f(0, 0, -1)));
    const glm::dvec3 z = glm::length(way) > 0 ? -glm::normalize(way) : glm::dvec3(0, 0, 1);
    const glm::dvec3 x = glm::normalize(glm::cross(std::abs(z.y) < .9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0), z));
    const glm::dmat4 turned(glm::dvec4(x, 0), glm::dvec4(glm::cross(z, x), 0), glm::dvec4(z, 0),
                            glm::dvec4(0, 0, 0, 1));
    const glm::dvec3 place(fieldOf(&node, "location", Vec3f(0)));
    addPlacedNode(placed, glm::translate(glm::dmat4(1), place) * turned,
                  fmt::format(R"("extensions":{{"KHR_lights_punctual":{{"light":{}}}}})", number));
}

void GlbWriter::addClips() {
    for (GlbClip& clip : clips_) {
        List channels, samplers;
        for (GlbChannel& channel : clip.channels) {
            const auto [first, last] = nodesOfMover_.equal_range(channel.transform);
            if (first == last) continue;  // nothing that is written stands below it
            if (channel.path == "translation") {
                const Vec3f center = scene_.node(channel.transform).get(x3d::Transform::center);
                for (std::size_t i = 0; i < channel.values.size(); ++i)
                    channel.values[i] += center[static_cast<int>(i % 3)];
            }
            const std::size_t count = channel.times.size();
            const std::size_t input =
                accessor(channel.times.data(), count * sizeof(float), count, "SCALAR", kFloats,
                         fmt::format(R"(,"min":[{}],"max":[{}])", channel.times.front(), channel.times.back()));
            const std::size_t output = accessor(channel.values.data(), channel.values.size() * sizeof(float), count,
                                                channel.path == "rotation" ? "VEC4" : "VEC3", kFloats);
            const std::size_t sampler = samplers.add(fmt::format(R"({{"input":{},"output":{}}})", input, output));
            for (auto at = first; at != last; ++at)
                channels.add(fmt::format(R"({{"sampler":{},"target":{{"node":{},"path":"{}"}}}})", sampler, at->second,
                                         channel.path));
        }
        if (channels.count == 0) continue;
        const std::string name = clip.name.empty() ? std::string() : ",\"name\":" + jsonString(clip.name);
        animations_.add(fmt::format(R"({{"channels":[{}],"samplers":[{}]{}}})", channels.text, samplers.text, name));
    }
}

// ---- meshes and materials ------------------------------------------------------------------------------------------

std::size_t GlbWriter::accessor(const void* values, std::size_t bytes, std::size_t count, const char* type,
                                std::size_t component, const std::string& more) {
    pad(binary_, '\0');
    const std::size_t view =
        views_.add(fmt::format(R"({{"buffer":0,"byteOffset":{},"byteLength":{}}})", binary_.size(), bytes));
    binary_.append(static_cast<const char*>(values), bytes);
    return accessors_.add(fmt::format(R"({{"bufferView":{},"componentType":{},"count":{},"type":"{}"{}}})", view,
                                      component, count, type, more));
}

std::string GlbWriter::primitiveOf(const Mesh& mesh, NodeId geometry) {
    auto& known = primitives_[geometry.value];
    if (!known.empty()) return known;
    VertexArrays arrays = vertexArrays(mesh);
    Bounds bounds;
    for (const Vec3f& p : arrays.positions) bounds.extend(p);
    const std::string limits = fmt::format(R"(,"min":[{},{},{}],"max":[{},{},{}])", bounds.min.x, bounds.min.y,
                                           bounds.min.z, bounds.max.x, bounds.max.y, bounds.max.z);
    std::string attributes = fmt::format(R"("POSITION":{})", accessor(arrays.positions, "VEC3", kFloats, limits));
    if (!arrays.normals.empty())
        attributes += fmt::format(R"(,"NORMAL":{})", accessor(arrays.normals, "VEC3", kFloats));
    if (!arrays.texCoords.empty()) {
        Array<Vec2f> flipped = arrays.texCoords;  // pictures begin at their upper left corner there
        for (std::size_t i = 0; i < flipped.size(); ++i) flipped.mutableData()[i].y = 1 - flipped.mutableData()[i].y;
        attributes += fmt::format(R"(,"TEXCOORD_0":{})", accessor(flipped, "VEC2", kFloats));
    }
    if (!arrays.colors.empty()) attributes += fmt::format(R"(,"COLOR_0":{})", accessor(arrays.colors, "VEC4", kFloats));
    known =
        fmt::format(R"("attributes":{{{}}},"indices":{})", attributes, accessor(arrays.triangles, "SCALAR", kIntegers));
    return known;
}

std::size_t GlbWriter::meshNumber(const Mesh& mesh, const Instance& instance) {
    const auto [found, isNew] =
        meshNumbers_.try_emplace({instance.geometry.value, instance.appearance.value}, meshes_.count);
    if (isNew)
        meshes_.add(fmt::format(R"({{"primitives":[{{{},"material":{}}}]}})", primitiveOf(mesh, instance.geometry),
                                materialNumber(instance.appearance, mesh.solid)));
    return found->second;
}

const Node* GlbWriter::childOf(const Node* node, std::string_view name) const {
    const NodeId id = fieldOf(node, name, NodeId{});
    return id ? scene_.find(id) : nullptr;
}

std::string GlbWriter::texture(const Node* node, const char* name) {
    const Array<String> urls = fieldOf(node, "url", Array<String>());
    if (!node || urls.empty()) return {};
    const std::size_t image = images_.add(fmt::format(R"({{"uri":{}}})", jsonString(urls[0].view())));
    return fmt::format(R"(,"{}":{{"index":{}}})", name, textures_.add(fmt::format(R"({{"source":{}}})", image)));
}

std::size_t GlbWriter::materialNumber(NodeId appearanceId, bool solid) {
    const auto [found, isNew] = materialNumbers_.try_emplace({appearanceId.value, solid}, materials_.count);
    if (!isNew) return found->second;
    const Node* appearance = appearanceId ? scene_.find(appearanceId) : nullptr;
    const Node* material = childOf(appearance, "material");
    const bool physical = material && material->is(x3d::PhysicalMaterial::type);
    const bool unlit = !material || material->is(x3d::UnlitMaterial::type);
    const Color color = fieldOf(material,
                                unlit      ? "emissiveColor"
                                : physical ? "baseColor"
                                           : "diffuseColor",
                                Color{1, 1, 1});
    const Color glow = unlit ? Color{0, 0, 0} : fieldOf(material, "emissiveColor", Color{0, 0, 0});
    const float strength = std::max({glow.r, glow.g, glow.b, 1.0f});
    const float opacity = 1 - fieldOf(material, "transparency", 0.0f);
    const Node* base = childOf(material, physical ? "baseTexture" : unlit ? "emissiveTexture" : "diffuseTexture");
    if (!base) base = childOf(appearance, "texture");
    const std::string mode = fieldOf(appearance, "alphaMode", String("AUTO")).str();
    std::string text = fmt::format(
        R"({{"pbrMetallicRoughness":{{"baseColorFactor":[{},{},{},{}],"metallicFactor":{},"roughnessFactor":{}{}{}}},)"
        R"("emissiveFactor":[{},{},{}],"doubleSided":{},"alphaMode":"{}")",
        color.r, color.g, color.b, opacity, physical ? fieldOf(material, "metallic", 1.0f) : 0.0f,
        physical ? fieldOf(material, "roughness", 1.0f) : 1.0f, texture(base, "baseColorTexture"),
        texture(childOf(material, "metallicRoughnessTexture"), "metallicRoughnessTexture"), glow.r / strength,
        glow.g / strength, glow.b / strength, !solid,
        mode == "MASK" || mode == "BLEND" || mode == "OPAQUE" ? mode
        : opacity < 1                                         ? "BLEND"
                                                              : "OPAQUE");
    text += texture(childOf(material, "normalTexture"), "normalTexture");
    text += texture(childOf(material, "occlusionTexture"), "occlusionTexture");
    if (!unlit) text += texture(childOf(material, "emissiveTexture"), "emissiveTexture");
    if (unlit) {
        text += R"(,"extensions":{"KHR_materials_unlit":{}})";
        extensions_.insert("KHR_materials_unlit");
    } else if (strength > 1) {
        text +=
            fmt::format(R"(,"extensions":{{"KHR_materials_emissive_strength":{{"emissiveStrength":{}}}}})", strength);
        extensions_.insert("KHR_materials_emissive_strength");
    }
    if (material) text += nameOf(material->id());
    materials_.add(text + "}");
    return found->second;
}

// ---- the file ------------------------------------------------------------------------------------------------------

void GlbWriter::write(Output& out) {
    const auto listOf = [](const std::vector<std::size_t>& numbers) {
        return fmt::format("[{}]", fmt::join(numbers, ","));
    };
    List nodes;
    for (const GlbNode& node : nodes_)
        nodes.add("{" + node.members +
                  (node.children.empty() ? std::string() : ",\"children\":" + listOf(node.children)) + "}");
    pad(binary_, '\0');
    std::string json = fmt::format(
        R"({{"asset":{{"version":"2.0","generator":"RTSG"}},"scene":0,"scenes":[{{"nodes":{}}}],"buffers":[{{"byteLength":{}}}])",
        listOf(roots_), binary_.size());
    const std::pair<const char*, const List*> lists[] = {
        {"nodes", &nodes},        {"meshes", &meshes_},       {"accessors", &accessors_},
        {"bufferViews", &views_}, {"materials", &materials_}, {"images", &images_},
        {"textures", &textures_}, {"cameras", &cameras_},     {"animations", &animations_}};
    for (const auto& [name, list] : lists)
        if (list->count != 0) json += fmt::format(R"(,"{}":[{}])", name, list->text);
    if (lights_.count != 0)
        json += fmt::format(R"(,"extensions":{{"KHR_lights_punctual":{{"lights":[{}]}}}})", lights_.text);
    if (!extensions_.empty()) json += fmt::format(R"(,"extensionsUsed":["{}"])", fmt::join(extensions_, "\",\""));
    json += '}';
    pad(json, ' ');
    out.write("glTF");
    out.put(std::uint32_t{2});
    out.put(static_cast<std::uint32_t>(12 + 8 + json.size() + 8 + binary_.size()));
    out.put(static_cast<std::uint32_t>(json.size()));
    out.write("JSON");
    out.write(json);
    out.put(static_cast<std::uint32_t>(binary_.size()));
    out.write(std::string_view("BIN\0", 4));
    out.write(binary_);
}

}  // namespace rtsg::mesh_files
