// What may bend a way among others: a round body by one side, an edge, or two edges of one face.
//
// Threading: const once made.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>

#include "edge_rows/edge_pair_way.h"
#include "edges/edge_paths.h"
#include "response/edge_tones.h"
#include "round_side.h"

namespace rtsg {

using TonePressures = std::array<std::complex<double>, kEdgeTones>;

/// The way by it from one place to another.
struct LinkWay {
    bool lit = false;               // it is beside the straight way
    bool there = true;              // its surface is where the way touches it
    double length = 0;              // m
    glm::dvec3 first{0}, last{0};   // where it comes to it, and where it leaves it
    std::optional<RoundSide> side;  // of a body
    RoundEdge round;                // of an edge
    double mirrored = 1;            // of edges: how much of what their faces mirror counts
    std::optional<PairWay> pair;    // of two edges
    double over = 0;                // m from the first of two edges to the second one
    /// How much the second of two edges counts where it is asked how far a place is from the boundary of a shadow: none
    /// on its own boundary.
    double bySecond = 0;

    /// m from its first place to the one that counts there, and from that on to the last.
    double toMiddle() const { return over * bySecond; }
    double fromMiddle() const { return over * (1 - bySecond); }
};

class BendingLink {
  public:
    /// By the side that leads about its axis one way or the other; of a sphere the near one or the far one.
    BendingLink(const RoundBody& body, bool backwards) : body_(body), backwards_(backwards) {}
    /// `others`: of its faces.
    explicit BendingLink(const WallEdge& edge, std::vector<WallEdge> others = {})
        : edge_(edge), others_(std::move(others)) {}
    /// Along a face of both: what both bend, as a part of what comes, be it in the shadow of either one or not.
    BendingLink(const WallEdge& first, const WallEdge& second) : edge_(first), second_(second) {}

    const RoundBody* body() const { return body_ ? &*body_ : nullptr; }
    /// To which sound comes; of two edges it leaves by the last one.
    const WallEdge* edge() const { return edge_ ? &*edge_ : nullptr; }
    const WallEdge* lastEdge() const { return second_ ? &*second_ : edge(); }
    std::uint32_t bends() const { return second_ ? 2 : 1; }
    /// Shares of the pressure that its faces mirror; of two edges those of each.
    std::array<double, 2> mirrors(const EdgeTones& tones, std::size_t band) const;

    /// None if no way leads by it.
    std::optional<LinkWay> way(const glm::dvec3& from, const glm::dvec3& to) const;
    /// Re the phase of its length: in the dark all there is, in the light what comes beside direct sound, as far as
    /// that is near the shadow.
    std::complex<double> pressure(const LinkWay& way, double waveNumber, const std::array<double, 2>& mirrors) const;
    /// How far it is from the boundary of the shadow: half of the square of the angle, times m.
    static double fromBoundary(const LinkWay& way);

    /// Unit, off what bends a way that goes `along`, square to that.
    glm::dvec3 outward(const LinkWay& way, const glm::dvec3& along) const;

    /// Whether it has two ends, each of which does the same to every wave; those of two edges are pairEnds().
    bool ends() const { return body_ ? !body_->sphere : !second_; }
    /// Whether the way leads past an end; how long the way by an end is, and what that takes away, or leaves.
    std::array<bool, 2> past(const LinkWay& way) const;
    double lengthByEnd(const LinkWay& way, std::size_t end) const;
    std::complex<double> byEnd(const LinkWay& way, std::size_t end, double waveNumber) const;
    /// How long ways by ends of two edges are, and what comes by them re what both bend without ends.
    struct PairEnd {
        double length = 0;
        TonePressures share{};
    };
    std::vector<PairEnd> pairEnds(const LinkWay& way, const EdgeTones& tones) const;

  private:
    std::optional<LinkWay> wayByBoth(const glm::dvec3& from, const glm::dvec3& to) const;
    static glm::dvec3 outward(const WallEdge& edge, const glm::dvec3& along);

    std::optional<RoundBody> body_;
    bool backwards_ = false;
    std::optional<WallEdge> edge_, second_;
    std::vector<WallEdge> others_;
};

}  // namespace rtsg
