// The particles of a system that live at a time, in closed form: nothing is simulated step by step.
#include <rtsg/core/emission.h>

#include <algorithm>
#include <cmath>

namespace rtsg {

namespace {

constexpr std::size_t kNumbers = 20;

std::uint64_t scrambled(std::uint64_t x) {
    x = (x ^ x >> 30) * 0xBF58476D1CE4E5B9ull;
    x = (x ^ x >> 27) * 0x94D049BB133111EBull;
    return x ^ x >> 31;
}

bool isSound(const EmissionSpan& s) {
    const auto positive = [](double x, double maximum) { return x >= 0 && x <= maximum; };
    const auto finite = [](const Vec3d& v) { return std::isfinite(v.x + v.y + v.z); };
    return std::isfinite(s.start) && !std::isnan(s.end) && positive(s.serial, 0x1p53) &&
           positive(s.count, double(kMaxParticles)) && positive(s.lifetime, 1e300) &&
           positive(s.lifetimeVariation, 1) && std::isfinite(s.size.x + s.size.y) &&
           std::isfinite(s.speed + s.variation + s.mass + s.surfaceArea + s.angle) && finite(s.position) &&
           finite(s.direction);
}

/// Collects what lives.
class Census {
  public:
    Census(std::uint32_t system, double now) : system_(system), now_(now) {}

    void explosion(const EmissionSpan& span) {
        const double age = now_ - span.start;
        const auto positions = static_cast<std::uint64_t>(span.count);
        if (!(age >= 0)) return;
        for (std::uint64_t slot = 0; slot < positions && !full(); ++slot)
            add(span, slot, 0, age, span.lifetime * (1 + span.lifetimeVariation * spread(span, slot, 0)));
    }

    void stream(const EmissionSpan& span) {
        const bool closed = span.end <= now_;
        const double until = std::min(now_, span.end) - span.start, every = span.lifetime / span.count;
        if (!(until >= 0)) return;
        const double begun = std::min(span.count, closed ? std::ceil(until / every) : std::floor(until / every) + 1);
        for (std::uint64_t slot = 0; slot < static_cast<std::uint64_t>(begun) && !full(); ++slot) {
            // In one place two particles take turns, 2 * lifetime long together.
            const double since = until - static_cast<double>(slot) * every, two = 2 * span.lifetime;
            if (!(since >= 0)) continue;
            const double pair = std::min(std::floor(since / two), 0x1p52), inPair = since - pair * two;
            const double change = span.lifetimeVariation * spread(span, slot, static_cast<std::uint64_t>(pair));
            const double first = span.lifetime * (1 + change);
            const bool second = inPair >= first;
            const double age = second ? inPair - first : inPair;
            if (closed && age == 0) continue;  // would be born just when the span ends
            add(span, slot, 2 * static_cast<std::uint64_t>(pair) + (second ? 1 : 0), age + (now_ - span.start - until),
                second ? two - first : first);
        }
    }

    std::vector<LivingParticle> take() { return std::move(living_); }

  private:
    bool full() const { return living_.size() >= kMaxParticles; }
    double spread(const EmissionSpan& span, std::uint64_t slot, std::uint64_t pair) const {
        return KeyedNumbers(system_, static_cast<std::uint64_t>(span.serial) << 1 | 1, slot << 32 ^ pair).nextSigned();
    }
    void add(const EmissionSpan& span, std::uint64_t slot, std::uint64_t cycle, double age, double life) {
        if (age < life) living_.push_back({&span, slot, cycle, age, life});
    }

    std::uint32_t system_;
    double now_;
    std::vector<LivingParticle> living_;
};

}  // namespace

double EmissionSpan::over() const {
    const double last = explosive != 0 ? start : end;
    return emits() ? last + lifetime * (1 + lifetimeVariation) : start;
}

double EmissionSpan::nextBirth(double now) const {
    if (!emits() || now <= start) return start;
    const double every = lifetime / count;
    return start + std::ceil((now - start) / every) * every;
}

Array<double> packEmission(std::span<const EmissionSpan> spans) {
    Array<double> packed = Array<double>::ofSize(spans.size() * kNumbers);
    double* out = packed.mutableData();
    for (const EmissionSpan& s : spans)
        for (const double number :
             {s.start,      s.end,        s.serial,     s.count,       s.lifetime,    s.lifetimeVariation, s.explosive,
              s.size.x,     s.size.y,     s.speed,      s.variation,   s.mass,        s.surfaceArea,       s.angle,
              s.position.x, s.position.y, s.position.z, s.direction.x, s.direction.y, s.direction.z})
            *out++ = number;
    return packed;
}

std::vector<EmissionSpan> unpackEmission(std::span<const double> packed) {
    std::vector<EmissionSpan> spans;
    for (std::size_t at = 0; at + kNumbers <= packed.size() && spans.size() < kMaxEmissionSpans; at += kNumbers) {
        const double* n = packed.data() + at;
        EmissionSpan s;
        s.start = n[0], s.end = n[1], s.serial = n[2];
        s.count = n[3], s.lifetime = n[4], s.lifetimeVariation = n[5], s.explosive = n[6];
        s.size = {n[7], n[8]};
        s.speed = n[9], s.variation = n[10], s.mass = n[11], s.surfaceArea = n[12], s.angle = n[13];
        s.position = {n[14], n[15], n[16]}, s.direction = {n[17], n[18], n[19]};
        if (isSound(s)) spans.push_back(s);
    }
    return spans;
}

KeyedNumbers::KeyedNumbers(std::uint64_t a, std::uint64_t b, std::uint64_t c)
    : key_(scrambled(scrambled(scrambled(a + 0x9E3779B97F4A7C15ull) + b) + c)) {}

double KeyedNumbers::next() {
    drawn_ += 0x9E3779B97F4A7C15ull;
    return static_cast<double>(scrambled(key_ + drawn_) >> 11) * 0x1p-53;
}

KeyedNumbers LivingParticle::numbers(std::uint32_t system) const {
    return {system, static_cast<std::uint64_t>(span->serial) << 1, slot << 32 ^ cycle};
}

std::vector<LivingParticle> livingParticles(std::span<const EmissionSpan> spans, std::uint32_t system, double now) {
    Census census(system, now);
    for (const EmissionSpan& span : spans) {
        if (!span.emits()) continue;
        if (span.explosive != 0)
            census.explosion(span);
        else
            census.stream(span);
    }
    return census.take();
}

}  // namespace rtsg
