// Folds rays at the mirror, and shows edges and bodies on both sides of it.
#include "diffraction_mirror_world.h"

#include <algorithm>
#include <cmath>

#include "edges/diffraction_paths.h"

namespace rtsg {

MirrorWorld::MirrorWorld(const AcousticGeometry& geometry, std::uint32_t plane, const glm::dvec3& listener)
    : geometry_(geometry), plane_(plane) {
    const ReflectingPlane& mirror = geometry.planes()[plane];
    const double side = mirror.signedDistance(listener) < 0 ? -1 : 1;
    normal_ = side * mirror.normal;
    offset_ = side * mirror.offset;
}

double MirrorWorld::rounding(const glm::dvec3& position) const {
    return 1e-6 + 4 * positionRounding(position);
}

bool MirrorWorld::closest(const glm::dvec3& origin, const glm::dvec3& direction, double maxDistance,
                          std::uint32_t except, AcousticHit& hit) const {
    // On the listener's side, where walls are.
    bool beyond = isBeyond(origin);
    glm::dvec3 from = beyond ? mirrored(origin) : origin, displacement = beyond ? turned(direction) : direction;
    const double towards = -glm::dot(normal_, displacement), off = rounding(from), above = height(from);
    double done = 0;
    if (towards > 0 && above < maxDistance * towards) {
        const double toMirror = above / towards, margin = std::min(off / towards, 0.01 * (1 + toMirror));
        if (above > off) {
            const bool met = geometry_.closest(from, displacement, toMirror + margin, except, hit);
            if (!met || hit.distance < toMirror - margin || std::abs(glm::dot(hit.normal, normal_)) < 0.999) {
                // A hole in the mirror, through which the mirrored world is not seen.
                if (!met) hit = {toMirror, normal_, plane_, 0, 0};
                if (beyond) hit.normal = turned(hit.normal);
                return true;
            }
        }
        done = toMirror;
        from += displacement * done + normal_ * off;
        displacement = turned(displacement);
        beyond = !beyond;
        except = plane_;
    }
    if (!geometry_.closest(from, displacement, maxDistance - done, except, hit)) return false;
    hit.distance += done;
    if (beyond) hit.normal = turned(hit.normal);
    return true;
}

bool MirrorWorld::blocked(const glm::dvec3& origin, const glm::dvec3& facing, const glm::dvec3& direction,
                          double distance, std::uint32_t except) const {
    static_cast<void>(facing);
    AcousticHit hit;
    return closest(origin, direction, distance, except, hit);
}

double MirrorWorld::distanceToSurface(const glm::dvec3& point) const {
    return geometry_.distanceToSurface(isBeyond(point) ? mirrored(point) : point);
}

void MirrorWorld::surfacesNear(const glm::dvec3& point, double radius, const SurfaceVisitor& visit) const {
    const bool beyond = isBeyond(point);
    geometry_.surfacesNear(beyond ? mirrored(point) : point, radius, [&](const NearSurface& surface) {
        NearSurface one = surface;
        if (beyond) one.normal = turned(one.normal);
        visit(one);
    });
}

void MirrorWorld::visitEdges(const EdgeVisitor& visit) const {
    // Edges of a body come one after the other.
    const WallBody *body = nullptr, *image = nullptr;
    geometry_.visitEdges([&](const WallEdge& edge) {
        const glm::dvec3 end = edge.from + edge.axis * edge.length;
        const double low = height(edge.from), high = height(end), off = std::max(rounding(edge.from), rounding(end));
        if (!(std::max(low, high) > off)) return;
        WallEdge above = edge;
        // A mirror does not show things behind it.
        if (std::min(low, high) < -off) {
            const double part = low / (low - high) * edge.length;
            if (low < 0) {
                above.from += edge.axis * part;
                above.length -= part;
            } else {
                above.length = part;
            }
        }
        visit(above);
        if (above.body != body) {
            body = above.body;
            image = mirrored(body);
        }
        above = mirrored(above);
        above.body = image;
        visit(above);
    });
}

void MirrorWorld::visitRoundBodies(const RoundVisitor& visit) const {
    geometry_.visitRoundBodies([&](const RoundBody& body) {
        const double middle = height(body.center), upright = std::abs(glm::dot(body.axis, normal_));
        if (!(middle > 0)) return;
        RoundBody one = body;
        // One with its image, if it stands on the mirror.
        if (!body.sphere && upright > 1 - 1e-9 && std::abs(middle - body.halfLength) < rounding(body.center)) {
            one.center -= normal_ * middle;
            one.halfLength += middle;
            visit(one);
            return;
        }
        visit(one);
        visit(mirrored(one));
    });
}

WallEdge MirrorWorld::mirrored(const WallEdge& edge) const {
    WallEdge image = edge;
    image.from = mirrored(edge.from);
    image.axis = turned(edge.axis);
    image.faceA = turned(edge.faceA);
    image.faceB = turned(edge.faceB);
    return image;
}

RoundBody MirrorWorld::mirrored(const RoundBody& body) const {
    RoundBody image = body;
    image.center = mirrored(body.center);
    image.axis = turned(body.axis);
    image.middle = turned(body.middle);
    return image;
}

const WallBody* MirrorWorld::mirrored(const WallBody* body) const {
    if (!body) return nullptr;
    const std::scoped_lock lock(mutex_);
    const auto [known, fresh] = bodies_.try_emplace(body, *body);
    WallBody& image = known->second;
    if (fresh) {
        const glm::dmat3 rotation = glm::dmat3(1.0) - 2.0 * glm::outerProduct(normal_, normal_);
        image.middle = mirrored(body->middle);
        image.half = rotation * body->half;
        image.boxFromWorld = body->boxFromWorld * rotation;
    }
    return &image;
}

}  // namespace rtsg
