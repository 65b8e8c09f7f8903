// RayLanes: the rays of a batch that are under way, sixteen side by side.
//
// Each step at a wall is computed for all lanes at once, in loops that compilers turn into vector instructions. A lane
// without a ray, or whose ray met nothing, computes along, and its result is ignored.
// Threading: one thread an object.
#pragma once

#include <bit>
#include <cstdint>

#include <glm/glm.hpp>

#include "batch_task.h"
#include "response/directions.h"
#include "signal/random.h"

namespace rtsg::trace {

/// Calls `visit` with the number of each bit that is set, lowest first.
template <class Visit>
void forEachBit(std::uint32_t bits, const Visit& visit) {
    for (; bits != 0; bits &= bits - 1) visit(std::countr_zero(bits));
}

/// A bit for each lane of which this is true.
template <class Test>
std::uint32_t lanesWhere(const Test& test) {
    std::uint32_t lanes = 0;
    for (int i = 0; i < AcousticRays::kMax; ++i) {
        const bool is = test(i);
        lanes |= std::uint32_t{is} << i;
    }
    return lanes;
}

/// Pairs of numbers in [0, 1), with 32 bits each.
inline void drawPairs(Random& random, double (&first)[AcousticRays::kMax], double (&second)[AcousticRays::kMax]) {
    // A number from 1 to 2 has these bits above its fraction's; taking 1 away is exact.
    constexpr std::uint64_t kOne = std::bit_cast<std::uint64_t>(1.0);
    for (int i = 0; i < AcousticRays::kMax; ++i) {
        const std::uint64_t bits = random.next();
        first[i] = std::bit_cast<double>(kOne | (bits >> 32) << 20) - 1;
        second[i] = std::bit_cast<double>(kOne | (bits & 0xFFFFFFFF) << 20) - 1;
    }
}

template <std::size_t N>
class RayLanes {
  public:
    static constexpr int kMax = AcousticRays::kMax;
    using Vectors = AcousticRays::Vectors;

    enum class Event : std::uint8_t { emitted, diffuse, mirror };

    /// From the last hit; `facing`: normal of the surface there, on the side of the ray; `except`: its plane.
    AcousticRays rays;
    Vectors before;  // where they came from to there
    alignas(64) double energy[N][kMax] = {};
    alignas(64) double travelled[kMax] = {};  // metres
    double roulette[kMax] = {};               // share of a ray's first energy at which roulette is played next
    Event last[kMax] = {};
    int mirrorOrder[kMax] = {};        // reflections while all were mirror-like
    MirrorSequence mirrors[kMax];      // since the last reflection that was not mirror-like
    double mirrorFraction[kMax] = {};  // at most, of energy that they left
    bool onlyMirrors[kMax] = {};       // so far
    std::int32_t wallsMet[kMax] = {};  // as far as they scatter
    std::int32_t parts[kMax] = {};     // that one that was sent has been split into
    bool isPart[kMax] = {};
    bool again[kMax] = {};  // it goes to a wall where one that it is a part of has been

    Energy<N> energyOf(int i) const { return column(energy, i); }
    void start(int i, const glm::dvec3& origin, const glm::dvec3& direction, const Energy<N>& with, double playedAt) {
        rays.origin.set(i, origin), before.set(i, origin), rays.facing.set(i, glm::dvec3(0));
        rays.direction.set(i, direction);
        rays.except[i] = kNoPlane;
        for (std::size_t b = 0; b < N; ++b) energy[b][i] = with[b];
        travelled[i] = 0, roulette[i] = playedAt, last[i] = Event::emitted;
        mirrorOrder[i] = 0, mirrors[i] = {}, mirrorFraction[i] = 1, onlyMirrors[i] = true, wallsMet[i] = 0;
        parts[i] = 1, isPart[i] = again[i] = false;
    }
    void copy(int from, int to) {
        const auto copyVector = [&](Vectors& v) { v.set(to, v[from]); };
        copyVector(rays.origin), copyVector(rays.direction), copyVector(rays.facing), copyVector(before);
        rays.except[to] = rays.except[from];
        for (std::size_t b = 0; b < N; ++b) energy[b][to] = energy[b][from];
        travelled[to] = travelled[from], roulette[to] = roulette[from], last[to] = last[from];
        mirrorOrder[to] = mirrorOrder[from], mirrors[to] = mirrors[from], mirrorFraction[to] = mirrorFraction[from];
        onlyMirrors[to] = onlyMirrors[from], wallsMet[to] = wallsMet[from];
        parts[to] = parts[from], isPart[to] = isPart[from], again[to] = again[from];
    }

    /// A ray on its way to a wall that it will meet once more.
    struct Part {
        glm::dvec3 origin, direction, facing, before;
        std::uint32_t except;
        Energy<N> energy;
        double travelled, roulette;
        Event last;
        int mirrorOrder;
        MirrorSequence mirrors;
        double mirrorFraction;
        bool onlyMirrors;
        std::int32_t wallsMet, parts;
    };

    // The members below belong to the walls that were met last.

    /// Moves rays to their hits. `met`: a bit for each that hit something; for others `hits` means nothing. Rays can be
    /// split if `keepsDistance`.
    void arrive(std::uint32_t met, const AcousticHits& hits, const std::vector<Fractions<N>>& walls,
                bool keepsDistance = false) {
        alignas(64) double distance[kMax] = {};
        const Fractions<N>* fractions[kMax];
        if (keepsDistance) keepDistance();
        for (int i = 0; i < kMax; ++i) {
            const AcousticHit& hit = hits[static_cast<std::size_t>(i)];
            const bool any = (met >> i & 1) != 0;
            distance[i] = any ? hit.distance : 0;
            normal_.set(i, hit.normal);
            fractions[i] = &walls[any ? hit.material : 0];
            rays.except[i] = hit.plane;
        }
        Vectors &o = rays.origin, &d = rays.direction, &n = normal_, &f = rays.facing;
        for (int i = 0; i < kMax; ++i) {
            before.x[i] = o.x[i], before.y[i] = o.y[i], before.z[i] = o.z[i];
            o.x[i] += d.x[i] * distance[i], o.y[i] += d.y[i] * distance[i], o.z[i] += d.z[i] * distance[i];
            travelled[i] += distance[i];
            cosine_[i] = d.x[i] * n.x[i] + d.y[i] * n.y[i] + d.z[i] * n.z[i];
            const double side = cosine_[i] > 0 ? -1.0 : 1.0;
            f.x[i] = side * n.x[i], f.y[i] = side * n.y[i], f.z[i] = side * n.z[i];
        }
        for (std::size_t b = 0; b < N; ++b)
            for (int i = 0; i < kMax; ++i) {
                diffuse_[b][i] = energy[b][i] * fractions[i]->diffuse[b];
                mirror_[b][i] = energy[b][i] * fractions[i]->mirror[b];
                through_[b][i] = energy[b][i] * fractions[i]->through[b];
            }
        addUp(diffuse_, diffuseSum_), addUp(mirror_, mirrorSum_), addUp(through_, throughSum_);
    }
    Energy<N> scattered(int i) const { return column(diffuse_, i); }
    /// The scattered share of the energy that the wall leaves.
    double scattering(int i) const { return diffuseSum_[i] / (diffuseSum_[i] + mirrorSum_[i] + throughSum_[i]); }
    /// By lane, the largest share that the wall leaves in any band.
    void leftMaximum(double (&maximum)[kMax]) const {
        for (int i = 0; i < kMax; ++i) maximum[i] = 0;
        for (std::size_t b = 0; b < N; ++b)
            for (int i = 0; i < kMax; ++i) {
                const double all = diffuse_[b][i] + mirror_[b][i] + through_[b][i];
                maximum[i] = all > maximum[i] ? all : maximum[i];
            }
    }
    /// Multiplies the energy that the wall leaves by a factor.
    void scale(int i, double factor) {
        for (std::size_t b = 0; b < N; ++b) diffuse_[b][i] *= factor, mirror_[b][i] *= factor, through_[b][i] *= factor;
        diffuseSum_[i] *= factor, mirrorSum_[i] *= factor, throughSum_[i] *= factor;
    }
    /// Splits a ray into parts that continue independently; call it before the ray continues. Returns the state of the
    /// other parts.
    Part split(int i, int into) {
        parts[i] *= into;
        Part part{before[i],
                  rays.direction[i],
                  pathLength_.facing[i],
                  pathLength_.before[i],
                  pathLength_.except[i],
                  energyOf(i),
                  pathLength_.travelled[i],
                  roulette[i],
                  last[i],
                  mirrorOrder[i],
                  mirrors[i],
                  mirrorFraction[i],
                  onlyMirrors[i],
                  wallsMet[i],
                  parts[i]};
        for (double& e : part.energy) e /= into;
        scale(i, 1.0 / into);
        return part;
    }
    void start(int i, const Part& part) {
        rays.origin.set(i, part.origin), before.set(i, part.before), rays.facing.set(i, part.facing);
        rays.direction.set(i, part.direction);
        rays.except[i] = part.except;
        for (std::size_t b = 0; b < N; ++b) energy[b][i] = part.energy[b];
        travelled[i] = part.travelled, roulette[i] = part.roulette, last[i] = part.last;
        mirrorOrder[i] = part.mirrorOrder, mirrors[i] = part.mirrors, mirrorFraction[i] = part.mirrorFraction;
        onlyMirrors[i] = part.onlyMirrors, wallsMet[i] = part.wallsMet;
        parts[i] = part.parts, isPart[i] = again[i] = true;
    }
    /// Rays whose wall leaves any energy, of these; and those of which something is scattered.
    std::uint32_t left(std::uint32_t of) const {
        return of & lanesWhere([this](int i) { return diffuseSum_[i] + mirrorSum_[i] + throughSum_[i] > 0; });
    }
    std::uint32_t scatters(std::uint32_t of) const {
        return of & lanesWhere([this](int i) { return diffuseSum_[i] > 0; });
    }

    /// Chooses how each ray continues, with probabilities equal to its shares of energy: `choice`, in [0, 1). Scattered
    /// rays go in the direction of `across` and `round`, see cosineDirections().
    void goOn(const double (&choice)[kMax], const double (&across)[kMax], const double (&round)[kMax],
              std::span<const ReflectingPlane> planes) {
        alignas(64) std::int64_t event[kMax];
        for (int i = 0; i < kMax; ++i) {
            const double d = diffuseSum_[i], m = mirrorSum_[i], t = throughSum_[i], at = choice[i] * (d + m + t);
            // Rounding may put the choice past the last share; a share of nothing is never chosen.
            const bool scatters = (d > 0) & ((at < d) | (m + t <= 0));
            const bool reflects = (m > 0) & ((at < d + m) | (t <= 0));
            event[i] = scatters ? kScatters : reflects ? kReflects : kPasses;
        }
        rotate(event, across, round);
        weigh(event);
        for (int i = 0; i < kMax; ++i) {
            const bool scatters = event[i] == kScatters;
            mirrors[i] = scatters ? MirrorSequence() : mirrors[i];
        }
        for (int i = 0; i < kMax; ++i) {
            const bool scatters = event[i] == kScatters;
            onlyMirrors[i] = onlyMirrors[i] & !scatters;
            last[i] = scatters ? Event::diffuse : last[i];
        }
        forEachBit(lanesWhere([&](int i) { return event[i] == kReflects; }), [&](int i) {
            const std::uint32_t plane = rays.except[i];
            last[i] = Event::mirror;
            ++mirrorOrder[i];
            mirrors[i].append(plane);
            if (plane < planes.size()) mirrorFraction[i] *= planes[plane].mirrors;
        });
    }
    /// Those of `lanes` whose energy is below `of` times that of the next Russian roulette.
    std::uint32_t faint(std::uint32_t lanes, double of) const {
        return lanes & lanesWhere([&](int i) {
                   double maximum = energy[0][i];
                   for (std::size_t b = 1; b < N; ++b) maximum = energy[b][i] > maximum ? energy[b][i] : maximum;
                   return !(maximum >= roulette[i] * of);
               });
    }

  private:
    static constexpr std::int64_t kScatters = 0, kReflects = 1, kPasses = 2;
    using Energies = double[N][kMax];

    /// Keeps where rays start to the wall that is met next, for parts of them that go there once more.
    void keepDistance() {
        pathLength_.before = before, pathLength_.facing = rays.facing;
        std::copy_n(rays.except, kMax, pathLength_.except);
        std::copy_n(travelled, kMax, pathLength_.travelled);
    }

    static Energy<N> column(const Energies& of, int i) {
        Energy<N> result;
        for (std::size_t b = 0; b < N; ++b) result[b] = of[b][i];
        return result;
    }
    static void addUp(const Energies& energies, double (&sum)[kMax]) {
        for (int i = 0; i < kMax; ++i) sum[i] = energies[0][i];
        for (std::size_t b = 1; b < N; ++b)
            for (int i = 0; i < kMax; ++i) sum[i] += energies[b][i];
    }
    void rotate(const std::int64_t (&event)[kMax], const double (&across)[kMax], const double (&round)[kMax]) {
        cosineDirections(rays.facing, across, round, scattered_);
        const auto along = [&](double(&direction)[kMax], double(&facing)[kMax], const double(&away)[kMax],
                               const double(&normal)[kMax]) {
            for (int i = 0; i < kMax; ++i) {
                const double mirrored = direction[i] - normal[i] * (2 * cosine_[i]);
                direction[i] = event[i] == kScatters ? away[i] : event[i] == kReflects ? mirrored : direction[i];
                facing[i] = event[i] == kPasses ? -facing[i] : facing[i];
            }
        };
        along(rays.direction.x, rays.facing.x, scattered_.x, normal_.x);
        along(rays.direction.y, rays.facing.y, scattered_.y, normal_.y);
        along(rays.direction.z, rays.facing.z, scattered_.z, normal_.z);
    }
    /// Gives each ray the energy of its event, divided by the probability of the event.
    void weigh(const std::int64_t (&event)[kMax]) {
        for (std::size_t b = 0; b < N; ++b)
            for (int i = 0; i < kMax; ++i) {
                const double all = diffuseSum_[i] + mirrorSum_[i] + throughSum_[i];
                if constexpr (N == 1) {
                    energy[b][i] = all;
                    continue;
                }
                const bool scatters = event[i] == kScatters, reflects = event[i] == kReflects;
                const double part = scatters ? diffuse_[b][i] : reflects ? mirror_[b][i] : through_[b][i];
                const double chance = scatters ? diffuseSum_[i] : reflects ? mirrorSum_[i] : throughSum_[i];
                energy[b][i] = part * (all / chance);
            }
    }

    struct {
        Vectors before, facing;
        std::uint32_t except[kMax];
        double travelled[kMax];
    } pathLength_ = {};
    Vectors normal_, scattered_;
    alignas(64) double cosine_[kMax] = {};  // of the normal with the way there
    alignas(64) Energies diffuse_ = {}, mirror_ = {}, through_ = {};
    alignas(64) double diffuseSum_[kMax] = {}, mirrorSum_[kMax] = {}, throughSum_[kMax] = {};
};

}  // namespace rtsg::trace
