// Follows the ways to mirror images: mirrored by walls, and straight on through those that let sound pass.
#include "image_paths.h"

#include <algorithm>
#include <array>
#include <cstdint>

#include "response/band_classes.h"

namespace rtsg::trace {

namespace {

/// What walls mirror and let pass, by class of bands.
struct WallFractions {
    BandClasses classes;
    struct Fraction {
        Bands mirrored{}, transmitted{};
    };
    std::vector<Fraction> walls;  // by material

    explicit WallFractions(const AcousticGeometry& geometry)
        : classes(bandClasses(geometry.materials())), walls(geometry.materials().size()) {
        for (std::size_t i = 0; i < walls.size(); ++i)
            for (std::size_t c = 0; c < classes.count; ++c) {
                walls[i].mirrored[c] = geometry.materials()[i].mirrored(classes.first[c]);
                walls[i].transmitted[c] = geometry.materials()[i].transmission[classes.first[c]];
            }
    }
};

/// The walls around a source, for the ends of ways there: where it is nearer to several walls than single precision
/// tells apart, rays slip through between them.
class WallsAround {
  public:
    static constexpr double kRadius = .1;  // metres

    WallsAround(const AcousticGeometry& geometry, const glm::dvec3& source) : geometry_(&geometry) {
        known_ = geometry.trianglesNear(source, 2 * kRadius, triangles_);
    }
    /// As AcousticGeometry::closest(), of a way of which the next wall, if there is one, is met within the radius.
    bool closest(const glm::dvec3& origin, const glm::dvec3& direction, double maxDistance, std::uint32_t except,
                 AcousticHit& hit) const {
        if (!known_) return geometry_->closest(origin, direction, maxDistance, except, hit);
        hit.distance = maxDistance;
        bool met = false;
        for (const WallTriangle& wall : triangles_) {
            if (wall.plane == except) continue;
            const double t = (wall.offset - glm::dot(wall.normal, origin)) / glm::dot(wall.normal, direction);
            if (!(t >= 0 && t < hit.distance) || !holds(wall, origin + t * direction)) continue;
            hit = {t, wall.normal, wall.plane, wall.material, 0};
            met = true;
        }
        return met;
    }

  private:
    static bool holds(const WallTriangle& wall, const glm::dvec3& position) {
        const glm::dvec3 normal = glm::cross(wall.corners[1] - wall.corners[0], wall.corners[2] - wall.corners[0]);
        for (int i = 0; i < 3; ++i) {
            const glm::dvec3 edge = wall.corners[(i + 1) % 3] - wall.corners[i];
            const glm::dvec3 inwards = glm::cross(normal, edge);
            if (glm::dot(inwards, position - wall.corners[i]) < -wall.margin * glm::length(inwards)) return false;
        }
        return true;
    }

    const AcousticGeometry* geometry_;
    std::vector<WallTriangle> triangles_;
    bool known_ = false;
};

/// Follows the path from a listener towards an image: reflected by walls, and straight on through those that transmit
/// sound. A path that ends in the source after the image's motion is valid. The caller queries the hits and passes them
/// to step().
class Retracer {
  public:
    struct State {
        glm::dvec3 origin{0}, direction{0};
        glm::dmat3 rotation{1.0};
        Bands energy{};   // by class
        double left = 0;  // metres to go
        std::uint32_t plane = kNoPlane;
        int order = 0;
        int passed = 0, passedAtEnd = 0;  // walls that it went through
    };

    Retracer(const AcousticGeometry& geometry, const WallsAround& around, const WallFractions& fractions,
             const glm::dvec3& source, const glm::dvec3& listener, const ImageCandidate& image, int maxOrder,
             double minFraction, std::vector<Arrival>& found)
        : geometry_(&geometry),
          around_(&around),
          fractions_(&fractions),
          source_(source),
          listener_(listener),
          image_(&image),
          maxOrder_(maxOrder),
          minFraction_(minFraction),
          found_(&found) {}

    /// Whether there is a way to go.
    bool start() {
        const glm::dvec3 toImage = image_->position - listener_;
        distance_ = glm::length(toImage);
        if (!(distance_ > 0)) return false;
        state_ = {.origin = listener_, .direction = toImage / distance_, .left = distance_};
        std::fill_n(state_.energy.begin(), fractions_->classes.count, 1.0);
        return true;
    }
    const State& state() const { return state_; }
    /// How far to look.
    double reach() const { return reach(state_); }
    /// Continues to a hit that closest() found; false once the path has ended. Its last part, where walls may be nearer
    /// to the source than rays in a row allow, is followed at once.
    bool step(bool met, AcousticHit hit) {
        if (!met || state_.left - hit.distance <= WallsAround::kRadius) {
            AcousticHit exact;
            if (around_->closest(state_.origin, state_.direction, reach(), state_.plane, exact))
                met = true, hit = exact;
        }
        if (step(state_, met, hit) != Step::on) return false;
        if (state_.left > WallsAround::kRadius) return true;
        follow(state_);
        return false;
    }

  private:
    enum class Step : std::uint8_t { on, arrived, lost };

    double reach(const State& state) const { return state.left + imageTolerance(state.order, distance_); }
    bool worthFollowing(const Bands& energy, double minimum) {
        return *std::max_element(energy.begin(), energy.end()) > minimum && ++steps_ <= kMaxSteps;
    }

    /// Whether it ends in the source after the image's motion; notes the path if so.
    bool ends(const State& state, double slack) {
        if (!alike(state.rotation, image_->rotation) ||
            glm::distance(state.origin + state.direction * state.left, source_) > slack)
            return false;
        Arrival path;
        for (std::size_t b = 0; b < kBandCount; ++b) path.energy[b] = state.energy[fractions_->classes.of[b]];
        path.order = static_cast<std::uint32_t>(state.order);
        // Without a reflection it is direct sound.
        if (state.order > 0) found_->push_back(path);
        return true;
    }

    /// Whether the rest of the path, no longer than paths are exact, ends in the source.
    bool follow(State& state) {
        for (;;) {
            AcousticHit hit;
            const bool atEnd = state.left <= WallsAround::kRadius;
            const bool met = atEnd ? around_->closest(state.origin, state.direction, reach(state), state.plane, hit)
                                   : geometry_->closest(state.origin, state.direction, reach(state), state.plane, hit);
            if (const Step next = step(state, met, hit); next != Step::on) return next == Step::arrived;
        }
    }

    Step step(State& state, bool met, const AcousticHit& hit) {
        const double slack = imageTolerance(state.order, distance_);
        // If the source is nearer to walls than the path is exact, the path may end before or behind each of them: the
        // orientation tells which is meant.
        const bool atEnd = !met || hit.distance > state.left - slack;
        if (atEnd && ends(state, slack)) return Step::arrived;
        if (!met) return Step::lost;
        const WallFractions::Fraction& wall = fractions_->walls[hit.material];
        const glm::dvec3 point = state.origin + state.direction * hit.distance;
        Bands beyond = state.energy;
        for (std::size_t c = 0; c < fractions_->classes.count; ++c) {
            if (!atEnd) beyond[c] *= wall.transmitted[c];
            state.energy[c] *= wall.mirrored[c];
        }
        state.origin = point;
        state.left -= hit.distance;
        state.plane = hit.plane;
        // At an edge rays without a length go back and forth between its walls.
        if (state.passed < kMaxPassed && (!atEnd || state.passedAtEnd < kMaxPassedAtEnd) &&
            worthFollowing(beyond, minFraction_)) {
            State through = state;
            through.energy = beyond;
            ++through.passed;
            if (atEnd) ++through.passedAtEnd;
            if (follow(through) && atEnd) return Step::arrived;
        }
        if (state.order == maxOrder_ || !worthFollowing(state.energy, 0)) return Step::lost;
        state.direction -= hit.normal * (2 * glm::dot(state.direction, hit.normal));
        state.rotation = state.rotation * mirroring(hit.normal);
        ++state.order;
        return Step::on;
    }

    /// Each wall that lets sound pass doubles the ways.
    static constexpr int kMaxSteps = 20'000;
    /// Each wall passed is a call in a call; more than so many meet in no place.
    static constexpr int kMaxPassed = 256, kMaxPassedAtEnd = 8;
    const AcousticGeometry* geometry_;
    const WallsAround* around_;
    const WallFractions* fractions_;
    glm::dvec3 source_, listener_;
    const ImageCandidate* image_;
    int maxOrder_;
    double minFraction_, distance_ = 0;
    std::vector<Arrival>* found_;
    int steps_ = 0;
    State state_;
};

/// Follows the ways to some images, sixteen at a time.
void retrace(const AcousticGeometry& geometry, std::span<Retracer> retracers) {
    std::array<Retracer*, AcousticRays::kMax> lanes{};
    std::size_t count = 0, next = 0;
    for (;;) {
        while (count < lanes.size() && next < retracers.size()) {
            lanes[count] = &retracers[next++];
            if (lanes[count]->start()) ++count;
        }
        if (count == 0) return;
        AcousticRays rays;
        for (std::size_t i = 0; i < count; ++i) {
            const Retracer::State& state = lanes[i]->state();
            // Not from a place off the wall, which would meet the edges of others elsewhere.
            rays.add(state.origin, glm::dvec3(0), state.direction, lanes[i]->reach(), state.plane);
        }
        AcousticHits hits;
        const std::uint32_t met = geometry.closestOf(rays, hits);
        std::size_t left = 0;
        for (std::size_t i = 0; i < count; ++i)
            if (lanes[i]->step((met >> i & 1) != 0, hits[i])) lanes[left++] = lanes[i];
        count = left;
    }
}

}  // namespace

struct ImagePaths::Impl {
    const AcousticGeometry& geometry;
    WallFractions fractions;
    WallsAround around;
    glm::dvec3 source;
    int maxOrder;
    double minFraction;
};

ImagePaths::ImagePaths(const AcousticGeometry& geometry, const glm::dvec3& source, int maxOrder, double minFraction)
    : impl_(std::make_unique<Impl>(
          Impl{geometry, WallFractions(geometry), WallsAround(geometry, source), source, maxOrder, minFraction})) {}
ImagePaths::~ImagePaths() = default;

void ImagePaths::follow(std::span<const Asked> asked) const {
    std::vector<Retracer> retracers;
    retracers.reserve(asked.size());
    for (const Asked& one : asked)
        retracers.emplace_back(impl_->geometry, impl_->around, impl_->fractions, impl_->source, one.from, *one.image,
                               impl_->maxOrder, impl_->minFraction, *one.found);
    retrace(impl_->geometry, retracers);
}

}  // namespace rtsg::trace
