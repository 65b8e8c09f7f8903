// Moves the particles of a system from their birth to now.
#include "particles.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include <rtsg/core/portable_math.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "particle_emitters.h"
#include "shapes/tessellate_detail.h"

namespace rtsg::detail {

namespace {

using P = x3d::ParticleSystem;

/// The most tests of particles against triangles for one time.
constexpr double kMaxTests = 2e7;

/// How strong a wind has blown: its speed changes every `tick` seconds of the scene's clock, by numbers that follow
/// from the wind's node and the tick's. Integrals of the pressure, as a share of that of the average speed.
class Gusts {
  public:
    /// For times from `now` - `oldest` to `now`.
    Gusts(const Node& wind, double longest, double oldest, double now) {
        while (longest / tick_ > kMaxTicks) tick_ *= 2;
        const double gustiness = wind.get(x3d::WindPhysicsModel::gustiness);
        if (!(gustiness > 0) || !std::isfinite(gustiness) || !(std::abs(now) / tick_ < 1e15)) return;
        first_ = std::floor((now - oldest) / tick_);
        const auto count = static_cast<std::size_t>(std::floor(now / tick_) - first_) + 1;
        double speed = 0, distance = 0;
        for (std::size_t i = 0; i < count; ++i) {
            const auto number = static_cast<std::uint64_t>(static_cast<std::int64_t>(first_) + std::int64_t(i));
            const double fraction =
                std::max(0.0, 1 + gustiness * KeyedNumbers(wind.id().value, 1, number).nextSigned());
            ticks_.push_back({fraction * fraction, speed, distance});
            distance += (speed + .5 * fraction * fraction * tick_) * tick_;
            speed += fraction * fraction * tick_;
        }
    }

    /// When the pressure next changes after `time`.
    double change(double time) const {
        if (ticks_.empty()) return std::numeric_limits<double>::infinity();
        const double next = (std::floor(time / tick_) + 1) * tick_;
        return next > time ? next : next + tick_;
    }
    /// How many times it changes in `seconds`.
    double changes(double seconds) const { return ticks_.empty() ? 0 : seconds / tick_; }
    double pressure(double time) const { return ticks_.empty() ? 1 : at(time).pressure; }
    /// The speed and the way that one unit of acceleration at average speed gives from `from` to `to`.
    std::pair<double, double> effect(double from, double to) const {
        const double seconds = to - from;
        if (ticks_.empty()) return {seconds, .5 * seconds * seconds};
        const auto [speed, distance] = integrals(to);
        const auto [speedBefore, pathBefore] = integrals(from);
        return {speed - speedBefore, distance - pathBefore - speedBefore * seconds};
    }

  private:
    static constexpr double kMaxTicks = 65536;
    struct Tick {
        double pressure, speed, distance;  // in it, and the integrals up to it
    };
    std::size_t index(double time) const {
        return static_cast<std::size_t>(
            std::clamp(std::floor(time / tick_) - first_, 0.0, static_cast<double>(ticks_.size() - 1)));
    }
    const Tick& at(double time) const { return ticks_[index(time)]; }
    std::pair<double, double> integrals(double time) const {
        const std::size_t i = index(time);
        const double since = time - (first_ + static_cast<double>(i)) * tick_;
        const Tick& t = ticks_[i];
        return {t.speed + t.pressure * since, t.distance + (t.speed + .5 * t.pressure * since) * since};
    }

    double tick_ = .1, first_ = 0;
    std::vector<Tick> ticks_;
};

struct Wind {
    Vec3d direction;
    double pressure, turbulence;  // newtons a square metre
    Gusts gusts;
};

/// The forces and winds that act on particles.
class Physics {
  public:
    Physics(const Scene& scene, const Node& system, const MeshOf& meshOf, double longest, double oldest, double now)
        : now_(now) {
        for (const NodeId id : system.get(P::physics)) {
            const Node* model = scene.effectiveNode(id);
            if (!model) continue;
            if (model->is(x3d::ForcePhysicsModel::type) && model->get(x3d::ForcePhysicsModel::enabled))
                force_ += Vec3d(model->get(x3d::ForcePhysicsModel::force));
            else if (model->is(x3d::WindPhysicsModel::type) && model->get(x3d::WindPhysicsModel::enabled))
                addWind(*model, longest, oldest);
            else if (model->is(x3d::BoundedPhysicsModel::type) && model->get(x3d::BoundedPhysicsModel::enabled))
                if (const auto mesh = meshOf(model->get(x3d::BoundedPhysicsModel::geometry))) walls_.add(*mesh);
        }
    }
    std::size_t wallCount() const { return walls_.size(); }
    /// How often a particle that lives so long is tested against the walls, if it meets none.
    double tests(double seconds) const {
        double pieces = 1;
        for (const Wind& wind : winds_) pieces += wind.gusts.changes(seconds);
        return pieces * double(walls_.size());
    }
    void forgetWalls() { walls_ = {}; }

    void move(const LivingParticle& particle, KeyedNumbers& numbers, Vec3d& p, Vec3d& v) const {
        const EmissionSpan& span = *particle.span;
        const double mass = span.mass > 0 ? span.mass : 1;
        const Vec3d steady = force_ / mass;
        std::vector<Vec3d> blown(winds_.size());
        for (std::size_t i = 0; i < winds_.size(); ++i) {
            // 40.4.9: each is turned by the turbulence in its own way, for all its life.
            const double widest = portable::cos(std::numbers::pi * winds_[i].turbulence);
            blown[i] =
                directionInCone(winds_[i].direction, widest, numbers) * (winds_[i].pressure * span.surfaceArea / mass);
        }
        const double born = now_ - particle.age;
        if (walls_.size() == 0) {
            p += v * particle.age + steady * (.5 * particle.age * particle.age);
            v += steady * particle.age;
            for (std::size_t i = 0; i < winds_.size(); ++i) {
                const auto [speed, distance] = winds_[i].gusts.effect(born, now_);
                p += blown[i] * distance;
                v += blown[i] * speed;
            }
            return;
        }
        // Between two changes of the wind the acceleration is constant.
        double time = born, left = particle.age;
        for (bool last = false; !last;) {
            double until = now_;
            Vec3d acceleration = steady;
            for (std::size_t i = 0; i < winds_.size(); ++i) {
                until = std::min(until, winds_[i].gusts.change(time));
                acceleration += blown[i] * winds_[i].gusts.pressure(time);
            }
            last = until >= now_;
            const double seconds = last ? std::max(0.0, left) : until - time;
            if (!walls_.move(p, v, acceleration, seconds)) return;
            left -= seconds;
            time = until;
        }
    }

  private:
    void addWind(const Node& node, double longest, double oldest) {
        using W = x3d::WindPhysicsModel;
        const double speed = node.get(W::speed), turbulence = std::clamp(double{node.get(W::turbulence)}, 0.0, 1.0);
        const Vec3d direction(node.get(W::direction));
        if (!std::isfinite(speed + turbulence + direction.x + direction.y + direction.z)) return;
        // 40.4.9: 10^(2 log10(speed)) * 0.64615
        winds_.push_back({direction, .64615 * speed * speed, turbulence, Gusts(node, longest, oldest, now_)});
    }

    double now_;
    Vec3d force_{0};
    std::vector<Wind> winds_;
    ParticleWalls walls_;
};

}  // namespace

std::vector<MovedParticle> moveParticles(const Scene& scene, const Node& system, const MeshOf& meshOf, Mesh& problems) {
    std::vector<MovedParticle> moved;
    const std::vector<EmissionSpan> spans = unpackEmission(system.get(P::_emission).span());
    const Node* node = scene.effectiveNode(system.get(P::emitter));
    if (spans.empty() || !node) return moved;
    const double now = system.get(P::_time).seconds;
    const std::vector<LivingParticle> living = livingParticles(spans, system.id().value, now);
    if (living.empty() || !std::isfinite(now)) return moved;
    const ParticleEmitter emitter(scene, *node, meshOf, problems);
    if (!emitter.canEmit()) return moved;
    double longest = 0, oldest = 0, maximum = 0;
    for (const EmissionSpan& span : spans) {
        longest = std::max(longest, span.lifetime * (1 + span.lifetimeVariation));
        maximum = std::max(maximum, span.count);
    }
    if (maximum * emitter.tests() > kMaxTests) {
        warn(problems,
             "VolumeEmitter has too many triangles, or fills too little of its box, for so many particles: it "
             "emits nothing");
        return moved;
    }
    for (const LivingParticle& particle : living) oldest = std::max(oldest, particle.age);
    Physics physics(scene, system, meshOf, longest, oldest, now);
    if (maximum * physics.tests(longest) > kMaxTests) {
        // Words that stay the same from frame to frame are told once.
        warn(problems, fmt::format("{} triangles are too many to bound so many particles: they are not bounded",
                                   physics.wallCount()));
        physics.forgetWalls();
    }
    moved.reserve(living.size());
    for (const LivingParticle& particle : living) {
        KeyedNumbers numbers = particle.numbers(system.id().value);
        MovedParticle one;
        one.age = particle.age;
        one.size = Vec2f(particle.span->size);
        emitter.emit(*particle.span, numbers, one.position, one.velocity);
        physics.move(particle, numbers, one.position, one.velocity);
        moved.push_back(one);
    }
    return moved;
}

}  // namespace rtsg::detail
