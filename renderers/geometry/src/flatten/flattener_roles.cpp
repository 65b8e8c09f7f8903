// Reads the tables' @role of a type for the hierarchy, and the transform and children of a node that has one.
#include "flattener_roles.h"

#include <algorithm>
#include <cmath>

#include <rtsg/core/geospatial.h>
#include <rtsg/core/portable_math.h>
#include <rtsg/core/rotation.h>
#include <rtsg/core/x3d.h>

namespace rtsg::flatten {

namespace {

FieldIndex findTyped(const NodeType& type, std::string_view name, FieldType fieldType) {
    const FieldIndex index = type.findExact(name);
    return index != kNoField && type.fields[index].type == fieldType && type.fields[index].readable() ? index
                                                                                                      : kNoField;
}

/// The meaning of each @role of the node tables; `placed` and `children` are as Role says.
struct NamedRole {
    std::string_view name;
    Role role;
    PlacedKind kind = PlacedKind::light;
};
constexpr NamedRole kRoles[] = {
    {"group", Role::all},
    {"joint", Role::all},
    {"humanoid", Role::all},  // joints, segments and sites only name parts of the skeleton
    {"choice", Role::choice},
    {"level", Role::level},
    {"layers", Role::layers},
    {"shape", Role::shape},
    {"light", Role::placed, PlacedKind::light},
    {"view", Role::placed, PlacedKind::view},
    {"background", Role::placed, PlacedKind::background},
    {"fog", Role::placed, PlacedKind::fog},
    {"navigation", Role::placed, PlacedKind::navigation},
    {"sound", Role::placed, PlacedKind::sound},
    {"listener", Role::placed, PlacedKind::listener},
    {"clipPlane", Role::placed, PlacedKind::clipPlane},
    {"localFog", Role::placed, PlacedKind::localFog},
    {"sensor", Role::placed, PlacedKind::sensor},
};

void takeRole(const NodeType& type, TypeRole& role) {
    role.ofHumanoid = type.role == "humanoid" || type.role == "joint" || type.role == "displacer" ||
                      (type.kind == NodeType::Kind::builtin && type.name == "HAnimSegment");
    const auto* named = std::ranges::find(kRoles, type.role, &NamedRole::name);
    if (named == std::end(kRoles)) return;
    role.role = named->role;
    role.kind = named->kind;
    for (const FieldIndex field : type.below)
        if (role.childFields < role.children.size()) role.children[role.childFields++] = field;
}

/// Rotates by the axis and angle; false if it is none.
bool rotationMatrix(const Rotation& r, glm::dmat3& out) {
    const Vec3d axis(r.x, r.y, r.z);
    if (r.angle == 0 || glm::length(axis) == 0) return false;
    out = rotationMatrixOf(axis, double{r.angle});
    return true;
}

}  // namespace

TypeRole RoleTable::work(const NodeType& type) {
    TypeRole role;
    if (type.kind == NodeType::Kind::script) return role;
    // An InlineGeometry stands for the geometry that it has loaded, as the instance of a PROTO does for its body.
    const bool isLoaded = type.kind == NodeType::Kind::builtin && type.name == "InlineGeometry";
    if (isLoaded || type.kind == NodeType::Kind::proto || type.kind == NodeType::Kind::externProto) {
        role.role = Role::first;
        if (const FieldIndex body = type.body(); body != kNoField) role.children[role.childFields++] = body;
    } else {
        takeRole(type, role);
        role.visible = findTyped(type, "visible", FieldType::SFBool);
    }
    if (role.role == Role::shape) {
        role.geometry = findTyped(type, "geometry", FieldType::SFNode);
        role.isParticles = type.isA("ParticleSystem");
        role.isVolume = type.isA("X3DVolumeDataNode");
        role.appearance = findTyped(type, "appearance", FieldType::SFNode);
        role.castShadow = findTyped(type, "castShadow", FieldType::SFBool);
    } else if (role.role == Role::placed) {
        role.global = findTyped(type, "global", FieldType::SFBool);
    } else if (role.role == Role::choice) {
        role.choice = findTyped(type, "whichChoice", FieldType::SFInt32);
    } else if (role.role == Role::level) {
        role.range = findTyped(type, "range", FieldType::MFFloat);
        role.center = findTyped(type, "center", FieldType::SFVec3f);
    } else if (role.role == Role::layers) {
        role.order = findTyped(type, "order", FieldType::MFInt32);
    }
    if (isGeoTransform(type)) {
        role.hasTransform = role.geographic = true;
    } else if (role.role == Role::all && type.isA("X3DChildNode")) {
        role.translation = findTyped(type, "translation", FieldType::SFVec3f);
        role.rotation = findTyped(type, "rotation", FieldType::SFRotation);
        role.scale = findTyped(type, "scale", FieldType::SFVec3f);
        role.scaleOrientation = findTyped(type, "scaleOrientation", FieldType::SFRotation);
        role.hasTransform = role.translation != kNoField && role.rotation != kNoField;
        if (role.hasTransform) role.center = findTyped(type, "center", FieldType::SFVec3f);
        if (type.isA("Billboard")) role.axis = findTyped(type, "axisOfRotation", FieldType::SFVec3f);
        role.facesViewer = role.axis != kNoField || type.isA("ScreenGroup");
    }
    if (role.role == Role::all && (type.isA("LayoutLayer") || type.isA("LayoutGroup"))) {
        role.layout = findTyped(type, "layout", FieldType::SFNode);
        role.facesViewer = role.layout != kNoField;
        // A LayoutGroup's viewport is below it like its children: it cuts them.
        if (type.isA("LayoutGroup")) role.viewport = findTyped(type, "viewport", FieldType::SFNode);
        if (role.viewport != kNoField && role.childFields < role.children.size())
            role.children[role.childFields++] = role.viewport;
    }
    if (type.kind == NodeType::Kind::builtin && type.name == "Collision")
        role.proxy = findTyped(type, "proxy", FieldType::SFNode);
    if (role.childFields == 0 && role.role != Role::shape && role.role != Role::placed) role.role = Role::none;
    if (role.role != Role::none && role.role != Role::placed && role.role != Role::first) {
        role.bboxDisplay = findTyped(type, "bboxDisplay", FieldType::SFBool);
        role.bboxCenter = findTyped(type, "bboxCenter", FieldType::SFVec3f);
        role.bboxSize = findTyped(type, "bboxSize", FieldType::SFVec3f);
    }
    return role;
}

bool localTransform(const Scene& scene, const Node& node, const TypeRole& role, WorldFromLocal& m) {
    if (role.geographic) {
        const auto transform = geoTransform(scene, node);
        if (!transform || *transform == glm::dmat4(1)) return false;
        m = WorldFromLocal(*transform);
        return true;
    }
    const Vec3d translation(read<Vec3f>(node, role.translation));
    const Vec3d scale(role.scale == kNoField ? Vec3f(1) : read<Vec3f>(node, role.scale));
    glm::dmat3 linear(1.0), rotation, orientation;
    bool identity = true;
    if (scale != Vec3d(1.0)) {
        identity = false;
        linear = glm::dmat3(scale.x, 0, 0, 0, scale.y, 0, 0, 0, scale.z);
        if (role.scaleOrientation != kNoField &&
            rotationMatrix(read<Rotation>(node, role.scaleOrientation), orientation))
            linear = orientation * linear * glm::transpose(orientation);
    }
    if (rotationMatrix(read<Rotation>(node, role.rotation), rotation)) {
        linear = rotation * linear;
        identity = false;
    }
    m[0] = linear[0], m[1] = linear[1], m[2] = linear[2], m[3] = translation;
    if (!identity && role.center != kNoField) {
        const Vec3d center(read<Vec3f>(node, role.center));
        if (center != Vec3d(0.0)) m[3] += center - linear * center;
    }
    return !(identity && translation == Vec3d(0.0));
}

void desiredChildren(const Node& node, const TypeRole& role, std::uint32_t level, std::vector<NodeId>& out) {
    for (int i = 0; i < role.childFields; ++i) {
        const FieldIndex field = role.children[static_cast<std::size_t>(i)];
        if (node.type().fields[field].type == FieldType::SFNode) {
            if (const NodeId child = read<NodeId>(node, field)) out.push_back(child);
            continue;
        }
        const Array<NodeId>& children = read<Array<NodeId>>(node, field);
        std::size_t only = 0;
        switch (role.role) {
            case Role::first:
                break;
            case Role::choice: {
                const std::int32_t which = read<std::int32_t>(node, role.choice);
                only = which < 0 ? children.size() : static_cast<std::size_t>(which);
                break;
            }
            case Role::level:
                only = children.empty() ? 0 : std::min<std::size_t>(level, children.size() - 1);
                break;
            case Role::layers:
                for (const std::int32_t layer : read<Array<std::int32_t>>(node, role.order))
                    if (layer > 0 && static_cast<std::size_t>(layer) <= children.size())
                        out.push_back(children[static_cast<std::size_t>(layer) - 1]);
                continue;
            default:
                out.insert(out.end(), children.begin(), children.end());
                continue;
        }
        if (only < children.size() && children[only]) out.push_back(children[only]);
    }
}

NodeId proxyOf(const Node& node, const TypeRole& role) {
    if (role.proxy == kNoField) return {};
    const NodeId proxy = read<NodeId>(node, role.proxy);
    if (!proxy) return {};
    std::vector<NodeId> children;
    desiredChildren(node, role, 0, children);
    return std::ranges::find(children, proxy) == children.end() ? proxy : NodeId{};
}

NodeId resolve(const Scene& scene, RoleTable& roles, NodeId id) {
    // The scene is free of cycles, so this ends.
    for (;;) {
        const Node* node = id ? scene.find(id) : nullptr;
        if (!node) return {};
        const TypeRole& role = roles.of(*node);
        const bool stands = node->type().kind == NodeType::Kind::proto ||
                            node->type().kind == NodeType::Kind::externProto || node->is(x3d::InlineGeometry::type);
        if (!stands) return id;
        if (role.childFields == 0) return {};
        std::vector<NodeId> first;
        desiredChildren(*node, role, 0, first);
        id = first.empty() ? NodeId{} : first[0];
    }
}

NodeId geometryOf(const Scene& scene, RoleTable& roles, const Node& shape) {
    const TypeRole& role = roles.of(shape);
    return role.ownsGeometry() ? shape.id() : resolve(scene, roles, read<NodeId>(shape, role.geometry));
}

NodeId appearanceOf(const Scene& scene, RoleTable& roles, const Node& shape) {
    const TypeRole& role = roles.of(shape);
    return role.isVolume ? shape.id() : resolve(scene, roles, read<NodeId>(shape, role.appearance));
}

std::uint32_t chooseLevel(const Node& node, const TypeRole& role, const WorldFromLocal& m,
                          const std::optional<EyePosition>& viewer) {
    if (!viewer || determinantSign(m) == 0) return 0;
    const Vec3d p = glm::inverse(glm::dmat3(m[0], m[1], m[2])) * (viewer->position - m[3]);
    const double distance = glm::length(p - Vec3d(read<Vec3f>(node, role.center)));
    std::uint32_t level = 0;
    for (const float range : read<Array<float>>(node, role.range)) {
        if (distance < double{range}) break;
        ++level;
    }
    return level;
}

bool rotateTowards(const Node& node, const TypeRole& role, const WorldFromLocal& worldFromParent,
                   const EyePosition* viewer, WorldFromLocal& m) {
    if (!viewer || determinantSign(worldFromParent) == 0 || !isFinite(worldFromParent)) return false;
    const glm::dmat3 back = glm::inverse(glm::dmat3(worldFromParent[0], worldFromParent[1], worldFromParent[2]));
    const Vec3d towards = back * (viewer->position - worldFromParent[3]);
    const Vec3d axis(read<Vec3f>(node, role.axis));
    const double axisLength = glm::length(axis), distance = glm::length(towards);
    if (!(distance > 0) || !std::isfinite(distance + axisLength)) return false;
    Vec3d x, y, z;
    if (axisLength > 0) {
        // 23.4.1: about the axis alone, as far as it goes; where eye or z axis lie on it, no turn brings them nearer.
        const Vec3d a = axis / axisLength;
        const Vec3d from = Vec3d(0, 0, 1) - a * a.z, to = towards - a * glm::dot(a, towards);
        if (!(glm::length(from) > 1e-9) || !(glm::length(to) > 1e-9 * distance)) return false;
        const double angle = portable::atan2(glm::dot(glm::cross(from, to), a), glm::dot(from, to));
        const glm::dmat3 turned = rotationMatrixOf(a, angle);
        x = turned[0], y = turned[1], z = turned[2];
    } else {
        // 23.4.1: towards the eye, its y axis as that of the picture, however the eye leans.
        z = towards / distance;
        Vec3d up = back * viewer->up;
        if (!(glm::length(glm::cross(up, z)) > 1e-9 * glm::length(up))) up = back * Vec3d(0, 0, -1);
        x = glm::normalize(glm::cross(up, z));
        y = glm::cross(z, x);
    }
    m = {x, y, z, Vec3d(0)};
    return true;
}

std::shared_ptr<const StrokeStyle> strokeStyle(const Scene& scene, NodeId appearance) {
    using A = x3d::Appearance;
    using L = x3d::LineProperties;
    using P = x3d::PointProperties;
    const Node* node = scene.find(appearance);
    if (!node || !node->is(A::type)) return nullptr;
    const NodeId lineId = node->get(A::lineProperties), pointId = node->get(A::pointProperties);
    if (!lineId && !pointId) return nullptr;
    const auto clean = [](float x, float minimum) { return std::isfinite(x) ? std::clamp(x, minimum, 1e4f) : minimum; };
    StrokeStyle style;
    if (const Node* line = scene.effectiveNode(lineId); line && line->is(L::type) && line->get(L::applied)) {
        style.lineWidth = clean(line->get(L::linewidthScaleFactor), 1);  // 12.4.4: from the thinnest there is
        style.lineType = line->get(L::linetype);
    }
    if (const Node* point = scene.effectiveNode(pointId); point && point->is(P::type)) {
        style.pointSize = clean(point->get(P::pointSizeScaleFactor), 1);
        const Vec3f& fall = point->get(P::attenuation);
        if (std::isfinite(fall.x + fall.y + fall.z)) style.attenuation = glm::max(fall, Vec3f(0));
        style.minimum = clean(point->get(P::pointSizeMinValue), 0);
        style.maximum = std::max(style.minimum, clean(point->get(P::pointSizeMaxValue), 0));
    }
    return std::make_shared<const StrokeStyle>(style);
}

bool isOfStrokeStyle(const Node& node) {
    return node.is(x3d::LineProperties::type) || node.is(x3d::PointProperties::type);
}

bool isClear(const Node& material) {
    return (material.is(x3d::Material::type) && material.get(x3d::Material::transparency) >= 1) ||
           (material.is(x3d::UnlitMaterial::type) && material.get(x3d::UnlitMaterial::transparency) >= 1);
}

namespace {

/// Whether it is made of lines or points, which have no inside.
bool hasNoInside(const Node& geometry) {
    return geometry.is(x3d::IndexedLineSet::type) || geometry.is(x3d::LineSet::type) ||
           geometry.is(x3d::PointSet::type) || geometry.is(x3d::Polyline2D::type) ||
           geometry.is(x3d::Polypoint2D::type) || geometry.is(x3d::Arc2D::type) || geometry.is(x3d::Circle2D::type) ||
           geometry.is(x3d::NurbsCurve::type);
}

}  // namespace

bool showsNothing(const Scene& scene, NodeId geometry, NodeId appearance) {
    using A = x3d::Appearance;
    const Node *look = scene.find(appearance), *form = scene.find(geometry);
    if (!look || !form || !look->is(A::type)) return false;
    if (form->typeIndex().value >= builtinTypes().size()) return false;  // a user's own type may do anything with it
    if (const Node* fill = scene.effectiveNode(look->get(A::fillProperties))) {
        using F = x3d::FillProperties;
        return fill->is(F::type) && !fill->get(F::filled) && !fill->get(F::hatched) && !hasNoInside(*form);
    }
    if (look->get(A::backMaterial)) return false;
    // Opaque whatever the transparency (12.2.3).
    const std::string mode = look->get(A::alphaMode).str();
    if (mode == "OPAQUE" || (mode == "MASK" && !(look->get(A::alphaCutoff) > 0))) return false;
    const Node* material = scene.effectiveNode(look->get(A::material));
    if (!material || !isClear(*material) || read<NodeId>(*material, material->type().findExact("metadata")))
        return false;
    if (const Node* texture = scene.effectiveNode(look->get(A::texture));
        texture && texture->is(x3d::MultiTexture::type))
        return false;
    const FieldIndex color = form->type().findExact("color");
    if (color == kNoField || form->type().fields[color].type != FieldType::SFNode) return true;
    const Node* colors = scene.effectiveNode(read<NodeId>(*form, color));
    return !colors || !colors->is(x3d::ColorRGBA::type);
}

}  // namespace rtsg::flatten
