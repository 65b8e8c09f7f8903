// Tells which images are by facets of a round side, and makes those by the facets that stand for them.
#include "side_images.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>

#include "edges/edge_paths.h"

namespace rtsg {
namespace {

/// What stands for facets turns from them by at most half of a twelfth of a turn, and as much again on an oval.
constexpr double kLeastAlike = 0.86;

/// On the facet's plane or beside it, within its corners or up to `off` metres beyond them.
bool isOn(const SideFacet& facet, const glm::dvec3& place, double off) {
    if (std::abs(glm::dot(place - facet.corners.front(), facet.outward)) > facet.bulge + off) return false;
    glm::dvec3 middle(0);
    for (const glm::dvec3& corner : facet.corners) middle += corner / static_cast<double>(facet.corners.size());
    for (std::size_t i = 0; i < facet.corners.size(); ++i) {
        const glm::dvec3 &from = facet.corners[i], side = facet.corners[(i + 1) % facet.corners.size()] - from;
        const double length = glm::length(side);
        if (!(length > 0)) continue;  // at an apex
        const glm::dvec3 inward = glm::cross(facet.outward, side) / length;
        const double within = std::copysign(1.0, glm::dot(middle - from, inward)) * glm::dot(place - from, inward);
        if (within < -off) return false;
    }
    return true;
}

bool isOutside(const SideFacet& facet, const glm::dvec3& place) {
    return glm::dot(place - facet.corners.front(), facet.outward) > 0;
}

/// The place where the way from an image of the source comes to the mirror, and the mirror's normal to the source's
/// side; none if that is in the mirror.
struct Mirrored {
    glm::dvec3 place, normal;
};
std::optional<Mirrored> mirroredAt(const glm::dvec3& source, const glm::dvec3& listener, const glm::dvec3& image) {
    const glm::dvec3 way = source - image, line = listener - image;
    const double apart = glm::length(way), towards = glm::dot(line, way);
    if (!(apart > 0) || !(towards > 1e-12 * apart * glm::length(line))) return {};
    return Mirrored{image + line * (0.5 * apart * apart / towards), way / apart};
}

}  // namespace

std::vector<SideFacet> facetsAt(const WallEdge& edge) {
    if (!edge.rim || edge.rim->facet.empty()) return {};
    SideFacet facet;
    facet.corners = edge.rim->facet;
    const glm::dvec3 across = glm::cross(facet.corners[1] - facet.corners[0], edge.axis);
    const double size = glm::length(across);
    if (!(size > 0)) return {};
    facet.outward = across * (std::copysign(1.0, -glm::dot(across, edge.faceA + edge.faceB)) / size);
    facet.bulge = glm::length(edge.rim->bulge);
    facet.material = edge.material;
    return {facet};
}

void replaceSideImages(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                       const TraceOptions& options, double longest, const std::vector<SideFacet>& facets,
                       std::vector<Arrival>& arrivals) {
    const double c = options.air.speedOfSound;
    std::erase_if(arrivals, [&](const Arrival& one) {
        if (one.order != 1) return false;
        const auto at = mirroredAt(source, listener, listener + one.direction * (one.seconds * c));
        return at && std::ranges::any_of(facets, [&](const SideFacet& facet) {
                   return glm::dot(at->normal, facet.outward) > kLeastAlike &&
                          isOn(facet, at->place, 1.5 * facet.bulge);
               });
    });
    const Bands attenuation = airAttenuation(options.air);
    for (const SideFacet& facet : facets) {
        if (!isOutside(facet, source) || !isOutside(facet, listener)) continue;
        const glm::dvec3& normal = facet.outward;
        const glm::dvec3 image = source - normal * (2 * glm::dot(source - facet.corners.front(), normal));
        const auto at = mirroredAt(source, listener, image);
        const double way = glm::distance(image, listener);
        if (!at || !(way < longest) || !isOn(facet, at->place, 0)) continue;
        const glm::dvec3 above = at->place + normal * (1.1 * facet.bulge);
        if (!seen(geometry, source, above) || !seen(geometry, listener, above)) continue;
        Arrival arrival;
        arrival.seconds = way / c;
        arrival.order = 1;
        arrival.direction = (image - listener) / way;
        arrival.turn = glm::mat3(glm::dmat3(1) - 2.0 * glm::outerProduct(normal, normal));
        const double sent = options.pattern ? options.pattern(glm::normalize(at->place - source)) : 1;
        const double spread = sent / (4 * std::numbers::pi * way * way);
        for (std::size_t b = 0; b < kBandCount; ++b)
            arrival.energy[b] =
                spread * geometry.materials()[facet.material].mirrored(b) * std::exp(-attenuation[b] * way);
        if (spread > 0) arrivals.push_back(arrival);
    }
    std::ranges::stable_sort(arrivals, {}, &Arrival::seconds);
}

}  // namespace rtsg
