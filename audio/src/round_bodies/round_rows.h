// Sound round two things in a row of which one is a round body at least: two columns, a column behind a screen, two
// round corners of a wall.
//
// Behind both it is a wave of its own: the product of what each does to what comes from the other one, of which the one
// that is nearer to its shadow's boundary has the shorter distances, as of two edges (wedge.h). Beside one of them it
// goes on into what the other one bends by itself. Threading: pure functions over const geometry.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/echogram.h>

#include "bending_link.h"
#include "edge_rows/edge_pairs.h"
#include "response/edge_tones.h"
#include "round_air.h"

namespace rtsg {

/// What comes by a way round bodies.
struct RoundWave {
    double way = 0;
    glm::dvec3 first{0}, last{0}, direction{0};  // as of an arrival
    std::uint32_t order = 1;
    TonePressures pressure{};  // re the phase of its way
};

class RoundRows {
  public:
    RoundRows(const RoundAir& air, const EdgeTones& tones, const glm::dvec3& source, const glm::dvec3& listener,
              double longest)
        : air_(air), tones_(tones), source_(source), listener_(listener), longest_(longest) {}

    /// By two bodies; `open`: direct sound is heard.
    void addBodies(bool open, std::vector<RoundWave>& waves) const;
    /// By a body and one of the edges; of each what it leaves to pairs.
    void addEdges(const std::vector<PartlySeen>& edges, bool open, std::vector<RoundWave>& waves) const;

    /// By a body and two of the edges, along a face of both.
    void addEdgePairs(const std::vector<PartlySeen>& edges, std::vector<RoundWave>& waves) const;

  private:
    struct Row;
    /// By each body and an edge, or two of a face, that leave so much.
    void addWith(const BendingLink& edges, const TonePressures& left, bool open, std::vector<RoundWave>& waves) const;
    void add(const BendingLink& first, const BendingLink& second, bool open, std::vector<RoundWave>& waves) const;
    void addDark(const Row& row, std::vector<RoundWave>& waves) const;
    void addWithEnds(const Row& row, const RoundWave& main, std::vector<RoundWave>& waves) const;
    void addBeside(const BendingLink& dark, const BendingLink& lit, bool litFirst, std::vector<RoundWave>& waves) const;
    void addLit(const BendingLink& first, const BendingLink& second, std::vector<RoundWave>& waves) const;
    bool findRow(Row& row) const;
    bool isClear(const glm::dvec3& from, const BendingLink* leaving, const glm::dvec3& to,
                 const BendingLink* coming) const;
    bool isFreeAlong(const LinkWay& way, double offset = 0) const;
    bool isFree(const BendingLink& link, const LinkWay& way, const glm::dvec3& from, const glm::dvec3& to) const;
    bool isOpenBeside(const BendingLink& link, const LinkWay& way, const glm::dvec3& from, const glm::dvec3& to) const;
    glm::dvec3 arriving(const LinkWay& way) const;
    template <class Pressure>
    void fill(const Pressure& pressure, TonePressures& result) const;

    const RoundAir& air_;
    const EdgeTones& tones_;
    const glm::dvec3 source_, listener_;
    const double longest_;
};

}  // namespace rtsg
