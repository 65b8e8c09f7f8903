// TimeSensor: ISO/IEC 19775-1 V4.0, 8.2.4 (time-dependent nodes) and 8.4.1.
//
// Two clocks: the scene's, and the active time (seconds since startTime less the pauses), in which cycles are
// counted; _cycleStart is in active time.
#include <cmath>

#include <rtsg/core/x3d.h>

#include "behaviour/behaviours.h"
#include "behaviour/time_dependent.h"

namespace rtsg::behaviours {

namespace {

using x3d::TimeSensor;

/// `at`: the time that this is about: the frame's, or the boundary at which the sensor ended before it.
void sendProgress(Cascade& cascade, const Node& node, double active, double interval, double at) {
    // 8.4.1: the fraction at the exact end of a cycle is 1, not 0.
    const double cycles = active / interval;
    double fraction = cycles - std::floor(cycles);
    if (fraction == 0 && active > 0) fraction = 1;
    cascade.emit(node, TimeSensor::fraction_changed, static_cast<float>(fraction));
    cascade.emit(node, TimeSensor::elapsedTime, Time{active});
    cascade.emit(node, TimeSensor::time, Time{at});
}

double start(Cascade& cascade, const Node& node) {
    const double now = cascade.now(), startTime = node.get(TimeSensor::startTime).seconds;
    const double interval = node.get(TimeSensor::cycleInterval).seconds;
    const double active = now - startTime;
    const double cycleStart = node.get(TimeSensor::loop) ? std::floor(active / interval) * interval : 0;
    cascade.store(node, TimeSensor::_cycleStart, Time{cycleStart});
    cascade.store(node, TimeSensor::_pausedTotal, Time{0});
    cascade.emit(node, TimeSensor::isActive, true);
    // The cycle's beginning is news only if it came with this frame: not when a scene is loaded in mid-cycle.
    const double begun = startTime + cycleStart;
    if (begun == now || begun > cascade.previous()) cascade.emit(node, TimeSensor::cycleTime, Time{begun});
    // One that is over already says the time at which it was.
    const bool isOver = !node.get(TimeSensor::loop) && active > interval;
    sendProgress(cascade, node, isOver ? interval : active, interval, isOver ? startTime + interval : now);
    return now;
}

double stop(Cascade& cascade, const Node& node) {
    if (node.get(TimeSensor::isPaused)) cascade.emit(node, TimeSensor::isPaused, false);
    cascade.emit(node, TimeSensor::isActive, false);
    return node.get(TimeSensor::startTime).seconds > cascade.now() ? node.get(TimeSensor::startTime).seconds : kNever;
}

/// Runs an active sensor on to `until`. False: its last cycle is over, and its last events are sent.
bool goOn(Cascade& cascade, const Node& node, double until) {
    const double interval = node.get(TimeSensor::cycleInterval).seconds,
                 cycleStart = node.get(TimeSensor::_cycleStart).seconds;
    const double begun = node.get(TimeSensor::startTime).seconds + node.get(TimeSensor::_pausedTotal).seconds;
    const double active = activeBy<TimeSensor>(until, node);
    if (!node.get(TimeSensor::loop) && active >= cycleStart + interval) {
        cascade.emit(node, TimeSensor::fraction_changed, 1.0f);
        cascade.emit(node, TimeSensor::elapsedTime, Time{cycleStart + interval});
        cascade.emit(node, TimeSensor::time, Time{begun + cycleStart + interval});
        return false;
    }
    const double newest = std::floor(active / interval) * interval;
    if (newest > cycleStart) {
        cascade.store(node, TimeSensor::_cycleStart, Time{newest});
        cascade.emit(node, TimeSensor::cycleTime, Time{begun + newest});
    }
    sendProgress(cascade, node, active, interval, until);
    return true;
}

bool accepts(const Node& node, FieldIndex field, EventValue value) {
    if (node.get(TimeSensor::isActive) && field == TimeSensor::cycleInterval.index) return false;
    return acceptsTime<TimeSensor>(node, field, value);
}

bool hasInterval(const Node& node) {
    const double interval = node.get(TimeSensor::cycleInterval).seconds;
    return interval > 0 && std::isfinite(interval);
}

void onEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue) {
    heedTime<TimeSensor>(cascade, node, field, [&] {
        if (!node.get(TimeSensor::isPaused) && hasInterval(node)) goOn(cascade, node, cascade.now());
        stop(cascade, node);
    });
}

double onTime(Cascade& cascade, const Node& node) {
    const double now = cascade.now();
    const double startTime = node.get(TimeSensor::startTime).seconds, stopTime = node.get(TimeSensor::stopTime).seconds;
    const double interval = node.get(TimeSensor::cycleInterval).seconds;
    const bool enabled = node.get(TimeSensor::enabled), isActive = node.get(TimeSensor::isActive);
    if (!enabled && !isActive) return kNever;
    if (!hasInterval(node)) {
        cascade.warn(node, "cycleInterval must be greater than 0; the sensor stays inactive");
        return isActive ? stop(cascade, node) : kNever;
    }
    if (!isActive) {
        if (!(startTime <= now)) return startTime > now ? startTime : kNever;
        if (stopTime > startTime && now >= stopTime) return kNever;
        // A cycle shorter than a frame is still seen: it becomes active now and ends in the next frame.
        if (!node.get(TimeSensor::loop) && now - startTime >= interval && startTime <= cascade.previous())
            return kNever;
        if (cascade.hasSent(node, TimeSensor::isActive.index))
            return now;  // that it ended: it begins at the next timestamp
        return start(cascade, node);
    }
    const bool ends = stopTime > startTime && now >= stopTime;
    // 8.4.1: one that is disabled says where it has got to.
    const bool stopping = ends || !enabled;
    if (handlePause<TimeSensor>(cascade, node, stopping)) return stopping ? stop(cascade, node) : now;
    const bool runs = goOn(cascade, node, ends ? endOf<TimeSensor>(node) : now);
    return runs && !stopping ? now : stop(cascade, node);
}

}  // namespace

void appendTimeSensor(std::vector<BuiltinBehaviour>& table) {
    table.push_back({x3d::TimeSensor::type, {.accepts = accepts, .onEvent = onEvent, .onTime = onTime, .local = true}});
}

}  // namespace rtsg::behaviours
