// Looks along an edge, several rays at a time.
#include "diffraction_hidden_parts.h"

#include <algorithm>
#include <array>

#include "diffraction_paths.h"

namespace rtsg {
namespace {

/// On either side of the shortest way, each half as far off as the next one: with the middle they are fifteen, as many
/// as rays are asked about at once.
constexpr int kPlacesASide = 7;

class EdgeView {
  public:
    EdgeView(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
             const WallEdge& edge)
        : geometry_(geometry), source_(source), listener_(listener), edge_(edge) {}

    glm::dvec3 placeAt(double along) const { return edge_.from + edge_.axis * along; }
    /// A bit for each place, metres from the beginning on; at most AcousticRays::kMost.
    std::uint32_t seenAt(const std::vector<double>& places) const {
        const std::uint32_t all = (1u << places.size()) - 1;
        const std::uint32_t seen = all & ~hidden(source_, places);
        return seen == 0 ? 0 : seen & ~hidden(listener_, places);
    }
    bool seenAt(double place) const {
        const glm::dvec3 at = placeAt(place);
        return seen(geometry_, source_, aimAt(edge_, at, source_)) &&
               seen(geometry_, listener_, aimAt(edge_, at, listener_)) && (!covered_ || isOpen(geometry_, edge_, at));
    }
    /// Another body touches the edge somewhere: the covered part is not seen.
    void lookUnderBodies(const std::vector<double>& places, std::uint32_t& seen) {
        covered_ = true;
        for (std::size_t i = 0; i < places.size(); ++i)
            if ((seen >> i & 1) && !isOpen(geometry_, edge_, placeAt(places[i]))) seen &= ~(1u << i);
    }
    /// Between a place that is seen and one that is not.
    double boundary(double within, double beyond) const {
        for (int step = 0; step < 6; ++step) {
            const double middle = 0.5 * (within + beyond);
            (seenAt(middle) ? within : beyond) = middle;
        }
        return within;
    }

  private:
    std::uint32_t hidden(const glm::dvec3& from, const std::vector<double>& places) const {
        AcousticRays rays;
        for (const double place : places) {
            const glm::dvec3 at = aimAt(edge_, placeAt(place), from), way = at - from;
            const double distance = glm::length(way);
            rays.add(from, glm::dvec3(0), distance > 0 ? way / distance : edge_.axis,
                     std::max(0.0, distance - seenRounding(distance, at)), kNoPlane);
        }
        AcousticHits hits;
        return geometry_.closestOf(rays, hits);
    }

    const AcousticGeometry& geometry_;
    const glm::dvec3 &source_, &listener_;
    const WallEdge& edge_;
    bool covered_ = false;
};

}  // namespace

std::vector<EdgePart> partsSeen(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                                const WallEdge& edge, const glm::dvec3& by) {
    EdgeView view(geometry, source, listener, edge);
    const auto along = [&](const glm::dvec3& place) { return glm::dot(offEnds(edge, place) - edge.from, edge.axis); };
    const double middle = along(by), first = along(edge.from), last = along(edge.from + edge.axis * edge.length);
    std::vector<double> places{middle};
    double step = 1;
    for (int i = 0; i < kPlacesASide; ++i, step *= 0.5) {
        if (middle > first) places.push_back(middle - (middle - first) * step);
        if (last > middle) places.push_back(middle + (last - middle) * step);
    }
    std::sort(places.begin(), places.end());
    std::uint32_t seen = view.seenAt(places);
    if (seen != 0 && !isOpen(geometry, edge, view.placeAt(middle))) view.lookUnderBodies(places, seen);
    std::vector<EdgePart> parts;
    for (std::size_t i = 0; i < places.size(); ++i) {
        if (!(seen >> i & 1)) continue;
        const bool before = i > 0 && (seen >> (i - 1) & 1), after = i + 1 < places.size() && (seen >> (i + 1) & 1);
        if (!before) parts.push_back({i == 0 ? 0 : view.boundary(places[i], places[i - 1]), 0});
        if (!after) parts.back().to = i + 1 == places.size() ? edge.length : view.boundary(places[i], places[i + 1]);
    }
    return parts;
}

}  // namespace rtsg
