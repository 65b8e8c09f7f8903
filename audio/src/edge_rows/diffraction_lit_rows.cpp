// Multiplies the shares of direct sound that the faces of a row leave.
#include "diffraction_lit_rows.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include "diffraction_rows.h"
#include "edges/diffraction_fractions.h"
#include "edges/diffraction_paths.h"

namespace rtsg {
namespace {

using Complex = std::complex<double>;

/// The waves that one face adds to direct sound: by each of its edges, from one edge to the other, and by its image.
class LitFace {
  public:
    LitFace(const RowFace& face, const glm::dvec3& side, const glm::dvec3& source, const glm::dvec3& listener,
            BodyWeights& bodies)
        : weights_(bodies.of((face.begin ? face.begin : face.end)->body)), straight_(glm::distance(source, listener)) {
        material_ = (face.begin ? face.begin : face.end)->material;
        detour_ = straight_;
        mirrored_ = true;
        for (const WallEdge* edge : {face.begin, face.end}) {
            RoundEdge round;
            if (!edge || !pathRound(*edge, source, listener, round)) continue;
            paths_.push_back(round.path);
            detour_ = std::min(detour_, std::max(0.0, round.path.shortestPath() - straight_));
            at_ = glm::dot(round.by - source, listener - source) / straight_;
            mirrored_ = mirrored_ && isMirrored(round.path);
        }
        mirrored_ = mirrored_ && paths_.size() == 2;
        pair_.first = face.begin;
        pair_.second = face.end;
        pair_.side = side;
        if (!face.begin || !face.end) return;
        const bool sheet = side != glm::dvec3(0);
        paired_ = findPath(sheet ? offSheet(*face.begin, source) : source,
                           sheet ? offSheet(*face.end, listener) : listener, true, pair_) &&
                  pair_.onFace;
    }

    /// Metres from the source on, along the straight way; and that the shortest way by its edges is longer.
    double at() const { return at_; }
    double detour() const { return detour_; }
    double weight(std::size_t tone) const { return weights_[tone]; }

    /// Relative to direct sound: the remainder of direct sound with all additions by the face, and the part of it that
    /// belongs to the image.
    struct Fractions {
        Complex left, image;
    };
    Fractions fractions(std::size_t tone, double waveNumber, const EdgeTones& tones) const {
        const double mirrors = tones.mirrors(material_, tone / EdgeTones::kTones);
        const Complex pair = paired_ ? twoWedgeField(pair_.path, waveNumber, mirrors, mirrors) : 0.0;
        Complex direct = pair / (1 + mirrors), image = pair * (mirrors / (1 + mirrors));
        for (const WedgePath& path : paths_) {
            const WedgeField field = wedgeField(path, waveNumber);
            direct += field.besideDirect;
            image += mirrors * field.besideMirrored;
        }
        if (mirrored_) {
            const double distance = paths_.front().distanceAt(imageAngle(paths_.front()));
            image += std::polar(mirrors / distance, -waveNumber * distance);
        }
        const Complex counts = weights_[tone] * straight_ * std::polar(1.0, waveNumber * straight_);
        return {1.0 + counts * (direct + image), counts * image};
    }

  private:
    const BodyWeights::Tones& weights_;
    double straight_, at_ = 0, detour_ = 0;
    std::uint32_t material_ = 0;
    std::vector<WedgePath> paths_;
    PairPath pair_;
    bool mirrored_ = false, paired_ = false;
};

/// How much more gets past both than past each, less 1. In the plane that is 2 asin(rho) / pi as of half planes, see
/// diffraction_rows.h; above it both are less and less one obstacle, the more waves they are off the straight way.
double excess(const LitFace& a, const LitFace& b, double straight, std::size_t tone, double waveNumber) {
    const double between = std::abs(b.at() - a.at()), before = std::clamp(std::min(a.at(), b.at()), 0.0, straight);
    const double after = std::max(0.0, straight - before - between);
    const double inPlane = 2 * leftBeyond(before, between, after) - 1;
    return a.weight(tone) * b.weight(tone) * inPlane / (1 + waveNumber * (a.detour() + b.detour()));
}

/// The share of direct sound that is left behind some faces in a row, and the part of it that is their image.
class RowFractions {
  public:
    RowFractions(const std::vector<LitFace>& faces, double straight, std::size_t tone, double waveNumber,
                 const EdgeTones& tones) {
        for (const LitFace& face : faces) alone_.push_back(face.fractions(tone, waveNumber, tones));
        for (std::size_t i = 1; i < faces.size(); ++i)
            together_.push_back(1.0 + excess(faces[i - 1], faces[i], straight, tone, waveNumber));
    }
    /// The shares of the faces from one up to, but without, another.
    LitFace::Fractions of(std::size_t from, std::size_t to) const {
        if (from >= to) return {1, 0};
        Complex left = 1, notMirrored = 1;
        for (std::size_t i = from; i < to; ++i) {
            left *= alone_[i].left;
            // In the plane the image is half of the remainder, and by this rule it is half for any number of faces.
            if (std::norm(alone_[i].left) > 0) notMirrored *= 1.0 - 2.0 * alone_[i].image / alone_[i].left;
            if (i + 1 < to) left *= together_[i];
        }
        return {left, 0.5 * left * (1.0 - notMirrored)};
    }

  private:
    std::vector<LitFace::Fractions> alone_;
    std::vector<double> together_;  // of each and the next one
};

}  // namespace

bool litRowOf(const PairPath& path, const glm::dvec3& source, const glm::dvec3& listener,
              std::span<const WallEdge* const> edges, const EdgeTones& tones, BodyWeights& bodies, LitRow& result) {
    const std::vector<RowFace> row = facesBetween(path, edges);
    if (row.size() < 2) return false;
    std::vector<LitFace> faces;
    for (const RowFace& face : row) faces.emplace_back(face, path.side, source, listener, bodies);
    const double straight = glm::distance(source, listener);
    const std::size_t size = faces.size();
    for (std::size_t t = 0; t < kEdgeTones; ++t) {
        const double k = 2 * std::numbers::pi * edgeToneHz(static_cast<double>(t)) / tones.speedOfSound();
        const RowFractions fractions(faces, straight, t, k, tones);
        const LitFace::Fractions all = fractions.of(0, size), first = fractions.of(0, size - 1),
                                 second = fractions.of(1, size);
        const LitFace::Fractions inner = fractions.of(1, size - 1);
        const double mirrorsFirst = tones.mirrors(path.first->material, t / EdgeTones::kTones);
        const double mirrorsSecond = tones.mirrors(path.second->material, t / EdgeTones::kTones);
        const Complex pair = twoWedgeField(path.path, k, mirrorsFirst, mirrorsSecond);
        const Complex direct = std::norm(pair) > 0 ? std::polar(1 / straight, -k * straight) / pair : 0.0;
        result.all[t] = direct * (all.left - first.left - second.left + inner.left);
        result.image[t] = direct * (all.image - first.image - second.image + inner.image);
    }
    return true;
}

}  // namespace rtsg
