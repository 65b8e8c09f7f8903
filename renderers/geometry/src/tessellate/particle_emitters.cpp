// Draws random start positions and directions of particles.
#include "particle_emitters.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <rtsg/core/portable_math.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/tessellate.h>

#include "shapes/tessellate_deform.h"

namespace rtsg::detail {

namespace {
constexpr int kMaxTries = 256;  // to find a place in a volume
}

Vec3d directionInCone(const Vec3d& axis, double minimum, KeyedNumbers& numbers) {
    const double length = glm::length(axis);
    const bool any = !(length > 0) || !std::isfinite(length);
    const Vec3d z = any ? Vec3d(0, 0, 1) : axis / length;
    const double along = 1 - numbers.next() * (1 - (any ? -1 : minimum)), angle = 2 * std::numbers::pi * numbers.next();
    if (!any && minimum >= 1) return z;
    const Vec3d x = glm::normalize(glm::cross(std::abs(z.x) < .5 ? Vec3d(1, 0, 0) : Vec3d(0, 1, 0), z));
    const double across = std::sqrt(std::max(0.0, 1 - along * along));
    return z * along + (x * portable::cos(angle) + glm::cross(z, x) * portable::sin(angle)) * across;
}

ParticleEmitter::ParticleEmitter(const Scene& scene, const Node& emitter,
                                 const std::function<std::shared_ptr<const Mesh>(NodeId)>& meshOf, Mesh& problems) {
    if (emitter.is(x3d::PointEmitter::type)) {
        kind_ = Kind::point;
    } else if (emitter.is(x3d::ConeEmitter::type)) {
        kind_ = Kind::cone;
    } else if (emitter.is(x3d::ExplosionEmitter::type)) {
        kind_ = Kind::explosion;
    } else if (emitter.is(x3d::PolylineEmitter::type)) {
        readPolyline(scene, emitter, problems);
    } else if (emitter.is(x3d::SurfaceEmitter::type)) {
        mesh_ = meshOf(emitter.get(x3d::SurfaceEmitter::surface));
        measure();
        if (!areas_.empty())
            kind_ = Kind::surface;
        else
            warn(problems, "SurfaceEmitter has no surface: it emits nothing");
    } else if (emitter.is(x3d::VolumeEmitter::type)) {
        readVolume(scene, emitter, problems);
    }
}

void ParticleEmitter::readPolyline(const Scene& scene, const Node& emitter, Mesh& problems) {
    using E = x3d::PolylineEmitter;
    const Array<Vec3f> points = readPoints(scene, emitter.get(E::coord), problems);
    double length = 0;
    std::int64_t before = -1;
    for (const std::int32_t index : emitter.get(E::coordIndex)) {
        const bool fits = index >= 0 && static_cast<std::size_t>(index) < points.size() &&
                          usable(points[static_cast<std::size_t>(index)]);
        if (fits && before >= 0) {
            const Vec3d from(points[static_cast<std::size_t>(before)]), to(points[static_cast<std::size_t>(index)]);
            length += glm::length(to - from);
            segments_.push_back({from, to, length});
        }
        before = fits ? index : -1;
    }
    if (length > 0)
        kind_ = Kind::polyline;
    else
        warn(problems, "PolylineEmitter has no line: it emits nothing");
}

void ParticleEmitter::readVolume(const Scene& scene, const Node& emitter, Mesh& problems) {
    using E = x3d::VolumeEmitter;
    IndexedFaceSetParams faces;
    faces.coord = readPoints(scene, emitter.get(E::coord), problems);
    faces.coordIndex = emitter.get(E::coordIndex);
    faces.convex = false;
    auto mesh = std::make_shared<Mesh>(tessellate(faces));
    problems.diagnostics.append(mesh->diagnostics);
    mesh_ = std::move(mesh);
    measure();
    if (!areas_.empty())
        kind_ = emitter.get(E::internal) ? Kind::volume : Kind::skin;
    else
        warn(problems, "VolumeEmitter has no volume: it emits nothing");
}

void ParticleEmitter::measure() {
    double area = 0;
    for (std::uint32_t t = 0; mesh_ && t < mesh_->triangleCount; ++t) {
        const Vec3d a(mesh_->vertex(t, 0));
        area += .5 * glm::length(glm::cross(Vec3d(mesh_->vertex(t, 1)) - a, Vec3d(mesh_->vertex(t, 2)) - a));
        areas_.push_back(area);
    }
    if (!(area > 0) || !std::isfinite(area)) areas_.clear();
}

Vec3d ParticleEmitter::onPolyline(KeyedNumbers& numbers) const {
    const double at = numbers.next() * segments_.back().until;
    const auto found = std::ranges::upper_bound(segments_, at, {}, &Segment::until);
    const Segment& segment = found == segments_.end() ? segments_.back() : *found;
    const double length = glm::length(segment.to - segment.from);
    const double fraction = length > 0 ? 1 - (segment.until - at) / length : 0;
    return segment.from + (segment.to - segment.from) * fraction;
}

Vec3d ParticleEmitter::onSurface(KeyedNumbers& numbers, Vec3d* normal) const {
    const double at = numbers.next() * areas_.back();
    const auto found = std::ranges::upper_bound(areas_, at);
    const auto triangle = static_cast<std::uint32_t>(
        std::min<std::ptrdiff_t>(found - areas_.begin(), static_cast<std::ptrdiff_t>(areas_.size()) - 1));
    const double root = std::sqrt(numbers.next()), u = 1 - root, v = root * numbers.next();
    if (normal) {
        *normal = Vec3d(mesh_->shadingNormal(triangle, static_cast<float>(u), static_cast<float>(v)));
        // 40.4.7: of a surface with two sides either one.
        const bool back = numbers.next() < .5;
        if (back && !mesh_->solid) *normal = -*normal;
    }
    const Vec3d a(mesh_->vertex(triangle, 0)), b(mesh_->vertex(triangle, 1)), c(mesh_->vertex(triangle, 2));
    return a + (b - a) * u + (c - a) * v;
}

Vec3d ParticleEmitter::inVolume(KeyedNumbers& numbers) const {
    const Vec3d low(mesh_->bounds.min), size(mesh_->bounds.size());
    for (int i = 0; i < kMaxTries; ++i) {
        const double x = numbers.next(), y = numbers.next(), z = numbers.next();
        const Vec3d point = low + size * Vec3d(x, y, z);
        if (isInside(point)) return point;
    }
    return onSurface(numbers, nullptr);  // it is flat, or nearly so
}

double ParticleEmitter::tests() const {
    if (kind_ != Kind::volume) return 0;
    const Vec3d size(mesh_->bounds.size());
    const double tries = size.x * size.y * size.z / std::max(std::abs(enclosedVolume(*mesh_)), 1e-300);
    return std::clamp(tries, 1.0, double(kMaxTries)) * mesh_->triangleCount;
}

bool ParticleEmitter::isInside(const Vec3d& point) const {
    // How often a ray leaves; its direction lies in no plane that authors choose.
    const Vec3d direction(.5773218731, .3141783227, .7536218733);
    bool inside = false;
    for (std::uint32_t t = 0; t < mesh_->triangleCount; ++t) {
        const Vec3d a(mesh_->vertex(t, 0)), e = Vec3d(mesh_->vertex(t, 1)) - a, f = Vec3d(mesh_->vertex(t, 2)) - a;
        const Vec3d across = glm::cross(direction, f), to = point - a;
        const double scale = glm::dot(e, across);
        if (scale == 0) continue;
        const double u = glm::dot(to, across) / scale;
        const Vec3d q = glm::cross(to, e);
        const double v = glm::dot(direction, q) / scale;
        if (u >= 0 && v >= 0 && u + v <= 1 && glm::dot(f, q) / scale > 0) inside = !inside;
    }
    return inside;
}

void ParticleEmitter::emit(const EmissionSpan& span, KeyedNumbers& numbers, Vec3d& position, Vec3d& velocity) const {
    // 40.3.1: the bigger the variation, the more the speeds differ.
    const double speed = std::max(0.0, span.speed * (1 + span.variation * numbers.nextSigned()));
    Vec3d normal(0);
    position = span.position;
    if (kind_ == Kind::polyline) position = onPolyline(numbers);
    if (kind_ == Kind::surface) position = onSurface(numbers, &normal);
    if (kind_ == Kind::skin) position = onSurface(numbers, nullptr);
    if (kind_ == Kind::volume) position = inVolume(numbers);
    Vec3d direction;
    if (kind_ == Kind::surface)
        direction = normal;
    else if (kind_ == Kind::explosion)
        direction = directionInCone(Vec3d(0), -1, numbers);
    else
        direction = directionInCone(
            span.direction, kind_ == Kind::cone ? portable::cos(std::clamp(span.angle, 0.0, std::numbers::pi)) : 1,
            numbers);
    velocity = direction * speed;
}

}  // namespace rtsg::detail
