// Looks along an edge, several rays at a time.
#include "diffraction_hidden_parts.h"

#include <algorithm>
#include <array>

#include "diffraction_paths.h"

namespace rtsg {
namespace {

/// On either side of the shortest way, each half as far off as the next one: with the middle they are fifteen, as many
/// as rays are asked about at once.
constexpr int kPointsASide = 7;

class EdgeView {
  public:
    EdgeView(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
             const WallEdge& edge)
        : geometry_(geometry), source_(source), listener_(listener), edge_(edge) {}

    glm::dvec3 positionAt(double along) const { return edge_.from + edge_.axis * along; }
    /// A bit for each place, metres from the beginning on; at most AcousticRays::kMax.
    std::uint32_t seenAt(const std::vector<double>& positions) const {
        const std::uint32_t all = (1u << positions.size()) - 1;
        const std::uint32_t seen = all & ~hidden(source_, positions);
        return seen == 0 ? 0 : seen & ~hidden(listener_, positions);
    }
    bool seenAt(double position) const {
        const glm::dvec3 at = positionAt(position);
        return seen(geometry_, source_, aimAt(edge_, at, source_)) &&
               seen(geometry_, listener_, aimAt(edge_, at, listener_)) && (!covered_ || isOpen(geometry_, edge_, at));
    }
    /// Another body touches the edge somewhere: the covered part is not seen.
    void lookUnderBodies(const std::vector<double>& positions, std::uint32_t& seen) {
        covered_ = true;
        for (std::size_t i = 0; i < positions.size(); ++i)
            if ((seen >> i & 1) && !isOpen(geometry_, edge_, positionAt(positions[i]))) seen &= ~(1u << i);
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
    std::uint32_t hidden(const glm::dvec3& from, const std::vector<double>& positions) const {
        AcousticRays rays;
        for (const double position : positions) {
            const glm::dvec3 at = aimAt(edge_, positionAt(position), from), displacement = at - from;
            const double distance = glm::length(displacement);
            rays.add(from, glm::dvec3(0), distance > 0 ? displacement / distance : edge_.axis,
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
    const auto along = [&](const glm::dvec3& position) {
        return glm::dot(offEnds(edge, position) - edge.from, edge.axis);
    };
    const double middle = along(by), first = along(edge.from), last = along(edge.from + edge.axis * edge.length);
    std::vector<double> positions{middle};
    double step = 1;
    for (int i = 0; i < kPointsASide; ++i, step *= 0.5) {
        if (middle > first) positions.push_back(middle - (middle - first) * step);
        if (last > middle) positions.push_back(middle + (last - middle) * step);
    }
    std::sort(positions.begin(), positions.end());
    std::uint32_t seen = view.seenAt(positions);
    if (seen != 0 && !isOpen(geometry, edge, view.positionAt(middle))) view.lookUnderBodies(positions, seen);
    std::vector<EdgePart> parts;
    for (std::size_t i = 0; i < positions.size(); ++i) {
        if (!(seen >> i & 1)) continue;
        const bool before = i > 0 && (seen >> (i - 1) & 1), after = i + 1 < positions.size() && (seen >> (i + 1) & 1);
        if (!before) parts.push_back({i == 0 ? 0 : view.boundary(positions[i], positions[i - 1]), 0});
        if (!after)
            parts.back().to = i + 1 == positions.size() ? edge.length : view.boundary(positions[i], positions[i + 1]);
    }
    return parts;
}

}  // namespace rtsg
