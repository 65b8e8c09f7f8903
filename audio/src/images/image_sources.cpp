// The images of a source whose way really leads to the listener, or to some places around it.
#include "image_sources.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include <rtsg/renderers/parallel_for.h>

#include "image_candidates.h"
#include "image_paths.h"
#include "response/listening_positions.h"

namespace rtsg {
namespace {

using trace::canFollow;
using trace::ImageCandidate;

/// Paths are checked from a listener this far beside the true one: symmetric rooms are full of paths that meet an edge
/// exactly, where it is chance which wall is hit, and whether both are.
const glm::dvec3 kAside{4.1e-4, 6.3e-4, 2.9e-4};

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

/// The points from which the path to each candidate is followed: the listener's position for images of first order, a
/// point in the ball around it for others. If walls hide some points, the loudest candidates are followed from several;
/// and if these differ, from all.
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
        positions_ = pointsAround(geometry, listener, options.ball, kPositions);
        if (positions_.empty()) positions_.push_back(beside_);
        const ReflectingPlane ball{.center = listener, .radius = options.ball};
        for (std::size_t i = once_; i < all_.size(); ++i)
            if (!all_[i].severalPaths && !canFollow(all_[i].position, geometry.planes()[all_[i].lastPlane], ball))
                counts_[i] = 0;
    }

    /// How often each is looked for by now.
    std::size_t count(std::size_t candidate) const { return counts_[candidate]; }
    glm::dvec3 position(std::size_t candidate, std::size_t k) const {
        if (candidate < once_) return beside_;
        // Each candidate has its own order, so that parts beyond one wall do not come and go at once.
        const std::uint64_t first = (candidate * 0x9E3779B97F4A7C15ull) >> 32;
        return positions_[(first + k) % positions_.size()];
    }

    /// The candidates that are to be followed from more points, after one point each.
    std::vector<std::size_t> loudest(const std::vector<std::vector<Arrival>>& paths) {
        std::vector<std::pair<double, std::size_t>> heard;
        std::size_t hidden = 0;
        for (std::size_t i = once_; i < all_.size(); ++i) {
            if (counts_[i] == 0) continue;
            const glm::dvec3 away = all_[i].position - listener_;
            heard.emplace_back(all_[i].fraction / (1e-4 + glm::dot(away, away)), i);
            hidden += paths[i].empty();
        }
        // If so many are seen, each from another place, nothing hides any.
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
    void leaveUnsure(const std::vector<std::vector<Arrival>>& paths, std::vector<std::size_t>& candidates) {
        std::erase_if(candidates, [&](std::size_t i) { return paths[i].empty() || paths[i].size() >= kOfLoud; });
        for (const std::size_t i : candidates) counts_[i] = std::max(kOfLoud, positions_.size());
    }

    static constexpr std::size_t kOfLoud = 8;

  private:
    static constexpr std::size_t kPositions = 64, kLoud = 4096, kEnough = 256;

    const std::vector<ImageCandidate>& all_;
    glm::dvec3 listener_, beside_;
    std::size_t once_;  // so many come first
    std::vector<std::size_t> counts_;
    std::vector<glm::dvec3> positions_;
};

/// Replaces the ways to one image from `count` places by their mean.
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

Bands directFraction(const AcousticGeometry& geometry, const glm::dvec3& from, const glm::dvec3& to) {
    Bands fraction = allBands(1);
    const glm::dvec3 source = offSolids(geometry, from, to), listener = offSolids(geometry, to, from);
    const glm::dvec3 toSource = source - listener;
    const double distance = glm::length(toSource);
    if (!(distance > 0)) return fraction;
    const glm::dvec3 direction = toSource / distance;
    glm::dvec3 origin = listener;
    double left = distance;
    std::uint32_t plane = kNoPlane;
    AcousticHit hit;
    while (geometry.closest(origin, direction, left, plane, hit)) {
        bool any = false;
        for (std::size_t b = 0; b < kBandCount; ++b) {
            fraction[b] *= geometry.materials()[hit.material].transmission[b];
            any = any || fraction[b] > 0;
        }
        if (!any) break;
        origin += direction * hit.distance;
        left -= hit.distance;
        plane = hit.plane;
    }
    return fraction;
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
    const std::vector<ImageCandidate>& all = candidates.impl().set.all;
    const glm::dvec3 source = all.front().position, listener = offWalls(geometry, to, source);
    const auto keep = [&](Arrival arrival, const glm::dvec3& image, const glm::mat3& rotation) {
        const double distance = glm::distance(image, listener);
        if (distance > options.maxDistance) return;
        // A source in the listener's head has no direction and, as for any nearer than a centimetre, no 1/r^2 either.
        const double clamped = std::max(distance, 0.01);
        arrival.seconds = distance / speedOfSound;
        arrival.rotation = rotation;
        arrival.direction = distance > 1e-9 ? (image - listener) / distance : glm::dvec3(0, 0, -1);
        const glm::dvec3 departure = glm::transpose(glm::dmat3(rotation)) * -arrival.direction;
        const double sent = options.pattern ? options.pattern(distance > 0 ? departure : glm::dvec3(0, 0, -1)) : 1;
        if (!(sent > 0)) return;
        const double spread = sent / (4 * std::numbers::pi * clamped * clamped);
        for (std::size_t b = 0; b < kBandCount; ++b)
            arrival.energy[b] *= attenuation[b] > 0 ? spread * std::exp(-attenuation[b] * distance) : spread;
        result.arrivals.push_back(arrival);
    };
    Arrival direct;
    direct.energy = directFraction(geometry, source, listener);
    if (direct.energy != Bands{}) keep(direct, source, glm::mat3(1.0f));

    const trace::ImagePaths courses(geometry, source, result.order, options.minFraction);
    ImageViews views(geometry, candidates.impl(), listener, options);
    std::vector<std::vector<Arrival>> paths(all.size());
    const auto lookFor = [&](std::span<const std::size_t> images, std::size_t known) {
        constexpr std::size_t kChunk = 64;
        parallelFor((images.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
            std::vector<trace::ImagePaths::Asked> asked;
            for (const std::size_t i : images.subspan(chunk * kChunk, std::min(kChunk, images.size() - chunk * kChunk)))
                for (std::size_t k = known; k < views.count(i); ++k)
                    asked.push_back({views.position(i, k), &all[i], &paths[i]});
            courses.follow(asked);
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
        for (const Arrival& path : paths[i]) keep(path, all[i].position, all[i].rotation);
    }
    std::stable_sort(result.arrivals.begin(), result.arrivals.end(),
                     [](const Arrival& a, const Arrival& b) { return a.seconds < b.seconds; });
    return result;
}

}  // namespace rtsg
