// EmissionSpan: a stretch of time in which a ParticleSystem emits in one way; what is kept of it in the hidden field
// `_emission`, and which particles of it live at a time.
//
// Invariant: a particle is a number; when it is born, how long it lives and every number that is drawn for it follow
// from its span, that number and the system's node alone. So whoever has the fields has the particles: a replica, a
// late joiner, a replay. In a span at most `count` particles live at a time, and from `lifetime` after its start on
// exactly that many: there are `count` places, each taken anew when its particle's time is over, and of two that follow
// each other in a place one lives as much longer than `lifetime` as the other lives shorter.
// Threading: plain data and pure functions. Source: ISO/IEC 19775-1 V4.0 40.4 (ParticleSystem), 40.3.1 (emitters).
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <rtsg/core/value.h>

namespace rtsg {

struct EmissionSpan {
    double start = 0;                                      // seconds, as the clock has them
    double end = std::numeric_limits<double>::infinity();  // none is born from then on
    double serial = 0;                                     // of the system's spans
    double count = 0, lifetime = 0, lifetimeVariation = 0;
    double explosive = 0;  // other than 0: all are born at `start`, and none after
    Vec2d size{0};
    double speed = 0, variation = 0, mass = 0, surfaceArea = 0, angle = 0;
    Vec3d position{0}, direction{0};

    bool emits() const { return count >= 1 && lifetime >= 1e-6; }
    /// When the last of its particles is gone at the latest; infinite while it emits.
    double over() const;
    /// The first time from `now` on at which a place falls due.
    double nextBirth(double now) const;
};

/// More than this live at no time; a system that asks for more gets so many.
constexpr std::size_t kMostParticles = 1'000'000;
/// Spans that a system keeps; the oldest go first.
constexpr std::size_t kMostEmissionSpans = 4096;

Array<double> packEmission(std::span<const EmissionSpan> spans);
/// Spans that do not fit, or whose numbers are no valid times, counts and sizes, are left out.
std::vector<EmissionSpan> unpackEmission(std::span<const double> packed);

/// Numbers that follow from a key: the same ones everywhere. Even in [0, 1).
class KeyedNumbers {
  public:
    KeyedNumbers(std::uint64_t a, std::uint64_t b, std::uint64_t c);
    double next();
    /// Even in [-1, 1).
    double nextSigned() { return 2 * next() - 1; }

  private:
    std::uint64_t key_, drawn_ = 0;
};

struct LivingParticle {
    const EmissionSpan* span = nullptr;
    std::uint64_t place = 0, turn = 0;  // in the span; the turn of that place
    double age = 0, life = 0;           // seconds
    /// Whatever else is to be drawn for it.
    KeyedNumbers numbers(std::uint32_t system) const;
};

/// Those that live at `now`, at most kMostParticles, by span and place. `system`: the node's id.
std::vector<LivingParticle> livingParticles(std::span<const EmissionSpan> spans, std::uint32_t system, double now);

}  // namespace rtsg
