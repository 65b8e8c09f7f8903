// Computes boxes of geometries from their fields, and of subtrees from their transforms.
#include "shape_bounds.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <unordered_set>

#include <rtsg/core/placement.h>
#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

constexpr int kDeepestUnit = 500;  // levels of nodes; deeper ones count as unbounded

ShapeBounds aboutOrigin(const Vec3d& half) {
    ShapeBounds box;
    box.add(-half);
    box.add(half);
    return box;
}

ShapeBounds aboutPoints(const Node& node, FieldIndex field) {
    ShapeBounds box;
    switch (node.type().fields[field].type) {
        case FieldType::MFVec3f:
            for (const Vec3f& p : node.get(Field<Array<Vec3f>>{field})) box.add(Vec3d(p));
            break;
        case FieldType::MFVec3d:
            for (const Vec3d& p : node.get(Field<Array<Vec3d>>{field})) box.add(p);
            break;
        case FieldType::MFVec2f:
            for (const Vec2f& p : node.get(Field<Array<Vec2f>>{field})) box.add(Vec3d(p, 0));
            break;
        default:
            break;
    }
    return box;
}

/// The box of a geometry whose points are in another node. Empty if the points are geographic coordinates.
std::optional<ShapeBounds> aboutCoordinates(const Scene& scene, const Node& geometry, FieldIndex field) {
    const Node* points = scene.effectiveNode(geometry.get(Field<NodeId>{field}));
    if (!points) return ShapeBounds{};
    if (points->is(x3d::Coordinate::type)) return aboutPoints(*points, x3d::Coordinate::point.index);
    if (points->is(x3d::CoordinateDouble::type)) return aboutPoints(*points, x3d::CoordinateDouble::point.index);
    return std::nullopt;
}

ShapeBounds aboutExtrusion(const Node& node) {
    using E = x3d::Extrusion;
    double reach = 0, scale = node.get(E::scale).empty() ? 1 : 0;
    for (const Vec2f& p : node.get(E::crossSection)) reach = std::max(reach, glm::length(Vec2d(p)));
    for (const Vec2f& s : node.get(E::scale)) scale = std::max(scale, double(std::max(std::abs(s.x), std::abs(s.y))));
    const ShapeBounds around = aboutOrigin(Vec3d(reach * scale)), spine = aboutPoints(node, E::spine.index);
    return spine.empty() ? ShapeBounds{} : ShapeBounds{spine.low + around.low, spine.high + around.high};
}

ShapeBounds aboutElevations(const Node& node) {
    using E = x3d::ElevationGrid;
    ShapeBounds box;
    for (const float height : node.get(E::height)) {
        box.add(Vec3d(0, height, 0));
        box.add(Vec3d((node.get(E::xDimension) - 1.) * node.get(E::xSpacing), height,
                      (node.get(E::zDimension) - 1.) * node.get(E::zSpacing)));
    }
    return box;
}

/// However a text is justified, it lies within its size of its origin. Empty while it has not been measured.
std::optional<ShapeBounds> aboutText(const Node& node) {
    using T = x3d::Text;
    if (node.get(T::string).empty()) return ShapeBounds{};
    const Vec2d size(node.get(T::textBounds));
    if (!(size.x > 0 && size.y > 0)) return std::nullopt;
    return aboutOrigin(glm::abs(Vec3d(node.get(T::origin))) + Vec3d(size.x + size.y, size.x + size.y, 0));
}

/// Empty if the fields do not tell.
std::optional<ShapeBounds> aboutGeometry(const Scene& scene, NodeId id) {
    if (!id) return ShapeBounds{};
    const Node* geometry = scene.effectiveNode(id);
    if (!geometry) return ShapeBounds{};
    const Node& g = *geometry;
    const auto round = [](float radius) { return aboutOrigin(Vec3d(radius, radius, 0)); };
    if (g.is(x3d::Box::type)) return aboutOrigin(Vec3d(g.get(x3d::Box::size)) * .5);
    if (g.is(x3d::Sphere::type)) return aboutOrigin(Vec3d(g.get(x3d::Sphere::radius)));
    if (g.is(x3d::Cylinder::type)) {
        const double radius = g.get(x3d::Cylinder::radius);
        return aboutOrigin(Vec3d(radius, g.get(x3d::Cylinder::height) * .5, radius));
    }
    if (g.is(x3d::Cone::type)) {
        const double radius = g.get(x3d::Cone::bottomRadius);
        return aboutOrigin(Vec3d(radius, g.get(x3d::Cone::height) * .5, radius));
    }
    if (g.is(x3d::Extrusion::type)) return aboutExtrusion(g);
    if (g.is(x3d::ElevationGrid::type)) return aboutElevations(g);
    if (g.is(x3d::Text::type)) return aboutText(g);
    if (g.is(x3d::Arc2D::type)) return round(g.get(x3d::Arc2D::radius));
    if (g.is(x3d::ArcClose2D::type)) return round(g.get(x3d::ArcClose2D::radius));
    if (g.is(x3d::Circle2D::type)) return round(g.get(x3d::Circle2D::radius));
    if (g.is(x3d::Disk2D::type)) return round(g.get(x3d::Disk2D::outerRadius));
    if (g.is(x3d::Rectangle2D::type)) return aboutOrigin(Vec3d(g.get(x3d::Rectangle2D::size), 0) * .5);
    if (g.is(x3d::Polyline2D::type)) return aboutPoints(g, x3d::Polyline2D::lineSegments.index);
    if (g.is(x3d::Polypoint2D::type)) return aboutPoints(g, x3d::Polypoint2D::point.index);
    if (g.is(x3d::TriangleSet2D::type)) return aboutPoints(g, x3d::TriangleSet2D::vertices.index);
    const FieldIndex coord = g.type().findExact("coord");
    if (g.type().kind == NodeType::Kind::builtin && coord != kNoField &&
        g.type().fields[coord].type == FieldType::SFNode)
        return aboutCoordinates(scene, g, coord);
    return std::nullopt;
}

/// The box of a node and all below it, in its parent's coordinates. Empty if unbounded.
std::optional<ShapeBounds> aboutNode(const Scene& scene, NodeId id, int depth) {
    const Node* found = scene.find(id);
    if (!found) return ShapeBounds{};
    const Node& node = *found;
    const NodeType& type = node.type();
    if (depth > kDeepestUnit) return std::nullopt;
    if (node.is(x3d::Shape::type)) return aboutGeometry(scene, node.get(x3d::Shape::geometry));
    if (type.kind == NodeType::Kind::proto || type.kind == NodeType::Kind::externProto) {
        const Node* first = scene.effectiveNode(id);
        return first && first != found ? aboutNode(scene, first->id(), depth + 1) : ShapeBounds{};
    }
    if (type.isA("X3DVolumeDataNode")) {
        const FieldIndex size = type.findExact("dimensions");
        if (size == kNoField || type.fields[size].type != FieldType::SFVec3f) return std::nullopt;
        return aboutOrigin(Vec3d(node.get(Field<Vec3f>{size})) * .5);
    }
    if (type.role == "shape") return std::nullopt;
    ShapeBounds box;
    for (const FieldIndex field : type.below) {
        std::vector<NodeId> children;
        if (type.fields[field].type == FieldType::SFNode)
            children.push_back(node.get(Field<NodeId>{field}));
        else
            append(children, node.get(Field<Array<NodeId>>{field}));
        for (const NodeId child : children) {
            const std::optional<ShapeBounds> one = aboutNode(scene, child, depth + 1);
            if (!one) return std::nullopt;
            box.add(*one);
        }
    }
    if (box.empty()) return box;
    if (node.is(x3d::Billboard::type)) box = aboutOrigin(Vec3d(glm::length(glm::max(-box.low, box.high))));
    return box.through(parentFromLocal(scene, node));
}

bool hasEffectAnywhere(const NodeType& type) {
    for (const char* kind : {"X3DBindableNode", "X3DLightNode", "X3DSoundNode", "X3DTextureProjectorNode",
                             "X3DLayerNode", "X3DLayoutNode"})
        if (type.isA(kind)) return true;
    return type.role == "layers" || type.role == "listener" || type.name == "ScreenGroup" || type.name == "LayoutGroup";
}

}  // namespace

ShapeBounds ShapeBounds::through(const glm::dmat4& matrix) const {
    if (empty()) return {};
    const Vec3d center = (low + high) * .5, half = (high - low) * .5;
    const Vec3d at(matrix * glm::dvec4(center, 1));
    const Vec3d reach =
        glm::abs(Vec3d(matrix[0])) * half.x + glm::abs(Vec3d(matrix[1])) * half.y + glm::abs(Vec3d(matrix[2])) * half.z;
    return {at - reach, at + reach};
}

double ShapeBounds::distance(const Vec3d& point) const {
    if (empty()) return std::numeric_limits<double>::infinity();
    return glm::length(glm::max(glm::max(low - point, point - high), Vec3d(0)));
}

void appendBelow(const Scene& scene, const Node& node, FieldIndex except, std::vector<NodeId>& out) {
    const NodeType& type = node.type();
    const bool isInstance = type.kind == NodeType::Kind::proto || type.kind == NodeType::Kind::externProto;
    for (const FieldIndex field : type.nodeFields()) {
        const FieldDef& def = type.fields[field];
        if (field == except || !def.readable() || !(isInstance || isTransform(type, field))) continue;
        const auto add = [&](NodeId id) {
            if (scene.find(id)) out.push_back(id);
        };
        if (def.type == FieldType::SFNode)
            add(node.get(Field<NodeId>{field}));
        else
            for (const NodeId id : node.get(Field<Array<NodeId>>{field})) add(id);
    }
}

std::vector<NodeId> allBelow(const Scene& scene, std::vector<NodeId> start) {
    std::vector<NodeId> result;
    std::unordered_set<std::uint32_t> seen;
    while (!start.empty()) {
        const NodeId id = start.back();
        start.pop_back();
        if (!seen.insert(id.value).second) continue;
        result.push_back(id);
        appendBelow(scene, scene.node(id), kNoField, start);
    }
    std::ranges::sort(result);
    return result;
}

ShapeUnit shapeUnit(const Scene& scene, NodeId top) {
    ShapeUnit unit;
    unit.nodes = allBelow(scene, {top});
    unit.isUnbounded =
        std::ranges::any_of(unit.nodes, [&](NodeId id) { return hasEffectAnywhere(scene.node(id).type()); });
    if (unit.isUnbounded) return unit;
    const std::optional<ShapeBounds> box = aboutNode(scene, top, 0);
    const auto finite = [](const Vec3d& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); };
    unit.isUnbounded = !box || (!box->empty() && !(finite(box->low) && finite(box->high)));
    if (!unit.isUnbounded) unit.box = *box;
    return unit;
}

}  // namespace rtsg
