// ParticleSystem: ISO/IEC 19775-1 V4.0, 40.4. Writes down when and how its emitter emits, and the time that its
// particles are shown at; where they are follows from that (rtsg/core/emission.h), so that nothing here counts them.
#include <rtsg/core/emission.h>

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "behaviours.h"

namespace rtsg::behaviours {

namespace {

using P = x3d::ParticleSystem;

/// Reads the fields that all emitters have, and those that only some have.
template <class E>
void readEmitter(const Node& emitter, EmissionSpan& span) {
    span.speed = emitter.get(E::speed), span.variation = emitter.get(E::variation);
    span.mass = emitter.get(E::mass), span.surfaceArea = emitter.get(E::surfaceArea);
    if constexpr (requires { E::position; }) span.position = Vec3d(emitter.get(E::position));
    if constexpr (requires { E::direction; }) span.direction = Vec3d(emitter.get(E::direction));
    if constexpr (requires { E::angle; }) span.angle = emitter.get(E::angle);
    if (!emitter.get(E::on)) span.count = 0;
}

/// False if it is none.
bool readAnyEmitter(const Node& emitter, EmissionSpan& span) {
    switch (emitter.typeIndex().value) {
        case x3d::ConeEmitter::type.value:
            readEmitter<x3d::ConeEmitter>(emitter, span);
            return true;
        case x3d::ExplosionEmitter::type.value:
            readEmitter<x3d::ExplosionEmitter>(emitter, span);
            span.explosive = 1;
            return true;
        case x3d::PointEmitter::type.value:
            readEmitter<x3d::PointEmitter>(emitter, span);
            return true;
        case x3d::PolylineEmitter::type.value:
            readEmitter<x3d::PolylineEmitter>(emitter, span);
            return true;
        case x3d::SurfaceEmitter::type.value:
            readEmitter<x3d::SurfaceEmitter>(emitter, span);
            return true;
        case x3d::VolumeEmitter::type.value:
            readEmitter<x3d::VolumeEmitter>(emitter, span);
            return true;
        default:
            return false;
    }
}

/// The way in which the system would emit now; a count of 0 means that it does not. An emitter with a value out of
/// range emits nothing, and is reported.
EmissionSpan wanted(Cascade& cascade, const Node& system, const Node& emitter) {
    EmissionSpan span;
    span.count = std::max(0, system.get(P::maxParticles));
    if (span.count > double(kMaxParticles)) {
        cascade.warn(system, fmt::format("maxParticles is more than {}: it has so many", kMaxParticles));
        span.count = double(kMaxParticles);
    }
    span.lifetime = system.get(P::particleLifetime), span.lifetimeVariation = system.get(P::lifetimeVariation);
    span.size = Vec2d(system.get(P::particleSize));
    if (!readAnyEmitter(emitter, span) || !system.get(P::createParticles)) span.count = 0;
    EmissionSpan checked = span;
    checked.start = 0;
    const bool sound = unpackEmission(packEmission(std::span(&checked, 1)).span()).size() == 1;
    if (!sound || span.size.x < 0 || span.size.y < 0 || span.mass < 0 || span.surfaceArea < 0) {
        cascade.warn(system, "has a lifetime, size, mass, speed or place that cannot be: it emits nothing");
        span = EmissionSpan{};
    }
    return span;
}

bool emitsAlike(const EmissionSpan& a, EmissionSpan b) {
    b.start = a.start, b.end = a.end, b.serial = a.serial;
    const Array<double> one = packEmission(std::span(&a, 1)), other = packEmission(std::span(&b, 1));
    return std::ranges::equal(one.span(), other.span());
}

/// Closes the last span, goes on with it or begins another, as `next` wants; true if anything changed.
bool follow(std::vector<EmissionSpan>& spans, EmissionSpan next, double now) {
    EmissionSpan* last = spans.empty() ? nullptr : &spans.back();
    const bool open = last && last->end > now;
    if (!next.emits()) {
        if (open) last->end = now;
        return open;
    }
    next.start = now;
    next.serial = last ? last->serial + 1 : 0;
    if (open) {
        // An explosion is over once it has begun; another one begins when it is switched on again.
        if (emitsAlike(*last, next) || (last->explosive != 0 && next.explosive != 0)) return false;
        const double due = last->nextBirth(now);
        if (next.explosive == 0) next.start = std::min(due, now + next.lifetime / next.count);
        // One of which none has been born yet is as if it had not been.
        if (last->start >= now) {
            next.serial = last->serial;
            *last = next;
            return true;
        }
        last->end = now;
    }
    spans.push_back(next);
    return true;
}

double particlesOnTime(Cascade& cascade, const Node& node) {
    const double now = cascade.now();
    const Node* emitter = cascade.scene().effectiveNode(node.get(P::emitter));
    EmissionSpan unused;
    const bool active = node.get(P::enabled) && emitter && readAnyEmitter(*emitter, unused) && std::isfinite(now);
    if (node.get(P::isActive) != active) cascade.emit(node, P::isActive, active);
    if (!active) {
        if (!node.get(P::_emission).empty()) cascade.store(node, P::_emission, Array<double>());
        return kNever;
    }
    std::vector<EmissionSpan> spans = unpackEmission(node.get(P::_emission).span());
    bool changed = follow(spans, wanted(cascade, node, *emitter), now);
    // The last one stays, as the next one is counted from it.
    if (!spans.empty())
        changed |= std::erase_if(spans, [&, last = spans.back().serial](const EmissionSpan& span) {
                       return span.serial != last && span.over() <= now;
                   }) > 0;
    if (spans.size() > kMaxEmissionSpans) {
        cascade.warn(node, fmt::format("its emitter changes so often that of {} changes at a time the oldest are lost",
                                       kMaxEmissionSpans));
        spans.erase(spans.begin(), spans.end() - static_cast<std::ptrdiff_t>(kMaxEmissionSpans));
    }
    if (changed) cascade.store(node, P::_emission, packEmission(spans));
    if (spans.empty()) return kNever;
    const auto living = [&](double at) {
        return std::ranges::any_of(spans, [&](const EmissionSpan& span) { return span.over() > at; });
    };
    // The picture in which the last of them are gone counts, too.
    if (!living(now) && !living(node.get(P::_time).seconds) && !changed) return kNever;
    if (node.get(P::_time).seconds != now) cascade.store(node, P::_time, Time{now});
    return living(now) ? now : kNever;
}

/// An emitter that is switched on or off wakes the systems that it is in.
double emitterOnTime(Cascade& cascade, const Node& node) {
    constexpr int kMaxInstances = 64;  // a PROTO's body in a PROTO's body ...
    std::vector<NodeId> above{node.id()};
    for (int depth = 0; depth < kMaxInstances && !above.empty(); ++depth) {
        std::vector<NodeId> next;
        for (const NodeId id : above)
            for (const ParentRef& parent : cascade.scene().parents(id)) {
                const Node& holder = cascade.scene().node(parent.node);
                if (holder.is(P::type))
                    cascade.wake(holder);
                else if (holder.type().body() != kNoField)
                    next.push_back(parent.node);
            }
        above = std::move(next);
    }
    return kNever;
}

}  // namespace

void appendParticles(std::vector<BuiltinBehaviour>& table) {
    table.push_back({x3d::ParticleSystem::type, {.onTime = particlesOnTime}});
    for (const TypeIndex type : {x3d::ConeEmitter::type, x3d::ExplosionEmitter::type, x3d::PointEmitter::type,
                                 x3d::PolylineEmitter::type, x3d::SurfaceEmitter::type, x3d::VolumeEmitter::type})
        table.push_back({type, {.onTime = emitterOnTime}});
}

}  // namespace rtsg::behaviours
