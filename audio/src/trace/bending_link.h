// What may bend a way among others: a round body by one side, or an edge.
//
// Threading: const once made.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <optional>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>

#include "edge_paths.h"
#include "round_side.h"

namespace rtsg {

/// The way by it from one place to another.
struct LinkWay {
    bool lit = false;               // it is beside the straight way
    bool there = true;              // its surface is where the way touches it
    double length = 0;              // m
    glm::dvec3 first{0}, last{0};   // where it comes to it, and where it leaves it
    std::optional<RoundSide> side;  // of a body
    RoundEdge round;                // of an edge
    double along = 0;               // of an edge: m from its beginning to the place
};

class BendingLink {
  public:
    /// By the side that leads about its axis one way or the other; of a sphere the near one or the far one.
    BendingLink(const RoundBody& body, bool backwards) : body_(body), backwards_(backwards) {}
    explicit BendingLink(const WallEdge& edge) : edge_(edge) {}

    const RoundBody* body() const { return body_ ? &*body_ : nullptr; }
    const WallEdge* edge() const { return edge_ ? &*edge_ : nullptr; }
    std::uint32_t material() const { return body_ ? body_->material : edge_->material; }

    /// None if no way leads by it.
    std::optional<LinkWay> way(const glm::dvec3& from, const glm::dvec3& to) const;
    /// Re the phase of its length: in the dark all there is, in the light what comes beside direct sound, as far as
    /// that is near the shadow. Faces of an edge `mirror` that share.
    std::complex<double> pressure(const LinkWay& way, double waveNumber, double mirrors) const;
    /// How far it is from the boundary of the shadow: half of the square of the angle, times m.
    static double fromBoundary(const LinkWay& way);

    /// Unit, off what bends a way that goes `along`, square to that.
    glm::dvec3 outward(const LinkWay& way, const glm::dvec3& along) const;

    bool ends() const { return !body_ || !body_->sphere; }
    /// Whether the way leads past an end; how long the way by an end is, and what that takes away, or leaves.
    std::array<bool, 2> past(const LinkWay& way) const;
    double lengthByEnd(const LinkWay& way, std::size_t end) const;
    std::complex<double> byEnd(const LinkWay& way, std::size_t end, double waveNumber) const;

  private:
    std::optional<RoundBody> body_;
    bool backwards_ = false;
    std::optional<WallEdge> edge_;
};

}  // namespace rtsg
