// The clocks of sounds and films: ISO/IEC 19775-1 V4.0, 8.2.4 (time-dependent nodes), 16.4 (sound sources), 18.4.2
// (MovieTexture). The loader finds the length of a file between frames (InlineLoader) and stores it in _duration, so
// replays and replicas need no files. A source that plays for ever is active until its stopTime. The renderer of sound
// finds the reduction of a DynamicsCompressor (16.4.11) in the same way.
#include <algorithm>
#include <cmath>

#include <rtsg/core/portable_math.h>
#include <rtsg/core/x3d.h>

#include "behaviours.h"
#include "time_dependent.h"

namespace rtsg::behaviours {

namespace {

/// Seconds that the medium plays once at its own speed; negative: not known yet, infinite: no end.
double lengthOf(const Node& node) {
    if (node.is(x3d::BufferAudioSource::type)) {
        using B = x3d::BufferAudioSource;
        const auto frames = static_cast<double>(node.get(B::length));
        const double rate = node.get(B::sampleRate);
        const double length = node.get(B::buffer).empty() ? node.get(B::_duration).seconds
                                                          : frames / (rate > 0 && std::isfinite(rate) ? rate : 48'000);
        const double used = node.get(B::bufferDuration).seconds;  // of it; 0: all
        return used > 0 ? std::min(length, used) : length;
    }
    if (node.is(x3d::AudioClip::type)) {
        // Its pitch is above 0 (16.4.2): with another it does not play.
        const bool plays = node.get(x3d::AudioClip::pitch) > 0;
        return plays ? node.get(x3d::AudioClip::_duration).seconds : 0;
    }
    if (node.is(x3d::MovieTexture::type)) return node.get(x3d::MovieTexture::_duration).seconds;
    return kNever;
}

/// Times its own speed, or its inverse: a film may run backwards.
double speedOf(const Node& node) {
    using B = x3d::BufferAudioSource;
    if (node.is(x3d::AudioClip::type)) return node.get(x3d::AudioClip::pitch);
    if (node.is(x3d::MovieTexture::type)) return node.get(x3d::MovieTexture::speed);
    if (node.is(B::type))
        return double(node.get(B::playbackRate)) * portable::pow(2.0, double(node.get(B::detune)) / 1200);
    return 1;
}

bool loops(const Node& node) {
    if (node.is(x3d::AudioClip::type)) return node.get(x3d::AudioClip::loop);
    if (node.is(x3d::MovieTexture::type)) return node.get(x3d::MovieTexture::loop);
    return node.is(x3d::BufferAudioSource::type) && node.get(x3d::BufferAudioSource::loop);
}

/// Sends the length that the file or the buffer states.
template <class N>
void sendLength(Cascade& cascade, const Node& node) {
    if constexpr (requires { N::duration_changed; }) {
        const Time duration = node.get(N::_duration), reported = node.get(N::duration_changed);
        if (duration.seconds < 0 && reported.seconds == 0)
            cascade.store(node, N::duration_changed, Time{-1});  // nobody has known anything else
        else if (duration != reported)
            cascade.emit(node, N::duration_changed, duration);
    }
    if constexpr (requires { N::length; }) {
        const auto channels = static_cast<std::size_t>(std::max(1, node.get(N::numberOfChannels)));
        const auto frames = static_cast<std::int32_t>(node.get(N::buffer).size() / channels);
        if (frames != node.get(N::length)) cascade.emit(node, N::length, frames);
    }
}

template <class N>
double stop(Cascade& cascade, const Node& node) {
    if (node.get(N::isPaused)) cascade.emit(node, N::isPaused, false);
    if (node.get(N::isActive)) cascade.emit(node, N::isActive, false);
    const double start = node.get(N::startTime).seconds;
    return node.get(N::enabled) && start > cascade.now() ? start : kNever;
}

template <class N>
bool accepts(const Node& node, FieldIndex field, EventValue value) {
    // The speed of a film that runs stays (18.4.2), and so does the pitch of a clip (16.4.1 of X3D V3.3).
    if (field == x3d::MovieTexture::speed.index && node.is(x3d::MovieTexture::type) && node.get(N::isActive))
        return false;
    if (field == x3d::AudioClip::pitch.index && node.is(x3d::AudioClip::type) && node.get(N::isActive)) return false;
    return acceptsTime<N>(node, field, value);
}

template <class N>
double onTime(Cascade& cascade, const Node& node) {
    sendLength<N>(cascade, node);
    const double now = cascade.now(), start = node.get(N::startTime).seconds, end = node.get(N::stopTime).seconds;
    const double speed = std::abs(speedOf(node)), length = lengthOf(node);
    const double cycle = speed > 0 ? length / speed : kNever;
    if (!node.get(N::enabled) || !std::isfinite(start) || !(length > 0) || std::isnan(cycle))
        return stop<N>(cascade, node);
    const bool stopping = end > start && now >= end;
    if (!node.get(N::isActive)) {
        if (start > now) return start;
        // A clip that has ended does not begin again; but one that began and ended since the last frame still sends its
        // events.
        if (stopping || (!loops(node) && now - start >= cycle && start <= cascade.previous())) return kNever;
        if (cascade.hasSent(node, N::isActive.index)) return now;  // that it ended: it begins at the next timestamp
        cascade.store(node, N::_pausedTotal, Time{0});
        cascade.emit(node, N::isActive, true);
        cascade.emit(node, N::elapsedTime, Time{loops(node) ? now - start : std::min(now - start, cycle)});
        return now;
    }
    if (handlePause<N>(cascade, node, stopping)) return stopping ? stop<N>(cascade, node) : now;
    const double active = activeBy<N>(stopping ? endOf<N>(node) : now, node);
    if (!loops(node) && std::isfinite(cycle)) {
        // One that has looped until now ends with its cycle.
        const double begun = std::floor(node.get(N::elapsedTime).seconds / cycle) * cycle;
        if (active >= begun + cycle) {
            cascade.emit(node, N::elapsedTime, Time{begun + cycle});
            return stop<N>(cascade, node);
        }
    }
    cascade.emit(node, N::elapsedTime, Time{active});
    return stopping ? stop<N>(cascade, node) : now;
}

template <class N>
void onEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue) {
    heedTime<N>(cascade, node, field, [&] {
        if (!node.get(N::isPaused)) cascade.emit(node, N::elapsedTime, Time{activeBy<N>(cascade.now(), node)});
        stop<N>(cascade, node);
    });
}

double reportReduction(Cascade& cascade, const Node& node) {
    using D = x3d::DynamicsCompressor;
    const float metered = node.get(D::_metered), reduction = metered < 0 ? metered : 0.0f;
    if (reduction != node.get(D::reduction)) cascade.emit(node, D::reduction, reduction);
    return kNever;
}

template <class N>
Behaviour clockOf() {
    return {.accepts = accepts<N>, .onEvent = onEvent<N>, .onTime = onTime<N>};
}

}  // namespace

void appendMedia(std::vector<BuiltinBehaviour>& table) {
    table.push_back({x3d::AudioClip::type, clockOf<x3d::AudioClip>()});
    table.push_back({x3d::BufferAudioSource::type, clockOf<x3d::BufferAudioSource>()});
    table.push_back({x3d::DynamicsCompressor::type, {.onTime = reportReduction}});
    table.push_back({x3d::ListenerPointSource::type, clockOf<x3d::ListenerPointSource>()});
    table.push_back({x3d::MicrophoneSource::type, clockOf<x3d::MicrophoneSource>()});
    table.push_back({x3d::MovieTexture::type, clockOf<x3d::MovieTexture>()});
    table.push_back({x3d::OscillatorSource::type, clockOf<x3d::OscillatorSource>()});
    table.push_back({x3d::StreamAudioSource::type, clockOf<x3d::StreamAudioSource>()});
}

}  // namespace rtsg::behaviours
