// Mirrors a source in the planes of a room, order by order.
#include "image_candidates.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

namespace rtsg {

namespace trace {

bool alike(const glm::dmat3& a, const glm::mat3& b) {
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k)
            if (std::abs(a[i][k] - static_cast<double>(b[i][k])) > 1e-3) return false;
    return true;
}

namespace {

constexpr double kCell = 0.25;

std::uint64_t key(const glm::dvec3& cell) {
    std::uint64_t result = 0;
    for (int i = 0; i < 3; ++i) {
        result = (result ^ static_cast<std::uint64_t>(static_cast<std::int64_t>(cell[i]))) * 0x9E3779B97F4A7C15ull;
        result ^= result >> 31;
    }
    return result;
}

}  // namespace

ImageCandidateSet::Bucket& ImageCandidateSet::newestIn(std::uint64_t cell) {
    for (std::size_t at = cell;; ++at) {
        Bucket& bucket = buckets_[at & (buckets_.size() - 1)];
        if (bucket.cell == cell || bucket.newest == kNoPlane) return bucket;
    }
}

void ImageCandidateSet::grow() {
    std::vector<Bucket> before(2 * buckets_.size());
    before.swap(buckets_);
    for (const Bucket& bucket : before)
        if (bucket.newest != kNoPlane) newestIn(bucket.cell) = bucket;
}

bool ImageCandidateSet::insert(const glm::dvec3& p, const glm::dmat3& rotation, std::uint32_t lastPlane,
                               double fraction, double same) {
    const glm::dvec3 low = glm::floor((p - same) / kCell), high = glm::floor((p + same) / kCell);
    for (double x = low.x; x <= high.x; ++x)
        for (double y = low.y; y <= high.y; ++y)
            for (double z = low.z; z <= high.z; ++z) {
                for (std::uint32_t i = newestIn(key({x, y, z})).newest; i != kNoPlane; i = next_[i])
                    if (glm::distance(all[i].position, p) < same && alike(rotation, all[i].rotation)) {
                        if (all[i].lastPlane != lastPlane) all[i].severalPaths = true;
                        all[i].fraction = std::max(all[i].fraction, fraction);
                        return false;
                    }
            }
    const auto index = static_cast<std::uint32_t>(all.size());
    all.push_back({p, glm::mat3(rotation), lastPlane, fraction});
    if (2 * all.size() > buckets_.size()) grow();
    Bucket& bucket = newestIn(key(glm::floor(p / kCell)));
    bucket.cell = key(glm::floor(p / kCell));
    next_.push_back(std::exchange(bucket.newest, index));
    return true;
}

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

}  // namespace trace

namespace {

using trace::canFollow;
using trace::imageTolerance;
using trace::mirroring;

/// Finds candidates order by order, as far as the options allow.
void findCandidates(const AcousticGeometry& geometry, const ImageSourceOptions& options,
                    trace::ImageCandidateSet& candidates, std::size_t& mirroredOnce, ImageSources& result) {
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
                const trace::ImageCandidate from = candidates.all[i];
                const double fraction = from.fraction * planes[p].mirrors;
                if (from.lastPlane == p || fraction < options.minFraction) continue;
                if (from.lastPlane != kNoPlane && !from.severalPaths &&
                    !canFollow(from.position, planes[from.lastPlane], planes[p]))
                    continue;
                const glm::dvec3& normal = planes[p].normal;
                const glm::dvec3 image = from.position - normal * (2 * planes[p].signedDistance(from.position));
                const double away = glm::distance(image, candidates.all[0].position);
                candidates.insert(image, mirroring(normal) * glm::dmat3(from.rotation), p, fraction,
                                  std::min(2e-3, imageTolerance(order, away)));
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

}  // namespace rtsg
