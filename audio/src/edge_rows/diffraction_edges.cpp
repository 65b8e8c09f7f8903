// Finds the point on each edge with the shortest way from source to listener, and computes the diffraction there.
#include "diffraction_edges.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <map>
#include <numbers>
#include <span>
#include <utility>

#include "edges/diffraction_wedge.h"

#include "diffraction_pairs.h"
#include "edges/diffraction_ends.h"
#include "edges/diffraction_fractions.h"
#include "edges/diffraction_hidden_parts.h"
#include "edges/diffraction_overlaps.h"
#include "edges/diffraction_small_bodies.h"
#include "edges/diffraction_waves.h"
#include "geometry/diffraction_parts.h"
#include "response/edge_tones.h"
#include "response/first_of.h"

namespace rtsg {
namespace {

/// The most edges that count although the shortest way leads past them, those that bend most: a bound of work. Sound 60
/// dB below that in the open does not count, as T30 reaches down no farther (ISO 3382-1).
constexpr std::size_t kPast = 32;
constexpr double kMinPast = 1e-3;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Finds an arrival among the paths known before; null if it is not one of them.
Arrival* arrivalOf(std::vector<Arrival>& arrivals, std::size_t known, std::uint32_t order, double seconds) {
    for (std::size_t i = 0; i < known; ++i)
        if (arrivals[i].order == order && std::abs(arrivals[i].seconds - seconds) < 1e-8 + 1e-6 * seconds)
            return &arrivals[i];
    return nullptr;
}

/// Applies edges to the paths known so far, one edge after the other.
class Diffraction {
  public:
    Diffraction(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals, EdgeField& field)
        : geometry_(geometry),
          source_(source),
          listener_(listener),
          options_(options),
          seconds_(seconds),
          attenuation_(airAttenuation(options.air)),
          tones_(geometry, options.air.speedOfSound),
          bodies_(geometry, source, listener, options.air.speedOfSound),
          arrivals_(arrivals),
          known_(arrivals.size()),
          field_(field) {
        alone_.heardStraight = arrivalOf(arrivals_, known_, 0, glm::distance(source, listener) / c()) != nullptr;
    }

    EdgePairCount run(BentParts& parts) {
        const auto shorter = [](const EdgeCandidate& a, const EdgeCandidate& b) { return a.pathLength < b.pathLength; };
        const auto stronger = [](const Bending& a, const Bending& b) { return a.bent > b.bent; };
        FirstOf<EdgeCandidate, decltype(shorter)> edges(kLookedAtEdges, shorter);
        FirstOf<Bending, decltype(stronger)> pastAll(8 * kPast, stronger);
        std::vector<Bending> found;
        const double straight = glm::distance(source_, listener_);
        geometry_.visitEdges([&](const WallEdge& edge) {
            bodies_.note(edge.body);
            const BesideEdge beside(edge, source_, listener_);
            if (options_.diffractionOrder > 1) edges.add(candidateBy(edge, beside));
            // Most edges of a furnished room end here, without their angles.
            if (!(bentPastAtMost(edge, beside, straight) > pastAll.last().bent)) return;
            RoundEdge round;
            if (!pathRound(edge, source_, listener_, beside, round)) return;
            if (!round.past())
                found.push_back({kInfinity, edge, round});
            else if (const double bent = bentPast(edge, round); bent > kMinPast)
                pastAll.add({bent, edge, round});
        });
        found.insert(found.end(), pastAll.sorted().begin(), pastAll.sorted().end());
        joinOverlaps(found);
        std::size_t counted = 0;
        for (const Bending& one : found) {
            if (one.round.past() && counted == kPast) break;
            counted += bendParts(one) && one.round.past();
        }
        addMissed();
        for (EndWave& end : byPosition_) addWave(end.wave, end.wave.seconds * c(), end.images);
        weakenMirrors();
        const EdgePairCount pairs = addEdgePairs(geometry_, source_, listener_, options_, seconds_, edges.sorted(),
                                                 edges.reported(), alone_, bodies_, parts_, field_);
        if (!alone_.heardStraight) addStraightOn();
        parts = std::move(parts_);
        return pairs;
    }

  private:
    /// `bent`: about how much, of an edge whose shortest way leads past it; else infinite.
    struct Bending {
        double bent = kMinPast;
        WallEdge edge;
        RoundEdge round;
    };
    /// A boundary at which sound that comes straight from a place begins or ends.
    struct Boundary {
        glm::dvec3 from;
        bool isImage = false;  // of the source, which may be in the mirror's plane
        bool expected = true;  // beside all edges that it grazes
        ImagePart image;       // if it is one
        BodyWeights::Tones weights{};
        glm::dvec3 by{0};
        std::uint32_t material = 0;
    };
    struct EndWave {
        glm::dvec3 position;
        EdgeWave wave;
        std::vector<ImagePart> images;
    };

    double c() const { return options_.air.speedOfSound; }

    /// Edges on one line have one shortest way, past their ends or not.
    void joinOverlaps(std::vector<Bending>& found) const {
        std::vector<std::pair<double, std::size_t>> byPath;
        for (std::size_t i = 0; i < found.size(); ++i) byPath.emplace_back(found[i].round.path.shortestPath(), i);
        std::sort(byPath.begin(), byPath.end());
        bool any = false;
        for (std::size_t i = 0; i < byPath.size(); ++i) {
            Bending& one = found[byPath[i].second];
            for (std::size_t k = i + 1; k < byPath.size(); ++k) {
                Bending& other = found[byPath[k].second];
                if (byPath[k].first - byPath[i].first > 4 * edgeRounding(one.edge)) break;
                WallEdge both;
                RoundEdge round;
                if (other.bent < 0 || !joinedEdge(one.edge, other.edge, both) ||
                    !pathRound(both, source_, listener_, round))
                    continue;
                other = {round.past() ? bentPast(both, round) : kInfinity, both, round};
                one.bent = -1;  // it is in the other one
                any = true;
                break;
            }
        }
        if (!any) return;
        std::erase_if(found, [](const Bending& one) { return one.bent < 0; });
        std::stable_sort(found.begin(), found.end(),
                         [](const Bending& a, const Bending& b) { return a.bent > b.bent; });
    }

    void scale(Arrival& arrival, const Bands& factor) {
        if (arrival.straight < 0) {
            arrival.straight = static_cast<std::int32_t>(field_.straight.size());
            field_.straight.push_back(arrival.energy);
        }
        for (std::size_t b = 0; b < kBandCount; ++b) arrival.energy[b] *= factor[b];
    }

    /// Each part that is seen, as an edge of its own; whether any is heard.
    bool bendParts(const Bending& one) {
        const double pathLength = glm::distance(source_, one.round.by) + glm::distance(one.round.by, listener_);
        if (!(pathLength < seconds_ * c())) return false;
        const std::vector<EdgePart> parts = partsSeen(geometry_, source_, listener_, one.edge, one.round.by);
        const bool whole = (parts.size() == 1 && parts[0].from == 0 && parts[0].to == one.edge.length) ||
                           (!parts.empty() && !diffractionParts().hiddenParts);
        if (whole) return bend(one.edge, one.round, nullptr);
        bool heard = false;
        const auto bendPart = [&](double from, double to, const BodyWeights::Tones* through) {
            WallEdge part = one.edge;
            part.from += part.axis * from;
            part.length = to - from;
            RoundEdge round;
            if (part.length > 0 && pathRound(part, source_, listener_, round))
                heard = bend(part, round, through) || heard;
        };
        // Small bodies hide an edge in part only. In the plane of a face it is chance whether one sees along it, so
        // nothing is heard there through the body of the face.
        const auto bendHidden = [&](double from, double to) {
            if (grazesFace(one.round.path)) return;
            const double at = glm::dot(one.round.by - one.edge.from, one.edge.axis);
            const double within = at >= from && at <= to ? at : 0.5 * (from + to);
            const glm::dvec3 by = one.edge.from + one.edge.axis * within;
            BodyWeights::Tones through;
            if (to - from > 0 && passesSmall(by, through)) bendPart(from, to, &through);
        };
        double end = 0;
        for (const EdgePart& seen : parts) {
            bendHidden(end, seen.from);
            bendPart(seen.from, seen.to, nullptr);
            end = seen.to;
        }
        bendHidden(end, one.edge.length);
        return heard;
    }

    /// Weakens the specular reflections by faces of small bodies.
    void weakenMirrors() {
        for (const auto& [arrival, body] : mirrors_) {
            const BodyWeights::Tones& weights = bodies_.of(body);
            if (!(weights.front() < 1)) continue;
            Bands factor{};
            for (std::size_t t = 0; t < kEdgeTones; ++t)
                factor[t * kBandCount / kEdgeTones] += weights[t] * weights[t] / EdgeTones::kTones;
            Arrival& mirror = arrivals_[arrival];
            scale(mirror, factor);
            for (std::size_t b = 0; b < kBandCount; ++b)
                field_.straight[static_cast<std::size_t>(mirror.straight)][b] *= factor[b];
        }
    }

    /// Through small bodies, where nothing else hides direct sound.
    void addStraightOn() {
        BodyWeights::Tones fraction;
        if (!bodies_.straightOn(listener_, source_, fraction) || !(fraction.front() < 1)) return;
        const double pathLength = glm::distance(source_, listener_);
        EdgeWave wave = straightWave(source_, listener_, c());
        for (std::size_t t = 0; t < kEdgeTones; ++t) wave.pressure[t] = static_cast<float>(fraction[t] / pathLength);
        weaken(wave.pressure, sentTo(listener_), attenuation_, pathLength);
        addWave(wave, pathLength, {});
    }

    /// Whether only small bodies block the path by a point; and the share that they let through.
    bool passesSmall(const glm::dvec3& by, BodyWeights::Tones& fraction) {
        BodyWeights::Tones after;
        if (!bodies_.straightOn(source_, by, fraction) || !bodies_.straightOn(listener_, by, after)) return false;
        for (std::size_t t = 0; t < kEdgeTones; ++t) fraction[t] *= after[t];
        return fraction.front() < 1;
    }

    /// Whether it is heard, what small bodies let `through` of it if they hide it.
    bool bend(const WallEdge& edge, const RoundEdge& round, const BodyWeights::Tones* through) {
        const WedgePath& path = round.path;
        const double pathLength = glm::distance(source_, round.by) + glm::distance(round.by, listener_);
        const glm::dvec3 about = offEnds(edge, round.by);
        if (!(pathLength < seconds_ * c()) || !isOpen(geometry_, edge, about, path.opening, round.side)) return false;
        Arrival* mirror = nullptr;
        if (isMirrored(path) || grazesImage(path))
            mirror = arrivalOf(arrivals_, known_, 1, path.distanceAt(imageAngle(path)) / c());
        Arrival* const direct =
            isLit(path) ? arrivalOf(arrivals_, known_, 0, glm::distance(source_, listener_) / c()) : nullptr;
        const std::array<EdgeEnd, 2> ends = endsOf(edge, round, c());
        BodyWeights::Tones weights = bodies_.of(edge.body);
        if (through)
            for (std::size_t t = 0; t < kEdgeTones; ++t) weights[t] *= (*through)[t];
        const EdgeFractions fractions = edgeFractionsOf(round, ends, edge.material, tones_, weights);
        ImagePart image;
        image.image = imagePosition(edge, round, source_);
        const double apart = glm::distance(image.image, listener_);
        for (std::size_t b = 0; b < kBandCount; ++b) image.whole[b] = tones_.mirrors(edge.material, b) / apart;
        if (!round.past()) {
            if (mirror) mirrors_.try_emplace(static_cast<std::size_t>(mirror - arrivals_.data()), edge.body);
            noteBoundaries(edge, round, image, weights);
            if (direct || !isLit(path)) alone_.bent.push_back({edge, round, direct != nullptr});
            addByEdge(fractions, edge, round, pathLength, image);
        }
        for (std::size_t e = 0; e < 2; ++e) addEnd(fractions, e, ends[e], image);
        return true;
    }

    /// Notes sound that comes straight and passes an edge so closely that it is chance whether it was found.
    void noteBoundaries(const WallEdge& edge, const RoundEdge& round, const ImagePart& image,
                        const BodyWeights::Tones& weights) {
        const auto note = [&](const glm::dvec3& from, bool isImage, bool expected) {
            const double rounding = 1e-5 * (1 + glm::length(from));
            auto known = std::ranges::find_if(boundaries_, [&](const Boundary& one) {
                return one.isImage == isImage && glm::distance(one.from, from) < rounding;
            });
            if (known == boundaries_.end())
                known = boundaries_.insert(known, {from, isImage, true, image, weights, round.by, edge.material});
            known->expected = known->expected && expected;
        };
        if (grazesShadow(round.path))
            note(source_, false, isRim(edge) ? passesSheet(edge, round.path) : isLit(round.path));
        if (grazesImage(round.path)) note(image.image, true, isMirrored(round.path));
    }

    /// Whether the straight way passes the sheet of a rim that it grazes. Along its plane it grazes other rims of it,
    /// too, which would say otherwise: there it is looked for with both places farther off the plane, in proportion.
    bool passesSheet(const WallEdge& rim, const WedgePath& path) const {
        constexpr double kAlong = 1e-3;  // radians: a hundred times what single precision turns a sheet of 1 m by 10 cm
        const double above = aboveSheet(rim, source_), other = aboveSheet(rim, listener_);
        const double maximum = std::max(std::abs(above), std::abs(other));
        const double far = kAlong * glm::distance(source_, listener_);
        if (maximum > far) return isLit(path);
        const glm::dvec3 off = sheetNormal(rim) * (far / maximum);
        return seen(geometry_, source_ + above * off, listener_ + other * off);
    }

    /// Adds sound that ought to be there and was not found, and takes away what ought not to be, so that the sum with
    /// what edges bend is continuous. Edges in line share one correction.
    void addMissed() {
        for (const Boundary& one : boundaries_) {
            const double pathLength = glm::distance(one.from, listener_);
            const bool found =
                !one.isImage ? alone_.heardStraight : arrivalOf(arrivals_, known_, 1, pathLength / c()) != nullptr;
            if (found == one.expected) continue;
            EdgeWave wave;
            wave.seconds = pathLength / c();
            wave.direction = (one.from - listener_) / pathLength;
            wave.route = {one.by, one.by, glm::dvec3(0), glm::dvec3(0)};
            for (std::size_t t = 0; t < kEdgeTones; ++t)
                wave.pressure[t] =
                    static_cast<float>((one.expected ? 1 : -1) * one.weights[t] / pathLength *
                                       (!one.isImage ? 1 : tones_.mirrors(one.material, t / EdgeTones::kTones)));
            weaken(wave.pressure, sentTo(one.by), attenuation_, pathLength);
            ImagePart image = one.image;
            image.pressure = wave.pressure;
            addWave(wave, pathLength, std::span(&image, one.isImage ? 1 : 0));
        }
    }

    double sentTo(const glm::dvec3& by) const {
        return options_.pattern ? options_.pattern(glm::normalize(by - source_)) : 1;
    }

    /// `images`: the parts of it that go on into mirror images.
    void addWave(const EdgeWave& wave, double pathLength, std::span<const ImagePart> images) {
        const bool faint = isFaint(wave.pressure, pathLength);
        for (ImagePart part : images) {
            if (faint && isFaint(part.pressure, pathLength)) continue;
            part.wave = faint ? ImagePart::kFaint : field_.waves.size();
            part.seconds = wave.seconds;
            part.direction = wave.direction;
            parts_.images.push_back(part);
        }
        if (!faint) field_.waves.push_back(wave);
    }

    void addByEdge(const EdgeFractions& fractions, const WallEdge& edge, const RoundEdge& round, double pathLength,
                   ImagePart image) {
        EdgeWave wave;
        wave.pressure = fractions.wave;
        image.pressure = fractions.mirrored[0];
        wave.seconds = pathLength / c();
        wave.direction = glm::normalize(round.by - listener_);
        wave.route = {round.by, round.by, edge.axis, edge.axis};
        wave.bends = {edge.faceA, round.side * glm::cross(edge.axis, edge.faceA), round.path.opening, {}};
        for (std::size_t b = 0; b < kBandCount; ++b) wave.bends.mirrors[b] = tones_.mirrors(edge.material, b);
        for (EdgeTonePressures* one : {&wave.pressure, &image.pressure})
            weaken(*one, sentTo(round.by), attenuation_, pathLength);
        addWave(wave, pathLength, std::span(&image, 1));
    }

    /// All edges that end at one place are one wave: where an edge goes on in the next one, nothing is left.
    void addEnd(const EdgeFractions& fractions, std::size_t number, const EdgeEnd& end, ImagePart image) {
        if (!(end.pathLength < seconds_ * c()) || end.position == listener_) return;
        EdgeWave wave;
        wave.pressure = fractions.ends[number];
        image.pressure = fractions.mirrored[number + 1];
        wave.seconds = end.pathLength / c();
        wave.direction = glm::normalize(end.position - listener_);
        wave.route = {end.position, end.position, glm::dvec3(0), glm::dvec3(0)};
        for (EdgeTonePressures* one : {&wave.pressure, &image.pressure})
            weaken(*one, sentTo(end.position), attenuation_, end.pathLength);
        const double rounding = 2 * positionRounding(end.position);
        const auto known = std::ranges::find_if(
            byPosition_, [&](const EndWave& one) { return glm::distance(one.position, end.position) <= rounding; });
        if (known == byPosition_.end()) {
            byPosition_.push_back({end.position, wave, {image}});
            return;
        }
        for (std::size_t t = 0; t < kEdgeTones; ++t) known->wave.pressure[t] += wave.pressure[t];
        known->images.push_back(image);
    }

    const AcousticGeometry& geometry_;
    const glm::dvec3 source_, listener_;
    const TraceOptions& options_;
    const double seconds_;
    const Bands attenuation_;
    const EdgeTones tones_;
    BodyWeights bodies_;
    std::vector<Arrival>& arrivals_;
    std::size_t known_;  // of the arrivals: without edges
    EdgeField& field_;
    EdgesAlone alone_;
    std::vector<EndWave> byPosition_;
    std::vector<Boundary> boundaries_;
    BentParts parts_;
    std::map<std::size_t, const WallBody*> mirrors_;  // by their arrivals, whose faces
};

}  // namespace

EdgePairCount addDiffraction(const AcousticGeometry& geometry, const glm::dvec3& source, const glm::dvec3& listener,
                             const TraceOptions& options, double seconds, std::vector<Arrival>& arrivals,
                             EdgeField& field, BentParts& parts) {
    return Diffraction(geometry, source, listener, options, seconds, arrivals, field).run(parts);
}

}  // namespace rtsg
