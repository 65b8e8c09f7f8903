// Mirrors rays from a listener to find those of its images that matter.
#include "listener_images.h"

#include <algorithm>
#include <array>
#include <bit>
#include <utility>

#include "walls/even_direction.h"

namespace rtsg::trace {
namespace {

/// A way from the listener outwards.
struct MirroredRay {
    glm::dvec3 origin, direction, facing{0};
    glm::dvec3 image;          // of the listener, by the planes that were hit
    glm::dmat3 rotation{1.0};  // of the listener on its way there
    Bands fraction = allBands(1);
    std::array<std::uint32_t, MirrorSequence::kMax> met{};
    std::uint32_t plane = kNoPlane;
};

/// An image of the listener, to which several ways may lead that turn and move the listener alike.
struct FoundImage {
    glm::dvec3 position;
    glm::dmat3 rotation;
    double fraction, worth;  // worth: share times rays
    std::vector<MirrorSequence> sequences;
};

class ImageFinder {
  public:
    std::vector<FoundImage> found;

    /// Records the last hit of a ray.
    void add(const MirroredRay& ray, int order) {
        MirrorSequence planes;
        for (int i = order; i-- > 0;) planes.append(ray.met[static_cast<std::size_t>(i)]);
        const double fraction = *std::max_element(ray.fraction.begin(), ray.fraction.end());
        FoundImage& image = imageOf(ray, order);
        image.fraction = std::max(image.fraction, fraction);
        image.worth += fraction;
        if (std::find(image.sequences.begin(), image.sequences.end(), planes) == image.sequences.end())
            image.sequences.push_back(planes);
    }

  private:
    FoundImage& imageOf(const MirroredRay& ray, int order) {
        // Walls are given in single precision.
        const double same = 2e-6 * (1 + order) * (1 + glm::distance(ray.image, ray.origin));
        for (FoundImage& image : found) {
            if (glm::distance(image.position, ray.image) > same) continue;
            bool alike = true;
            for (int i = 0; i < 3; ++i) alike = alike && glm::distance(image.rotation[i], ray.rotation[i]) < 1e-3;
            if (alike) return image;
        }
        return found.emplace_back(FoundImage{ray.image, ray.rotation, 0, 0, {}});
    }
};

/// Reflects a ray at its hit; returns whether it continues.
bool mirrorIn(const AcousticGeometry& geometry, const AcousticHit& hit, int order, MirroredRay& ray) {
    const auto planes = geometry.planes();
    if (hit.plane >= planes.size()) return false;
    const AcousticMaterial& material = geometry.materials()[hit.material];
    double maximum = 0;
    for (std::size_t b = 0; b < kBandCount; ++b) maximum = std::max(maximum, ray.fraction[b] *= material.mirrored(b));
    if (!(maximum > 0)) return false;
    const ReflectingPlane& plane = planes[hit.plane];
    const double cosine = glm::dot(ray.direction, plane.normal);
    ray.origin += ray.direction * hit.distance;
    ray.direction -= plane.normal * (2 * cosine);
    ray.facing = cosine > 0 ? -plane.normal : plane.normal;
    ray.image -= plane.normal * (2 * plane.signedDistance(ray.image));
    ray.rotation = (glm::dmat3(1.0) - 2.0 * glm::outerProduct(plane.normal, plane.normal)) * ray.rotation;
    ray.plane = ray.met[static_cast<std::size_t>(order - 1)] = hit.plane;
    return true;
}

}  // namespace

ListenerImages::ListenerImages(const AcousticGeometry& geometry, const glm::dvec3& listener, int maxOrder,
                               std::size_t maximum) {
    constexpr int kRays = 512;
    if (geometry.planes().empty()) return;
    ImageFinder finder;
    for (int first = 0; first < kRays; first += AcousticRays::kMax) {
        std::vector<MirroredRay> rays;
        for (int i = first; i < first + AcousticRays::kMax; ++i)
            rays.push_back({.origin = listener, .direction = evenDirection(i, kRays), .image = listener});
        for (int order = 1; order <= std::min(maxOrder, MirrorSequence::kMax) && !rays.empty(); ++order) {
            AcousticRays asked;
            AcousticHits hits;
            for (const MirroredRay& ray : rays) asked.add(ray.origin, ray.facing, ray.direction, 1e6, ray.plane);
            const std::uint32_t met = geometry.closestOf(asked, hits);
            std::vector<MirroredRay> next;
            for (std::size_t i = 0; i < rays.size(); ++i)
                if ((met >> i & 1) != 0 && mirrorIn(geometry, hits[i], order, rays[i])) {
                    finder.add(rays[i], order);
                    next.push_back(rays[i]);
                }
            rays = std::move(next);
        }
    }
    std::stable_sort(finder.found.begin(), finder.found.end(),
                     [](const FoundImage& a, const FoundImage& b) { return a.worth > b.worth; });
    if (finder.found.size() > maximum) finder.found.resize(maximum);
    std::size_t sequences = 0;
    for (const FoundImage& image : finder.found) sequences += image.sequences.size();
    if (sequences == 0) return;
    slots_.resize(std::bit_ceil(2 * sequences));
    for (const FoundImage& image : finder.found) {
        for (const MirrorSequence& sequence : image.sequences)
            remember(sequence, static_cast<std::uint32_t>(images_.size()));
        images_.push_back({image.position, image.fraction});
    }
}

void ListenerImages::remember(const MirrorSequence& planes, std::uint32_t image) {
    std::size_t at = hash(planes) & (slots_.size() - 1);
    while (slots_[at].image != kNone) at = (at + 1) & (slots_.size() - 1);
    slots_[at] = {planes, image};
}

}  // namespace rtsg::trace
