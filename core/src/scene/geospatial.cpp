// Places the nodes of the Geospatial component in a scene, by their systems and GeoOrigins.
#include <cmath>

#include <glm/gtc/matrix_transform.hpp>

#include <rtsg/core/geospatial.h>
#include <rtsg/core/rotation.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

const Array<String>* systemOf(const Node& node) {
    const FieldIndex field = node.type().findExact("geoSystem");
    if (field == kNoField || node.type().fields[field].type != FieldType::MFString) return nullptr;
    return &node.get(Field<Array<String>>{field});
}

bool isFinitePoint(const Vec3d& p) {
    return std::isfinite(p.x + p.y + p.z);
}

/// The first finite point, around which the others lie; 0 if there is none.
Vec3d anchorOf(const GeoReference& reference, const Array<Vec3d>& points) {
    for (const Vec3d& p : points)
        if (const Vec3d at = reference.toScene(p); isFinitePoint(at)) return at;
    return Vec3d(0);
}

glm::dmat4 rotationBy(const Rotation& r, double sign) {
    const glm::dvec3 axis(r.x, r.y, r.z);
    return glm::length(axis) > 0 ? glm::dmat4(rotationMatrixOf(axis, sign * double(r.angle))) : glm::dmat4(1);
}

}  // namespace

Result<GeoReference> GeoReference::of(const Scene& scene, const Node& node) {
    GeoReference result;
    const Array<String>* words = systemOf(node);
    if (!words) return fail("is no geospatial node");
    auto system = GeoSystem::read(*words);
    if (!system) return std::unexpected(system.error());
    result.system_ = *system;
    const Node* origin = geoOriginOf(scene, node);
    if (!origin) return result;
    const auto around = GeoSystem::read(origin->get(x3d::GeoOrigin::geoSystem));
    if (!around) return std::unexpected(around.error());
    result.origin_ = around->toGeocentric(origin->get(x3d::GeoOrigin::geoCoords));
    if (!isFinitePoint(result.origin_)) return fail("geoOrigin: geoCoords are no place");
    if (origin->get(x3d::GeoOrigin::rotateYUp)) result.rotation_ = glm::transpose(around->frameAt(result.origin_));
    return result;
}

Vec3d GeoReference::toScene(const Vec3d& coordinates) const {
    return rotation_ * (system_.toGeocentric(coordinates) - origin_);
}

Vec3d GeoReference::fromScene(const Vec3d& point) const {
    return system_.fromGeocentric(glm::transpose(rotation_) * point + origin_);
}

glm::dmat4 GeoReference::transformAt(const Vec3d& coordinates) const {
    const Vec3d point = system_.toGeocentric(coordinates);
    glm::dmat4 worldFromLocal(rotation_ * system_.frameAt(point));
    worldFromLocal[3] = glm::dvec4(rotation_ * (point - origin_), 1);
    return worldFromLocal;
}

const Node* geoOriginOf(const Scene& scene, const Node& node) {
    const FieldIndex field = node.type().findExact("geoOrigin");
    if (field == kNoField || node.type().fields[field].type != FieldType::SFNode) return nullptr;
    const Node* origin = scene.effectiveNode(node.get(Field<NodeId>{field}));
    return origin && origin->is(x3d::GeoOrigin::type) ? origin : nullptr;
}

bool isGeoTransform(const NodeType& type) {
    return type.kind == NodeType::Kind::builtin &&
           (type.isA("GeoLocation") || type.isA("GeoTransform") || type.isA("GeoViewpoint"));
}

Result<glm::dmat4> geoTransform(const Scene& scene, const Node& node) {
    const auto reference = GeoReference::of(scene, node);
    if (!reference) return std::unexpected(reference.error());
    glm::dmat4 worldFromLocal(1);
    if (node.is(x3d::GeoLocation::type)) {
        worldFromLocal = reference->transformAt(node.get(x3d::GeoLocation::geoCoords));
    } else if (node.is(x3d::GeoViewpoint::type)) {
        worldFromLocal = reference->transformAt(node.get(x3d::GeoViewpoint::position));
    } else if (node.is(x3d::GeoTransform::type)) {
        // 25.3.10: the children have geographic coordinates as well; they are turned, scaled and moved in the plane
        // that touches the ellipsoid at geoCenter.
        using T = x3d::GeoTransform;
        const glm::dmat4 ground = reference->transformAt(node.get(T::geoCenter));
        const Rotation orientation = node.get(T::scaleOrientation);
        const glm::dmat4 local = glm::translate(glm::dmat4(1), glm::dvec3(node.get(T::translation))) *
                                 rotationBy(node.get(T::rotation), 1) * rotationBy(orientation, 1) *
                                 glm::scale(glm::dmat4(1), glm::dvec3(node.get(T::scale))) *
                                 rotationBy(orientation, -1);
        if (local == glm::dmat4(1)) return local;
        const glm::dmat3 back = glm::transpose(glm::dmat3(ground));
        glm::dmat4 inverse(back);
        inverse[3] = glm::dvec4(-(back * glm::dvec3(ground[3])), 1);
        worldFromLocal = ground * local * inverse;
    }
    if (!isFinitePoint(glm::dvec3(worldFromLocal[3]))) return fail("its geographic coordinates are no place");
    return worldFromLocal;
}

Result<AnchoredPoints> geoPoints(const Scene& scene, const Node& coordinate) {
    const auto reference = GeoReference::of(scene, coordinate);
    if (!reference) return std::unexpected(reference.error());
    const Array<Vec3d>& given = coordinate.get(x3d::GeoCoordinate::point);
    AnchoredPoints result{anchorOf(*reference, given), Array<Vec3f>::ofSize(given.size())};
    Vec3f* out = result.points.mutableData();
    for (const Vec3d& p : given) *out++ = Vec3f(reference->toScene(p) - result.anchor);
    return result;
}

std::optional<Vec3d> geoAnchor(const Scene& scene, const Node& node) {
    const bool isGrid = node.is(x3d::GeoElevationGrid::type);
    if (!isGrid && !node.is(x3d::GeoCoordinate::type)) return std::nullopt;
    const auto reference = GeoReference::of(scene, node);
    if (!reference) return std::nullopt;
    if (!isGrid) return anchorOf(*reference, node.get(x3d::GeoCoordinate::point));
    const Vec3d corner = reference->toScene(node.get(x3d::GeoElevationGrid::geoGridOrigin));
    return isFinitePoint(corner) ? corner : Vec3d(0);
}

}  // namespace rtsg
