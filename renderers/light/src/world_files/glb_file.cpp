// Writes GLB: lists of JSON objects, and the bytes that they refer to.
#include "glb_file.h"

#include <algorithm>
#include <cmath>

#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>

#include <rtsg/core/field_text.h>
#include <rtsg/core/placement.h>
#include <rtsg/core/portable_math.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/color.h>

#include "glb_mesh.h"

namespace rtsg::mesh_files {

namespace {

constexpr std::size_t kFloats = 5126, kIntegers = 5125, kShorts = 5123;

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

/// A texture's member with a number in it.
std::string numbered(std::string texture, const char* name, float value) {
    if (!texture.empty() && value != 1) texture.insert(texture.size() - 1, fmt::format(R"(,"{}":{})", name, value));
    return texture;
}

/// Whether a translation, a rotation and a scale can express a Transform.
bool isPlain(const Node& transform) {
    using T = x3d::Transform;
    const Vec3f s = transform.get(T::scale);
    return transform.get(T::scaleOrientation).angle == 0 || (s.x == s.y && s.y == s.z);
}

}  // namespace

GlbWriter::GlbWriter(const Scene& scene, const Shapes& shapes, const Resources& pictures, Diagnostics& diagnostics)
    : scene_(scene), shapes_(shapes), pictures_(pictures), diagnostics_(diagnostics), textureStore_(pictures) {
    findMovers(diagnostics);
    for (const Instance* instance : shapes.instances) addShape(*instance);
    for (const Placed& placed : shapes.flattener.placed())
        if (placed.id) addPlaced(placed);
    addClips();
    reportLeftOut();
}

bool GlbWriter::fits() const {
    return binaryBytes_ + accessors_.text.size() + nodes_.size() * 256 < 0xF0000000u;
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
    const glm::dvec3 position = glm::dvec3(transform.get(T::translation)) + glm::dvec3(transform.get(T::center));
    const glm::dquat q = quaternionOf(transform.get(T::rotation));
    found->second = addNode(
        parent, fmt::format(R"("translation":{},"rotation":[{},{},{},{}],"scale":{}{})", numbersOf(position), q.x, q.y,
                            q.z, q.w, numbersOf(glm::dvec3(transform.get(T::scale))), nameOf(transform.id())));
    nodesOfMover_.emplace(transform.id(), found->second);
    return found->second;
}

std::size_t GlbWriter::nodeFor(const std::vector<NodeId>& path, const WorldFromLocal& worldFromLocal,
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
    const std::size_t parent = nodeFor(shapes_.flattener.path(instance.id), instance.worldFromLocal, matrix);
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
    const std::size_t parent = nodeFor(shapes_.flattener.placedPath(placed.id), placed.worldFromLocal, matrix);
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
    const glm::dvec3 displacement(fieldOf(&node, "direction", Vec3f(0, 0, -1)));
    const glm::dvec3 z = glm::length(displacement) > 0 ? -glm::normalize(displacement) : glm::dvec3(0, 0, 1);
    const glm::dvec3 x = glm::normalize(glm::cross(std::abs(z.y) < .9 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0), z));
    const glm::dmat4 turned(glm::dvec4(x, 0), glm::dvec4(glm::cross(z, x), 0), glm::dvec4(z, 0),
                            glm::dvec4(0, 0, 0, 1));
    const glm::dvec3 position(fieldOf(&node, "location", Vec3f(0)));
    addPlacedNode(placed, glm::translate(glm::dmat4(1), position) * turned,
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
                accessor(channel.times, count, "SCALAR",
                         fmt::format(R"(,"min":[{}],"max":[{}])", channel.times.front(), channel.times.back()));
            const std::size_t output = accessor(channel.values, count, channel.path == "rotation" ? "VEC4" : "VEC3");
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

std::size_t GlbWriter::view(std::size_t bytes, std::function<void(Output&)> write) {
    const std::size_t offset = binaryBytes_;
    binary_.push_back({bytes, std::move(write)});
    binaryBytes_ += (bytes + 3) / 4 * 4;
    return views_.add(fmt::format(R"({{"buffer":0,"byteOffset":{},"byteLength":{}}})", offset, bytes));
}

std::size_t GlbWriter::accessor(std::size_t bytes, std::size_t count, const char* type, std::size_t component,
                                const std::string& more, std::function<void(Output&)> write) {
    return accessors_.add(fmt::format(R"({{"bufferView":{},"componentType":{},"count":{},"type":"{}"{}}})",
                                      view(bytes, std::move(write)), component, count, type, more));
}

std::size_t GlbWriter::accessor(const std::vector<float>& values, std::size_t count, const char* type,
                                const std::string& more) {
    return accessor(values.size() * sizeof(float), count, type, kFloats, more, [values](Output& out) {
        out.write({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)});
    });
}

namespace {

constexpr const char* kElsewhere = "textures that are moved or looked up otherwise than the first of their material";

/// The texture whose coordinates a mesh is written with: the base's, or the first that there is.
const TextureUse* leadOf(const Material& look) {
    if (look.texture(TextureRole::base)) return &look.texture(TextureRole::base);
    const auto found = std::ranges::find_if(look.textures, [](const TextureUse& use) { return bool(use); });
    return found == look.textures.end() ? nullptr : &*found;
}

std::size_t channelOf(const Mesh& mesh, const String& mapping) {
    const auto found = std::ranges::find(mesh.texCoords, mapping, &TexCoords::mapping);
    return found == mesh.texCoords.end() ? 0 : static_cast<std::size_t>(found - mesh.texCoords.begin());
}

/// Glass as the extensions of materials say it. `mesh` is one that has the material: its least extent is how thick the
/// glass is where somebody draws no rays.
std::map<std::string, std::string> glassOf(const Material& look, const Mesh& mesh) {
    const Vec3f size = mesh.bounds.size(), absorbed = look.absorption;
    std::string volume = fmt::format(R"("thicknessFactor":{})", std::max(std::min({size.x, size.y, size.z}), 1e-6f));
    if (const float maximum = std::max({absorbed.x, absorbed.y, absorbed.z}); maximum > 0) {
        const auto left = [&](float one) { return portable::exp(-double{one / maximum}); };
        volume += fmt::format(R"(,"attenuationDistance":{},"attenuationColor":[{},{},{}])", 1 / maximum,
                              left(absorbed.x), left(absorbed.y), left(absorbed.z));
    }
    return {{"KHR_materials_transmission", R"("transmissionFactor":1)"},
            {"KHR_materials_ior", fmt::format(R"("ior":{})", look.refractiveIndex)},
            {"KHR_materials_volume", volume}};
}

Color lightOf(bool isLight, const ColorRGBA& color) {
    if (isLight) return {color.r, color.g, color.b};
    return {linearFromSrgb(color.r), linearFromSrgb(color.g), linearFromSrgb(color.b)};
}

}  // namespace

std::string GlbWriter::primitiveOf(const Mesh& mesh, NodeId geometry, const Material& look) {
    const TextureUse* lead = leadOf(look);
    const std::size_t channel = lead ? channelOf(mesh, lead->mapping) : 0;
    const TextureMatrix moved = lead ? lead->matrix : TextureMatrix();
    const bool isLight = look.model == ShadingModel::physical;
    auto& known = primitives_[{geometry.value, fmt::format("{} {} {} {} {} {} {} {}", isLight, channel, moved.s.x,
                                                           moved.s.y, moved.s.z, moved.t.x, moved.t.y, moved.t.z)}];
    if (!known.empty()) return known;
    if (lead && channel < mesh.texCoords.size() && mesh.texCoords[channel].generator != TexCoords::Generator::none)
        leaveOut("texture coordinates that depend on the viewer");
    const auto built = std::make_shared<const GlbMesh>(mesh, channel, lead != nullptr);
    const std::size_t count = built->vertexCount();
    const Bounds& bounds = built->bounds();
    const std::string limits = fmt::format(R"(,"min":[{},{},{}],"max":[{},{},{}])", bounds.min.x, bounds.min.y,
                                           bounds.min.z, bounds.max.x, bounds.max.y, bounds.max.z);
    std::string attributes =
        fmt::format(R"("POSITION":{})", accessor(count * sizeof(Vec3f), count, "VEC3", kFloats, limits,
                                                 [built](Output& out) { built->writePositions(out); }));
    if (built->hasNormals())
        attributes += fmt::format(R"(,"NORMAL":{})", accessor(count * sizeof(Vec3f), count, "VEC3", kFloats, {},
                                                              [built](Output& out) { built->writeNormals(out); }));
    if (built->hasTexCoords())
        attributes += fmt::format(
            R"(,"TEXCOORD_0":{})",
            accessor(count * sizeof(Vec2f), count, "VEC2", kFloats, {}, [built, moved](Output& out) {
                built->forEachTexCoord([&](const Vec4f& coord) {  // pictures begin at their upper left corner there
                    const Vec2f st = moved.apply(Vec2f(coord));
                    out.put(Vec2f(st.x, 1 - st.y));
                });
            }));
    if (built->hasColors())
        attributes +=
            fmt::format(R"(,"COLOR_0":{})",
                        accessor(count * sizeof(Vec4f), count, "VEC4", kFloats, {}, [built, isLight](Output& out) {
                            built->forEachColor([&](const ColorRGBA& color) {
                                const Color light = lightOf(isLight, color);
                                out.put(Vec4f(light.r, light.g, light.b, color.a));
                            });
                        }));
    const std::size_t indexBytes = built->isSmall() ? sizeof(std::uint16_t) : sizeof(std::uint32_t);
    known = fmt::format(
        R"("attributes":{{{}}},"indices":{})", attributes,
        accessor(built->indexCount() * indexBytes, built->indexCount(), "SCALAR",
                 built->isSmall() ? kShorts : kIntegers, {}, [built](Output& out) { built->writeIndices(out); }));
    return known;
}

std::size_t GlbWriter::meshNumber(const Mesh& mesh, const Instance& instance) {
    const auto [found, isNew] =
        meshNumbers_.try_emplace({instance.geometry.value, instance.appearance.value}, meshes_.count);
    if (isNew)
        meshes_.add(fmt::format(R"({{"primitives":[{{{},"material":{}}}]}})",
                                primitiveOf(mesh, instance.geometry, lookOf(instance.appearance)),
                                materialNumber(instance.appearance, mesh)));
    return found->second;
}

const Node* GlbWriter::childOf(const Node* node, std::string_view name) const {
    const NodeId id = fieldOf(node, name, NodeId{});
    return id ? scene_.effectiveNode(id) : nullptr;
}

const Material& GlbWriter::lookOf(NodeId appearance) {
    const auto [found, isNew] = looks_.try_emplace(appearance.value);
    if (!isNew) return found->second;
    Material& look = found->second = readMaterial(scene_, appearance, textureStore_, diagnostics_);
    if (!look.stages.empty()) leaveOut("MultiTextures but for their first picture");
    if (look.back) leaveOut("materials of backs");
    if (look.hatching.present) leaveOut("FillProperties");
    if (look.reflectivity != Vec3f(0)) leaveOut("mirrors of metadata");
    if (look.refractiveIndex == 0 && look.absorption != Vec3f(0)) leaveOut("panes of metadata that absorb");
    if (look.refractiveIndex != 0 && look.priority != 0) leaveOut("priorities of glass");
    if (look.specular != Vec3f(0)) leaveOut("highlights of Materials");
    const TextureUse* lead = leadOf(look);
    for (const TextureRole role : {TextureRole::specular, TextureRole::ambient, TextureRole::shininess})
        if (look.texture(role)) leaveOut("textures of highlights and ambient light");
    for (const TextureUse& use : look.textures)
        if (use && (use.matrix != lead->matrix || use.mapping != lead->mapping || use.matrix3)) leaveOut(kElsewhere);
    return look;
}

/// The number of a picture of glTF, with its bytes in the file.
std::string GlbWriter::image(const Node& node) {
    const auto [found, isNew] = imageNumbers_.try_emplace(node.id().value);
    if (!isNew) return found->second;
    const FieldIndex field = node.type().findExact("url");
    if (!node.is(x3d::ImageTexture::type)) {
        leaveOut(node.type().name + "s");
        return {};
    }
    for (const String& url : node.get(x3d::ImageTexture::url)) {
        auto opened = pictures_.open(scene_, node, field, url.view());
        const auto bytes = opened ? opened->read() : Result<std::string>(std::unexpected(opened.error()));
        if (!bytes) continue;  // the texture's reader says why, if there is no other
        const bool isPng = bytes->starts_with("\x89PNG"), isJpeg = bytes->starts_with("\xFF\xD8\xFF");
        if (!isPng && !isJpeg) {
            leaveOut("pictures that are neither PNG nor JPEG");
            return {};
        }
        const std::size_t its = view(bytes->size(), [held = *bytes](Output& out) { out.write(held); });
        return found->second = std::to_string(images_.add(
                   fmt::format(R"({{"bufferView":{},"mimeType":"image/{}"}})", its, isPng ? "png" : "jpeg")));
    }
    return {};
}

/// The member that names how pixels are repeated and mixed; nothing for glTF's own way.
std::string GlbWriter::sampler(const TextureAccess& access) {
    const auto wrap = [](TextureWrap how) {
        constexpr int repeat = 10497, clamp = 33071, mirror = 33648;
        return how == TextureWrap::repeat ? repeat : how == TextureWrap::mirror ? mirror : clamp;
    };
    for (const TextureWrap how : {access.wrapS, access.wrapT})
        if (how == TextureWrap::border) leaveOut("borders of textures");
    constexpr int nearest = 9728, linear = 9729, mipmaps = 9984;  // of four; the first: nearest in both
    const int far = access.levels == TextureLevels::finest
                        ? (access.smoothFar ? linear : nearest)
                        : mipmaps + (access.smoothFar ? 1 : 0) + (access.levels == TextureLevels::mixed ? 2 : 0);
    const std::string text = fmt::format(R"({{"wrapS":{},"wrapT":{},"magFilter":{},"minFilter":{}}})",
                                         wrap(access.wrapS), wrap(access.wrapT), access.smooth ? linear : nearest, far);
    const auto [found, isNew] = samplerNumbers_.try_emplace(text, samplers_.count);
    if (isNew) samplers_.add(text);
    return fmt::format(R"(,"sampler":{})", found->second);
}

std::string GlbWriter::texture(const Node* node, const TextureUse& use, const char* name) {
    if (!node || !use) return {};
    if (node->is(x3d::MultiTexture::type))
        for (const NodeId inner : node->get(x3d::MultiTexture::texture))
            if (const Node* first = scene_.effectiveNode(inner)) {
                node = first;
                break;
            }
    const std::string source = image(*node);
    if (source.empty()) return {};
    return fmt::format(R"(,"{}":{{"index":{}}})", name,
                       textures_.add(fmt::format(R"({{"source":{}{}}})", source, sampler(use.access))));
}

std::size_t GlbWriter::materialNumber(NodeId appearanceId, const Mesh& mesh) {
    // Colours of points take the place of the material's, and their alpha, if they have one, that of its transparency.
    const int colored = mesh.colors.present() ? mesh.colors.components() : 0;
    const auto [found, isNew] =
        materialNumbers_.try_emplace({appearanceId.value, mesh.solid, colored}, materials_.count);
    if (!isNew) return found->second;
    const Node* appearance = appearanceId ? scene_.effectiveNode(appearanceId) : nullptr;
    const Node* material = childOf(appearance, "material");
    const Material& look = lookOf(appearanceId);
    const bool physical = look.model == ShadingModel::physical, unlit = look.model == ShadingModel::unlit;
    const bool isGlass = look.refractiveIndex > 0 && !unlit;
    const Vec3f color = colored || isGlass ? Vec3f(1) : look.linear.base;
    const Vec3f glow = unlit ? Vec3f(0) : look.linear.emissive;
    const float strength = std::max({glow.x, glow.y, glow.z, 1.0f});
    const float opacity = colored > 3 || isGlass ? 1 : look.opacity;
    const Node* base = childOf(material, physical ? "baseTexture" : unlit ? "emissiveTexture" : "diffuseTexture");
    if (!base) base = childOf(appearance, "texture");
    const bool isClear = opacity < 1 || colored > 3 || look.texture(TextureRole::base).hasAlpha();
    const char* mode = look.alphaMode == AlphaMode::mask                 ? "MASK"
                       : look.alphaMode == AlphaMode::opaque || !isClear ? "OPAQUE"
                                                                         : "BLEND";
    const auto textureOf = [&](const char* field, TextureRole role, const char* name) {
        return texture(childOf(material, field), look.texture(role), name);
    };
    std::string text = fmt::format(
        R"({{"pbrMetallicRoughness":{{"baseColorFactor":[{},{},{},{}],"metallicFactor":{},"roughnessFactor":{}{}{}}},)"
        R"("emissiveFactor":[{},{},{}],"doubleSided":{},"alphaMode":"{}")",
        color.x, color.y, color.z, opacity, physical && !isGlass ? look.metallic : 0.0f,
        physical  ? look.roughness
        : isGlass ? 0.0f
                  : 1.0f,
        texture(base, look.texture(TextureRole::base), "baseColorTexture"),
        textureOf("metallicRoughnessTexture", TextureRole::metallicRoughness, "metallicRoughnessTexture"),
        glow.x / strength, glow.y / strength, glow.z / strength, !mesh.solid, mode);
    if (look.alphaMode == AlphaMode::mask) text += fmt::format(R"(,"alphaCutoff":{})", look.alphaCutoff);
    if (!unlit) {
        text += numbered(textureOf("normalTexture", TextureRole::normal, "normalTexture"), "scale", look.normalScale);
        text += numbered(textureOf("occlusionTexture", TextureRole::occlusion, "occlusionTexture"), "strength",
                         look.occlusionStrength);
        text += textureOf("emissiveTexture", TextureRole::emissive, "emissiveTexture");
    }
    std::map<std::string, std::string> more = isGlass ? glassOf(look, mesh) : std::map<std::string, std::string>();
    if (unlit) more["KHR_materials_unlit"] = "";
    if (strength > 1) more["KHR_materials_emissive_strength"] = fmt::format(R"("emissiveStrength":{})", strength);
    std::vector<std::string> members;
    for (const auto& [name, its] : more) {
        members.push_back(fmt::format(R"("{}":{{{}}})", name, its));
        extensions_.insert(name);
    }
    if (!members.empty()) text += fmt::format(R"(,"extensions":{{{}}})", fmt::join(members, ","));
    if (material) text += nameOf(material->id());
    materials_.add(text + "}");
    return found->second;
}

void GlbWriter::reportLeftOut() {
    std::string all;
    for (const auto& [what, count] : leftOut_)
        all += fmt::format("{}{}{}", all.empty() ? "" : ", ", what, count > 1 ? fmt::format(" ({})", count) : "");
    if (!all.empty()) diagnostics_.warning({}, "left out of the GLB file, whose materials have none of these: " + all);
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
    std::string json = fmt::format(
        R"({{"asset":{{"version":"2.0","generator":"RTSG"}},"scene":0,"scenes":[{{"nodes":{}}}],"buffers":[{{"byteLength":{}}}])",
        listOf(roots_), binaryBytes_);
    const std::pair<const char*, const List*> lists[] = {
        {"nodes", &nodes},          {"meshes", &meshes_},        {"accessors", &accessors_}, {"bufferViews", &views_},
        {"materials", &materials_}, {"images", &images_},        {"textures", &textures_},   {"samplers", &samplers_},
        {"cameras", &cameras_},     {"animations", &animations_}};
    for (const auto& [name, list] : lists)
        if (list->count != 0) json += fmt::format(R"(,"{}":[{}])", name, list->text);
    if (lights_.count != 0)
        json += fmt::format(R"(,"extensions":{{"KHR_lights_punctual":{{"lights":[{}]}}}})", lights_.text);
    if (!extensions_.empty()) json += fmt::format(R"(,"extensionsUsed":["{}"])", fmt::join(extensions_, "\",\""));
    json += '}';
    pad(json, ' ');
    out.write("glTF");
    out.put(std::uint32_t{2});
    out.put(static_cast<std::uint32_t>(12 + 8 + json.size() + 8 + binaryBytes_));
    out.put(static_cast<std::uint32_t>(json.size()));
    out.write("JSON");
    out.write(json);
    out.put(static_cast<std::uint32_t>(binaryBytes_));
    out.write(std::string_view("BIN\0", 4));
    for (const Piece& piece : binary_) {
        piece.write(out);
        out.write(std::string_view("\0\0\0", (4 - piece.bytes % 4) % 4));
    }
}

}  // namespace rtsg::mesh_files
