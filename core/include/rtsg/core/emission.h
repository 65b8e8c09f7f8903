// EmissionSpan: a stretch of time in which a ParticleSystem emits without a change of its parameters. The hidden field
// `_emission` holds the spans, and they say which particles live at a time.
//
// Invariant: a particle is a number. Its birth, its life and every number drawn for it follow from its span, that
// number and the system's node alone. So a replica, a late joiner or a replay that has the fields has the particles. In
// a span at most `count` particles live at a time, and from `lifetime` after its start on exactly that many: there are
// `count` places, each taken anew when its particle dies. Of two that follow each other in a place, one lives as much
// longer than `lifetime` as the other lives shorter. Threading: plain data and pure functions. Source: ISO/IEC 19775-1
// V4.0 40.4 (ParticleSystem), 40.3.1 (emitters).
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <rtsg/core/value.h>

namespace rtsg {

struct EmissionSpan {
    double start = 0;                                      // seconds, on the scene's clock
    double end = std::numeric_limits<double>::infinity();  // no particle is born from then on
    double serial = 0;                                     // the number of the span within its system
    double count = 0, lifetime = 0, lifetimeVariation = 0;
    double explosive = 0;  // not 0: all are born at `start`, and none later
    Vec2d size{0};
    double speed = 0, variation = 0, mass = 0, surfaceArea = 0, angle = 0;
    Vec3d position{0}, direction{0};

    bool emits() const { return count >= 1 && lifetime >= 1e-6; }
    /// The latest time at which its last particle dies; infinite while it emits.
    double over() const;
    /// The first time from `now` on at which a particle is born.
    double nextBirth(double now) const;
};

/// The most particles that a system may have at a time; larger numbers are cut to this one.
constexpr std::size_t kMaxParticles = 1'000'000;
/// The most spans that a system keeps; the oldest are dropped first.
constexpr std::size_t kMaxEmissionSpans = 4096;

Array<double> packEmission(std::span<const EmissionSpan> spans);
/// Reads spans. Spans with a wrong length, or with invalid times, counts or sizes, are left out.
std::vector<EmissionSpan> unpackEmission(std::span<const double> packed);

/// Random numbers that follow from a key and are the same on every machine, uniform in [0, 1).
class KeyedNumbers {
  public:
    KeyedNumbers(std::uint64_t a, std::uint64_t b, std::uint64_t c);
    double next();
    /// Uniform in [-1, 1).
    double nextSigned() { return 2 * next() - 1; }

  private:
    std::uint64_t key_, drawn_ = 0;
};

struct LivingParticle {
    const EmissionSpan* span = nullptr;
    std::uint64_t slot = 0, cycle = 0;  // its place in the span, and how many came before it in that place
    double age = 0, life = 0;           // seconds
    /// Further random numbers for this particle.
    KeyedNumbers numbers(std::uint32_t system) const;
};

/// The particles that live at `now`, at most kMaxParticles, ordered by span and place. `system` is the node's id.
std::vector<LivingParticle> livingParticles(std::span<const EmissionSpan> spans, std::uint32_t system, double now);

}  // namespace rtsg
