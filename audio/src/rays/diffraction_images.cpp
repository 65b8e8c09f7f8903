// Finds walls that mirror and the things before them, and adds the sound of each image with the edges on its way.
#include "diffraction_images.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "edge_rows/diffraction_edges.h"
#include "edges/diffraction_paths.h"
#include "geometry/diffraction_parts.h"
#include "images/diffraction_mirror_world.h"
#include "images/image_candidates.h"
#include "response/wave_levels.h"
#include "round_bodies/diffraction_round_bodies.h"

namespace rtsg {
namespace {

/// An image that brings less of any octave than this is left as it is: where it begins or ends the level steps by .09
/// dB.
constexpr double kMinOfAll = 0.02;
/// Each is as much work as direct sound: a room has six walls.
constexpr std::size_t kMaxBentImages = 8;
/// m; an edge by which the way is so much longer brings at 125 Hz less than -18 dB of the image: half of
/// fresnelBeyond().
constexpr double kDetour = 2;

/// A wall, and the image of the source in it.
struct WallImage {
    std::uint32_t plane = 0;
    glm::dvec3 position{0};
    double pathLength = 0;  // m, to the listener
    double energy = 0;      // at most
};

double sumOver(const std::vector<Arrival>& arrivals) {
    double sum = 0;
    for (const Arrival& one : arrivals) sum += *std::ranges::max_element(one.energy);
    return sum;
}

/// The energy in the faintest octave from 125 Hz to 4 kHz, since images bring the high tones behind a screen.
double smallestOf(const std::vector<Arrival>& arrivals) {
    Bands sum{};
    for (const Arrival& one : arrivals)
        for (std::size_t b = 0; b < kBandCount; ++b) sum[b] += one.energy[b];
    return *std::min_element(sum.begin() + kBand1k - 3, sum.begin() + kBand1k + 3);
}

/// Images of the source in planes before which it and the listener are, the loudest first; those of less than `least`
/// are left out.
std::vector<WallImage> wallImages(const AcousticGeometry& geometry, const glm::dvec3& source,
                                  const glm::dvec3& listener, double minimum) {
    std::vector<WallImage> images;
    const auto planes = geometry.planes();
    for (std::uint32_t p = 0; p < planes.size(); ++p) {
        const ReflectingPlane& plane = planes[p];
        const double from = plane.signedDistance(source), to = plane.signedDistance(listener);
        if (!(from * to > 0)) continue;
        WallImage image{p, source - plane.normal * (2 * from), 0, 0};
        image.pathLength = glm::distance(image.position, listener);
        image.energy = plane.mirrors / (4 * std::numbers::pi * image.pathLength * image.pathLength);
        const glm::dvec3 by = glm::mix(image.position, listener, from / (from + to));
        if (image.energy > minimum && glm::distance(by, plane.center) < plane.radius) images.push_back(image);
    }
    std::ranges::sort(images, std::greater{}, &WallImage::energy);
    return images;
}

/// The wall's material at a place on the mirror; none where no surface faces source and listener.
std::optional<std::uint32_t> surfaceAt(const AcousticGeometry& geometry, const MirrorWorld& world,
                                       const glm::dvec3& position) {
    AcousticHit hit;
    const double reach = 1e-3 + 4 * positionRounding(position);
    const auto isMirror = [&](const glm::dvec3& normal) { return glm::dot(normal, world.normal()) > 0.999; };
    if (!geometry.closest(position + world.normal() * reach, -world.normal(), 2 * reach, kNoPlane, hit) ||
        (!isMirror(hit.normal) && !isMirror(-hit.normal)))
        return {};
    // A surface that faces away is the back of a body's face.
    bool faces = false;
    geometry.surfacesNear(position, reach, [&](const NearSurface& surface) {
        faces = faces || isMirror(surface.normal) || (surface.solid == kNoSolid && isMirror(-surface.normal));
    });
    if (!faces) return {};
    return hit.material;
}

/// The radius, at a share of an image's way, of the zone in which waves of a metre are about in phase.
double zoneRadius(const WallImage& image, double fraction) {
    return std::sqrt(image.pathLength * fraction * (1 - fraction));
}

/// The material of a wall where it mirrors the image, if it is large enough to mirror waves of a metre. A small one, as
/// a brick's face, sounds by its edges alone.
std::optional<std::uint32_t> materialOf(const AcousticGeometry& geometry, const MirrorWorld& world,
                                        const WallImage& image, const glm::dvec3& listener) {
    // A bound of work; and more than half of the zone, as beside another wall half of it is there.
    constexpr int kRound = 8, kEnough = 5;
    const double fraction = world.height(listener) / (world.height(listener) - world.height(image.position));
    const glm::dvec3 by = glm::mix(listener, image.position, fraction), normal = world.normal();
    const std::optional<std::uint32_t> material = surfaceAt(geometry, world, by);
    if (!material) return {};
    const glm::dvec3 across =
        glm::normalize(glm::cross(normal, std::abs(normal.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0)));
    const glm::dvec3 other = glm::cross(normal, across);
    int found = 0;
    for (int i = 0; i < kRound; ++i) {
        const double angle = 2 * std::numbers::pi * (i + 0.5) / kRound;
        const glm::dvec3 aside = std::cos(angle) * across + std::sin(angle) * other;
        found += surfaceAt(geometry, world, by + zoneRadius(image, fraction) * aside).has_value();
    }
    if (found < kEnough) return {};
    return material;
}

/// Whether a body blocks the path to the image, or is so near to it that it diffracts its sound.
bool isBeside(const MirrorWorld& world, const WallImage& image, const glm::dvec3& listener) {
    constexpr int kRound = 8;  // a bound of work
    const glm::dvec3 displacement = glm::normalize(listener - image.position);
    const glm::dvec3 side = glm::normalize(
        glm::cross(displacement, std::abs(displacement.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0)));
    const glm::dvec3 other = glm::cross(displacement, side);
    for (const double radius : {0.0, 1.0, 0.5, 0.2}) {
        const double off = radius * zoneRadius(image, 0.5);
        for (int i = 0; i < (radius > 0 ? kRound : 1); ++i) {
            const double angle = 2 * std::numbers::pi * i / kRound;
            const glm::dvec3 aside = off * (std::cos(angle) * side + std::sin(angle) * other);
            if (!seen(world, listener + 0.2 * aside, 0.5 * (listener + image.position) + aside) ||
                !seen(world, image.position + 0.2 * aside, 0.5 * (listener + image.position) + aside))
                return true;
        }
    }
    return false;
}

/// Whether edges of the mirror change much of its image at any tone.
bool endsBeside(const WallImage& image, const BentParts& known) {
    constexpr float kMuch = 0.3f;  // of its pressure: 3 dB
    EdgeTonePressures sum{};
    for (const ImagePart& part : known.images)
        if (glm::distance(part.image, image.position) < 1e-5 * (1 + glm::length(image.position)))
            for (std::size_t t = 0; t < kEdgeTones; ++t) sum[t] += part.pressure[t];
    return std::ranges::any_of(sum, [&](const std::complex<float>& one) {
        return std::abs(one) * static_cast<float>(image.pathLength) > kMuch;
    });
}

/// Folds the route of a wave, so that each place is on the side of the mirror where source and listener are.
void foldRoute(EdgeWave& wave, const MirrorWorld& world, const glm::dvec3& source, const glm::dvec3& listener,
               double speedOfSound) {
    const glm::dvec3 first = world.mirrored(wave.route.first), last = wave.route.last;
    wave.route = {first, last, glm::dvec3(0), glm::dvec3(0)};
    wave.route.over = wave.seconds * speedOfSound - glm::distance(source, first) - glm::distance(first, last) -
                      glm::distance(last, listener);
    wave.bends = {};
}

/// Replaces one known image by the image with all its diffracted waves.
void addImage(const AcousticGeometry& geometry, const MirrorWorld& world, const WallImage& image,
              std::uint32_t material, const glm::dvec3& source, const glm::dvec3& listener, const TraceOptions& options,
              TraceResult& result) {
    const double c = options.air.speedOfSound;
    const glm::dmat3 rotation = trace::mirroring(world.normal());
    TraceOptions own = options;
    if (options.pattern)
        own.pattern = [&](const glm::dvec3& direction) { return options.pattern(rotation * direction); };
    const auto known = std::ranges::find_if(result.arrivals, [&](const Arrival& one) {
        return one.order == 1 && std::abs(one.seconds * c - image.pathLength) < 1e-6 * (1 + image.pathLength) &&
               glm::distance(listener + one.direction * image.pathLength, image.position) < 1e-4 * image.pathLength;
    });
    std::vector<Arrival> arrivals;
    const Bands attenuation = airAttenuation(options.air);
    if (known != result.arrivals.end()) {
        Arrival& direct = arrivals.emplace_back();
        direct.seconds = image.pathLength / c;
        direct.direction = (image.position - listener) / image.pathLength;
        direct.rotation = glm::mat3(1.0f);
        const double sent = own.pattern ? own.pattern(-direct.direction) : 1;
        for (std::size_t b = 0; b < kBandCount; ++b)
            direct.energy[b] = sent * std::exp(-attenuation[b] * image.pathLength) /
                               (4 * std::numbers::pi * image.pathLength * image.pathLength);
    }
    EdgeField field;
    addBending(world, image.position, listener, own, std::min(result.seconds, (image.pathLength + kDetour) / c),
               arrivals, field);
    // Sound 60 dB below that in the open counts as none, so that a sealed room stays sealed.
    constexpr double kMinOfImage = 1e-6;
    if (!(sumOver(arrivals) * 4 * std::numbers::pi * image.pathLength * image.pathLength > kMinOfImage)) return;
    Bands mirrors{};
    for (std::size_t b = 0; b < kBandCount; ++b) mirrors[b] = geometry.materials()[material].mirrored(b);
    if (known != result.arrivals.end()) result.arrivals.erase(known);
    const auto shift = static_cast<std::int32_t>(result.edges.straight.size());
    for (Bands& straight : field.straight) {
        for (std::size_t b = 0; b < kBandCount; ++b) straight[b] *= mirrors[b];
        result.edges.straight.push_back(straight);
    }
    for (Arrival& one : arrivals) {
        if (one.straight >= 0) one.straight += shift;
        for (std::size_t b = 0; b < kBandCount; ++b) one.energy[b] *= mirrors[b];
        if (one.rotation == glm::mat3(1.0f)) one.rotation = glm::mat3(rotation);
        ++one.order;
        result.arrivals.push_back(one);
    }
    for (EdgeWave& wave : field.waves) {
        for (std::size_t t = 0; t < kEdgeTones; ++t)
            wave.pressure[t] *=
                static_cast<float>(std::sqrt(mirrors[t * static_cast<std::size_t>(kBandCount) / kEdgeTones]));
        ++wave.order;
        foldRoute(wave, world, source, listener, c);
        result.edges.waves.push_back(wave);
    }
    std::ranges::stable_sort(result.arrivals, {}, &Arrival::seconds);
}

}  // namespace

BentBy addBending(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                  const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals, EdgeField& field) {
    addRoundBodies(geometry, source, listener, options, seconds, arrivals, field);
    BentBy bending;
    bending.pairs = addDiffraction(geometry, source, listener, options, seconds, arrivals, field, bending.parts);
    setLevels(source, listener, options.air.speedOfSound, bending.parts, arrivals, field);
    return bending;
}

void addBentImages(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                   const TraceOptions& options, const BentParts& known, TraceResult& result) {
    if (!diffractionParts().images) return;
    const double minimum = kMinOfAll * smallestOf(result.arrivals);
    std::size_t looked = 0;
    for (const WallImage& image : wallImages(geometry, source, listener, minimum)) {
        const MirrorWorld world(geometry, image.plane, listener);
        const std::optional<std::uint32_t> material = materialOf(geometry, world, image, listener);
        if (!material || endsBeside(image, known) || !isBeside(world, image, listener)) continue;
        addImage(geometry, world, image, *material, source, listener, options, result);
        if (++looked == kMaxBentImages) break;
    }
}

}  // namespace rtsg
