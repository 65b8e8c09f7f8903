// What all X3DTimeDependentNodes have in common: ISO/IEC 19775-1 V4.0, 8.2.4. S: a type with the fields of one, and
// _pausedTotal.
#pragma once

#include "behaviours.h"

namespace rtsg::behaviours {

/// 8.2.4.3: startTime, and a stopTime that is not after it, are ignored while the node is active.
template <class S>
bool acceptsTime(const Node& node, FieldIndex field, EventValue value) {
    if (!node.get(S::isActive)) return true;
    if (field == S::startTime.index) return false;
    return field != S::stopTime.index || value.as<Time>().seconds > node.get(S::startTime).seconds;
}

/// Whether one that runs is to pause by `now`.
template <class S>
bool pausesBy(double now, const Node& node) {
    const double pause = node.get(S::pauseTime).seconds;
    return pause > node.get(S::resumeTime).seconds && pause <= now && pause >= node.get(S::startTime).seconds;
}

/// Until when one ran that is to stop now: its stopTime, or the pause before it that nobody has seen.
template <class S>
double endOf(const Node& node) {
    const double stop = node.get(S::stopTime).seconds;
    return !node.get(S::isPaused) && pausesBy<S>(stop, node) ? node.get(S::pauseTime).seconds : stop;
}

/// True while paused. Keeps _pausedTotal, so that the fraction goes on where it was; says at both edges which time it
/// was (8.2.4.4). `stopping`: it ends now, so that a pause that would begin is none.
template <class S>
bool handlePause(Cascade& cascade, const Node& node, bool stopping) {
    const double now = cascade.now();
    const double pause = node.get(S::pauseTime).seconds, resume = node.get(S::resumeTime).seconds;
    if (!node.get(S::isPaused)) {
        if (stopping || !pausesBy<S>(now, node)) return false;
        cascade.emit(node, S::isPaused, true);
        cascade.emit(node, S::pauseTime, Time{pause});
        const double active = pause - node.get(S::startTime).seconds - node.get(S::_pausedTotal).seconds;
        cascade.emit(node, S::elapsedTime, Time{active});
        return true;
    }
    if (resume <= pause || resume > now) return true;
    cascade.store(node, S::_pausedTotal, Time{node.get(S::_pausedTotal).seconds + resume - pause});
    cascade.emit(node, S::isPaused, false);
    cascade.emit(node, S::resumeTime, Time{resume});
    return false;
}

}  // namespace rtsg::behaviours
