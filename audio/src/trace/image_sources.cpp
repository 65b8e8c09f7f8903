// Mirrors a source in the planes of a room and keeps the images whose path really leads to the listener.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include <rtsg/audio/image_sources.h>
#include <rtsg/renderers/parallel_for.h>

#include "band_classes.h"
#include "places.h"

namespace rtsg {
namespace {

using trace::BandClasses;
using trace::bandClasses;

constexpr double kCell = 0.25;
/// Paths are checked from a listener this far beside the true one: symmetric rooms are full of paths that meet an edge
/// exactly, where it is chance which wall is hit, and whether both are.
const glm::dvec3 kAside{4.1e-4, 6.3e-4, 2.9e-4};

/// How far an image, or the end of its path, may be from where it should be: walls are given in single precision, so
/// each reflection turns what is far away by some of its roundings.
double tolerance(int order, double distance) {
    return 2e-6 * (1 + order) * (1 + distance);
}

/// The turn of a reflection.
glm::dmat3 mirroring(const glm::dvec3& normal) {
    return glm::dmat3(1.0) - 2.0 * glm::outerProduct(normal, normal);
}

bool alike(const glm::dmat3& a, const glm::mat3& b) {
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k)
            if (std::abs(a[i][k] - static_cast<double>(b[i][k])) > 1e-3) return false;
    return true;
}

struct Candidate {
    glm::dvec3 position;
    glm::mat3 turn;           // of the source on its way there
    std::uint32_t lastPlane;  // of one of the ways to get here
    double share;             // of energy that is left at best
    bool severalWays = false;
};

/// Candidates by position.
class CandidateSet {
  public:
    std::vector<Candidate> all;

    /// False when it was there already; `same` is how near the positions of one are.
    bool insert(const glm::dvec3& p, const glm::dmat3& turn, std::uint32_t lastPlane, double share, double same) {
        const glm::dvec3 low = glm::floor((p - same) / kCell), high = glm::floor((p + same) / kCell);
        for (double x = low.x; x <= high.x; ++x)
            for (double y = low.y; y <= high.y; ++y)
                for (double z = low.z; z <= high.z; ++z) {
                    for (std::uint32_t i = newestIn(key({x, y, z})).newest; i != kNoPlane; i = next_[i])
                        if (glm::distance(all[i].position, p) < same && alike(turn, all[i].turn)) {
                            if (all[i].lastPlane != lastPlane) all[i].severalWays = true;
                            all[i].share = std::max(all[i].share, share);
                            return false;
                        }
                }
        const auto index = static_cast<std::uint32_t>(all.size());
        all.push_back({p, glm::mat3(turn), lastPlane, share});
        if (2 * all.size() > buckets_.size()) grow();
        Bucket& bucket = newestIn(key(glm::floor(p / kCell)));
        bucket.cell = key(glm::floor(p / kCell));
        next_.push_back(std::exchange(bucket.newest, index));
        return true;
    }

  private:
    static std::uint64_t key(const glm::dvec3& cell) {
        std::uint64_t result = 0;
        for (int i = 0; i < 3; ++i) {
            result = (result ^ static_cast<std::uint64_t>(static_cast<std::int64_t>(cell[i]))) * 0x9E3779B97F4A7C15ull;
            result ^= result >> 31;
        }
        return result;
    }

    /// Of a cell: the last of its candidates; none as long as it is free.
    struct Bucket {
        std::uint64_t cell = 0;
        std::uint32_t newest = kNoPlane;
    };
    /// That of a cell, or the free one where it belongs.
    Bucket& newestIn(std::uint64_t cell) {
        for (std::size_t at = cell;; ++at) {
            Bucket& bucket = buckets_[at & (buckets_.size() - 1)];
            if (bucket.cell == cell || bucket.newest == kNoPlane) return bucket;
        }
    }
    void grow() {
        std::vector<Bucket> before(2 * buckets_.size());
        before.swap(buckets_);
        for (const Bucket& bucket : before)
            if (bucket.newest != kNoPlane) newestIn(bucket.cell) = bucket;
    }

    std::vector<Bucket> buckets_{64};
    std::vector<std::uint32_t> next_;  // of the same cell
};

/// Whether sound of an image at `p` that passes through the surfaces of `through` can reach those of `next`: both
/// seen from `p` as bounding spheres. Never false for a possible path.
bool canFollow(const glm::dvec3& p, const ReflectingPlane& through, const ReflectingPlane& next) {
    // The reflected sound lives on the side of `through` away from the image.
    const double side = through.signedDistance(p) > 0 ? -1 : 1;
    if (side * through.signedDistance(next.center) + next.radius <= 0) return false;
    const glm::dvec3 a = through.center - p, b = next.center - p;
    const double lengthA = glm::length(a), lengthB = glm::length(b);
    if (lengthA <= through.radius || lengthB <= next.radius) return true;
    const double spread = std::asin(through.radius / lengthA) + std::asin(next.radius / lengthB);
    return std::acos(std::clamp(glm::dot(a, b) / (lengthA * lengthB), -1.0, 1.0)) <= spread + 1e-6;
}

/// What walls mirror and let pass, by class of bands.
struct WallShares {
    BandClasses classes;
    struct Share {
        Bands mirrored{}, transmitted{};
    };
    std::vector<Share> walls;  // by material

    explicit WallShares(const AcousticGeometry& geometry)
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
    static bool holds(const WallTriangle& wall, const glm::dvec3& place) {
        const glm::dvec3 normal = glm::cross(wall.corners[1] - wall.corners[0], wall.corners[2] - wall.corners[0]);
        for (int i = 0; i < 3; ++i) {
            const glm::dvec3 edge = wall.corners[(i + 1) % 3] - wall.corners[i];
            const glm::dvec3 inwards = glm::cross(normal, edge);
            if (glm::dot(inwards, place - wall.corners[i]) < -wall.margin * glm::length(inwards)) return false;
        }
        return true;
    }

    const AcousticGeometry* geometry_;
    std::vector<WallTriangle> triangles_;
    bool known_ = false;
};

/// Follows the way from a listener towards an image: mirrored by walls, and straight on through those that let sound
/// pass. What ends in the source after the image's motion is a path. Who asks what the way meets tells step().
class Retracer {
  public:
    struct State {
        glm::dvec3 origin{0}, direction{0};
        glm::dmat3 turn{1.0};
        Bands energy{};   // by class
        double left = 0;  // metres to go
        std::uint32_t plane = kNoPlane;
        int order = 0;
        int passed = 0, passedAtEnd = 0;  // walls that it went through
    };

    Retracer(const AcousticGeometry& geometry, const WallsAround& around, const WallShares& shares,
             const glm::dvec3& source, const glm::dvec3& listener, const Candidate& image, int maxOrder,
             double minShare, std::vector<Arrival>& found)
        : geometry_(&geometry),
          around_(&around),
          shares_(&shares),
          source_(source),
          listener_(listener),
          image_(&image),
          maxOrder_(maxOrder),
          minShare_(minShare),
          found_(&found) {}

    /// Whether there is a way to go.
    bool start() {
        const glm::dvec3 toImage = image_->position - listener_;
        distance_ = glm::length(toImage);
        if (!(distance_ > 0)) return false;
        state_ = {.origin = listener_, .direction = toImage / distance_, .left = distance_};
        std::fill_n(state_.energy.begin(), shares_->classes.count, 1.0);
        return true;
    }
    const State& state() const { return state_; }
    /// How far to look.
    double reach() const { return reach(state_); }
    /// Goes on to what was met, as closest() says; false once the way has come to its end. The last of it, where walls
    /// may be nearer to the source than rays in a row leave them, is gone at once.
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

    double reach(const State& state) const { return state.left + tolerance(state.order, distance_); }
    bool worthFollowing(const Bands& energy, double least) {
        return *std::max_element(energy.begin(), energy.end()) > least && ++steps_ <= kMostSteps;
    }

    /// Whether it ends in the source after the image's motion; notes the path if so.
    bool ends(const State& state, double slack) {
        if (!alike(state.turn, image_->turn) ||
            glm::distance(state.origin + state.direction * state.left, source_) > slack)
            return false;
        Arrival path;
        for (std::size_t b = 0; b < kBandCount; ++b) path.energy[b] = state.energy[shares_->classes.of[b]];
        path.order = static_cast<std::uint32_t>(state.order);
        // Without a reflection it is direct sound.
        if (state.order > 0) found_->push_back(path);
        return true;
    }

    /// Whether what is left of the way, no longer than paths are exact, ends in the source.
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
        const double slack = tolerance(state.order, distance_);
        // Where the source is nearer to walls than the path is exact, it may end before or behind each of them: the
        // turn tells which is meant.
        const bool atEnd = !met || hit.distance > state.left - slack;
        if (atEnd && ends(state, slack)) return Step::arrived;
        if (!met) return Step::lost;
        const WallShares::Share& wall = shares_->walls[hit.material];
        const glm::dvec3 point = state.origin + state.direction * hit.distance;
        Bands beyond = state.energy;
        for (std::size_t c = 0; c < shares_->classes.count; ++c) {
            if (!atEnd) beyond[c] *= wall.transmitted[c];
            state.energy[c] *= wall.mirrored[c];
        }
        state.origin = point;
        state.left -= hit.distance;
        state.plane = hit.plane;
        // At an edge rays without a length go back and forth between its walls.
        if (state.passed < kMostPassed && (!atEnd || state.passedAtEnd < kMostPassedAtEnd) &&
            worthFollowing(beyond, minShare_)) {
            State through = state;
            through.energy = beyond;
            ++through.passed;
            if (atEnd) ++through.passedAtEnd;
            if (follow(through) && atEnd) return Step::arrived;
        }
        if (state.order == maxOrder_ || !worthFollowing(state.energy, 0)) return Step::lost;
        state.direction -= hit.normal * (2 * glm::dot(state.direction, hit.normal));
        state.turn = state.turn * mirroring(hit.normal);
        ++state.order;
        return Step::on;
    }

    /// Each wall that lets sound pass doubles the ways.
    static constexpr int kMostSteps = 20'000;
    /// Each wall passed is a call in a call; more than so many meet in no place.
    static constexpr int kMostPassed = 256, kMostPassedAtEnd = 8;
    const AcousticGeometry* geometry_;
    const WallsAround* around_;
    const WallShares* shares_;
    glm::dvec3 source_, listener_;
    const Candidate* image_;
    int maxOrder_;
    double minShare_, distance_ = 0;
    std::vector<Arrival>* found_;
    int steps_ = 0;
    State state_;
};

/// Follows the ways to some images, sixteen at a time.
void retrace(const AcousticGeometry& geometry, std::span<Retracer> ways) {
    std::array<Retracer*, AcousticRays::kMost> lanes{};
    std::size_t count = 0, next = 0;
    for (;;) {
        while (count < lanes.size() && next < ways.size()) {
            lanes[count] = &ways[next++];
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

/// A place a little aside of the listener, with nothing in between.
glm::dvec3 aside(const AcousticGeometry& geometry, const glm::dvec3& listener) {
    glm::dvec3 step = kAside;
    for (int attempt = 0; attempt < 24; ++attempt) {
        AcousticHit hit;
        const double length = glm::length(step);
        if (!geometry.closest(listener, step / length, 2 * length, kNoPlane, hit)) return listener + step;
        // Back from the wall; between walls that are nearer to each other than this, a shorter way.
        step -= hit.normal * (2 * glm::dot(step, hit.normal));
        if (attempt % 6 == 5) step *= 0.1;
    }
    return listener;
}

/// Finds candidates order by order, as far as the options allow.
void findCandidates(const AcousticGeometry& geometry, const ImageSourceOptions& options, CandidateSet& candidates,
                    std::size_t& mirroredOnce, ImageSources& result) {
    const auto planes = geometry.planes();
    std::size_t generation = 0, attempts = 0;
    const std::size_t maxAttempts = 64 * std::max<std::size_t>(options.maxCandidates, 1000);
    result.complete = planes.empty();
    for (int order = 1; order <= options.maxOrder && !planes.empty(); ++order) {
        const std::size_t end = candidates.all.size();
        bool whole = true;
        for (std::size_t i = generation; i < end && whole; ++i)
            for (std::uint32_t p = 0; p < planes.size(); ++p) {
                // In a room of many small surfaces most pairs see each other not at all, which takes time to find out.
                if (++attempts > maxAttempts || candidates.all.size() > options.maxCandidates) {
                    whole = false;
                    break;
                }
                const Candidate from = candidates.all[i];
                const double share = from.share * planes[p].mirrors;
                if (from.lastPlane == p || share < options.minShare) continue;
                if (from.lastPlane != kNoPlane && !from.severalWays &&
                    !canFollow(from.position, planes[from.lastPlane], planes[p]))
                    continue;
                const glm::dvec3& normal = planes[p].normal;
                const glm::dvec3 image = from.position - normal * (2 * planes[p].signedDistance(from.position));
                const double away = glm::distance(image, candidates.all[0].position);
                candidates.insert(image, mirroring(normal) * glm::dmat3(from.turn), p, share,
                                  std::min(2e-3, tolerance(order, away)));
            }
        if (!whole) {
            candidates.all.resize(end);
            return;
        }
        generation = end;
        if (order == 1) mirroredOnce = candidates.all.size();
        result.order = order;
        if (candidates.all.size() == end) {
            result.order = options.maxOrder;  // nothing more to find
            result.complete = true;
            return;
        }
    }
}

}  // namespace

Bands directShare(const AcousticGeometry& geometry, const glm::dvec3& from, const glm::dvec3& to) {
    Bands share = allBands(1);
    const glm::dvec3 source = offSolids(geometry, from, to), listener = offSolids(geometry, to, from);
    const glm::dvec3 toSource = source - listener;
    const double distance = glm::length(toSource);
    if (!(distance > 0)) return share;
    const glm::dvec3 direction = toSource / distance;
    glm::dvec3 origin = listener;
    double left = distance;
    std::uint32_t plane = kNoPlane;
    AcousticHit hit;
    while (geometry.closest(origin, direction, left, plane, hit)) {
        bool any = false;
        for (std::size_t b = 0; b < kBandCount; ++b) {
            share[b] *= geometry.materials()[hit.material].transmission[b];
            any = any || share[b] > 0;
        }
        if (!any) break;
        origin += direction * hit.distance;
        left -= hit.distance;
        plane = hit.plane;
    }
    return share;
}

struct ImageCandidates::Impl {
    CandidateSet set;
    std::size_t mirroredOnce = 1;  // end of those
    ImageSources found;
};

namespace {

/// From where the way to each candidate is looked for: to those that are mirrored once from the listener's place, to
/// others from one in the ball around it. Where walls hide some, to the loudest from several; and where these differ,
/// from all.
class ImageViews {
  public:
    ImageViews(const AcousticGeometry& geometry, const ImageCandidates::Impl& candidates, const glm::dvec3& listener,
               const ImageSourceOptions& options)
        : all_(candidates.set.all),
          listener_(listener),
          beside_(aside(geometry, listener)),
          once_(options.ball > 0 ? candidates.mirroredOnce : all_.size()),
          counts_(all_.size(), 1) {
        counts_[0] = 0;  // the source itself
        if (once_ == all_.size()) return;
        places_ = placesAround(geometry, listener, options.ball, kPlaces);
        if (places_.empty()) places_.push_back(beside_);
        const ReflectingPlane ball{.center = listener, .radius = options.ball};
        for (std::size_t i = once_; i < all_.size(); ++i)
            if (!all_[i].severalWays && !canFollow(all_[i].position, geometry.planes()[all_[i].lastPlane], ball))
                counts_[i] = 0;
    }

    /// How often each is looked for by now.
    std::size_t count(std::size_t candidate) const { return counts_[candidate]; }
    glm::dvec3 place(std::size_t candidate, std::size_t k) const {
        if (candidate < once_) return beside_;
        // Each of its own, so that what is beyond one wall does not come and go at once.
        const std::uint64_t first = (candidate * 0x9E3779B97F4A7C15ull) >> 32;
        return places_[(first + k) % places_.size()];
    }

    /// Those that are to be looked for from more places, after one each.
    std::vector<std::size_t> loudest(const std::vector<std::vector<Arrival>>& ways) {
        std::vector<std::pair<double, std::size_t>> heard;
        std::size_t hidden = 0;
        for (std::size_t i = once_; i < all_.size(); ++i) {
            if (counts_[i] == 0) continue;
            const glm::dvec3 away = all_[i].position - listener_;
            heard.emplace_back(all_[i].share / (1e-4 + glm::dot(away, away)), i);
            hidden += ways[i].empty();
        }
        // Where so many are seen, each from another place, nothing hides any.
        if (hidden == 0 && heard.size() >= kEnough) return {};
        const std::size_t loud = std::min(kLoud, heard.size());
        std::nth_element(heard.begin(), heard.begin() + static_cast<std::ptrdiff_t>(loud), heard.end(),
                         std::greater<>());
        std::vector<std::size_t> result;
        for (std::size_t k = 0; k < loud; ++k) result.push_back(heard[k].second);
        for (const std::size_t i : result) counts_[i] = kOfLoud;
        return result;
    }
    /// Leaves those of them that some places see and others do not; all count then.
    void leaveUnsure(const std::vector<std::vector<Arrival>>& ways, std::vector<std::size_t>& candidates) {
        std::erase_if(candidates, [&](std::size_t i) { return ways[i].empty() || ways[i].size() >= kOfLoud; });
        for (const std::size_t i : candidates) counts_[i] = std::max(kOfLoud, places_.size());
    }

    static constexpr std::size_t kOfLoud = 8;

  private:
    static constexpr std::size_t kPlaces = 64, kLoud = 4096, kEnough = 256;

    const std::vector<Candidate>& all_;
    glm::dvec3 listener_, beside_;
    std::size_t once_;  // so many come first
    std::vector<std::size_t> counts_;
    std::vector<glm::dvec3> places_;
};

/// Of the ways to one image from `count` places the mean, as one.
void average(std::vector<Arrival>& paths, std::size_t count) {
    if (paths.empty()) return;
    Arrival& mean = paths.front();
    for (std::size_t b = 0; b < kBandCount; ++b) {
        double sum = 0;
        for (const Arrival& path : paths) sum += path.energy[b];
        mean.energy[b] = sum / static_cast<double>(count);
    }
    paths.resize(1);
}

}  // namespace

ImageCandidates::ImageCandidates(const AcousticGeometry& geometry, const glm::dvec3& source,
                                 const ImageSourceOptions& options)
    : impl_(std::make_unique<Impl>()) {
    impl_->set.insert(source, glm::dmat3(1.0), kNoPlane, 1, 0);
    findCandidates(geometry, options, impl_->set, impl_->mirroredOnce, impl_->found);
    impl_->found.candidates = impl_->set.all.size();
}
ImageCandidates::ImageCandidates(ImageCandidates&&) noexcept = default;
ImageCandidates& ImageCandidates::operator=(ImageCandidates&&) noexcept = default;
ImageCandidates::~ImageCandidates() = default;

const ImageSources& ImageCandidates::found() const {
    return impl_->found;
}

ImageSources findImageSources(const AcousticGeometry& geometry, const glm::dvec3& from, const glm::dvec3& to,
                              const ImageSourceOptions& options, double speedOfSound, const Bands& attenuation) {
    const glm::dvec3 source = outsideBodies(geometry, from, to);
    return findImageSources(geometry, ImageCandidates(geometry, source, options), to, options, speedOfSound,
                            attenuation);
}

ImageSources findImageSources(const AcousticGeometry& geometry, const ImageCandidates& candidates, const glm::dvec3& to,
                              const ImageSourceOptions& options, double speedOfSound, const Bands& attenuation) {
    ImageSources result = candidates.found();
    const std::vector<Candidate>& all = candidates.impl().set.all;
    const glm::dvec3 source = all.front().position, listener = offWalls(geometry, to, source);
    const auto keep = [&](Arrival arrival, const glm::dvec3& image, const glm::mat3& turn) {
        const double distance = glm::distance(image, listener);
        if (distance > options.maxDistance) return;
        // A source in the listener's head has no direction and, as for any nearer than a centimetre, no 1/r^2 either.
        const double clamped = std::max(distance, 0.01);
        arrival.seconds = distance / speedOfSound;
        arrival.turn = turn;
        arrival.direction = distance > 1e-9 ? (image - listener) / distance : glm::dvec3(0, 0, -1);
        const glm::dvec3 departure = glm::transpose(glm::dmat3(turn)) * -arrival.direction;
        const double sent = options.pattern ? options.pattern(distance > 0 ? departure : glm::dvec3(0, 0, -1)) : 1;
        if (!(sent > 0)) return;
        const double spread = sent / (4 * std::numbers::pi * clamped * clamped);
        for (std::size_t b = 0; b < kBandCount; ++b)
            arrival.energy[b] *= attenuation[b] > 0 ? spread * std::exp(-attenuation[b] * distance) : spread;
        result.arrivals.push_back(arrival);
    };
    Arrival direct;
    direct.energy = directShare(geometry, source, listener);
    if (direct.energy != Bands{}) keep(direct, source, glm::mat3(1.0f));

    const WallShares shares(geometry);
    const WallsAround around(geometry, source);
    ImageViews views(geometry, candidates.impl(), listener, options);
    std::vector<std::vector<Arrival>> paths(all.size());
    const auto lookFor = [&](std::span<const std::size_t> images, std::size_t known) {
        constexpr std::size_t kChunk = 64;
        parallelFor((images.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
            std::vector<Retracer> ways;
            for (const std::size_t i : images.subspan(chunk * kChunk, std::min(kChunk, images.size() - chunk * kChunk)))
                for (std::size_t k = known; k < views.count(i); ++k)
                    ways.emplace_back(geometry, around, shares, source, views.place(i, k), all[i], result.order,
                                      options.minShare, paths[i]);
            retrace(geometry, ways);
        });
    };
    std::vector<std::size_t> images(all.size());
    std::iota(images.begin(), images.end(), std::size_t{0});
    lookFor(images, 0);
    images = views.loudest(paths);
    lookFor(images, 1);
    views.leaveUnsure(paths, images);
    if (!images.empty()) lookFor(images, ImageViews::kOfLoud);
    for (std::size_t i = 1; i < paths.size(); ++i) {
        if (views.count(i) > 1) average(paths[i], views.count(i));
        for (const Arrival& path : paths[i]) keep(path, all[i].position, all[i].turn);
    }
    std::stable_sort(result.arrivals.begin(), result.arrivals.end(),
                     [](const Arrival& a, const Arrival& b) { return a.seconds < b.seconds; });
    return result;
}

}  // namespace rtsg
