// The clock of all X3DTimeDependentNodes: ISO/IEC 19775-1 V4.0, 8.2.4. S: a type with the fields of one, and
// _pausedTotal.
#pragma once

#include <algorithm>

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

/// The time until which a node ran that is to stop now: its stopTime, or a pause before that, in which no frame fell.
template <class S>
double endOf(const Node& node) {
    const double stop = node.get(S::stopTime).seconds;
    return !node.get(S::isPaused) && pausesBy<S>(stop, node) ? node.get(S::pauseTime).seconds : stop;
}

/// The time that an active node has run by `time`, without its pauses.
template <class S>
double activeBy(double time, const Node& node) {
    return std::max(0.0, time - node.get(S::startTime).seconds - node.get(S::_pausedTotal).seconds);
}

/// Pauses the node from `at` on, but not before the time that has already been sent.
template <class S>
void pauseAt(Cascade& cascade, const Node& node, double at) {
    cascade.emit(node, S::isPaused, true);
    cascade.emit(node, S::elapsedTime, Time{std::max(activeBy<S>(at, node), node.get(S::elapsedTime).seconds)});
}
/// It continues from where it was, whatever has become of pauseTime since.
template <class S>
void resumeAt(Cascade& cascade, const Node& node, double at) {
    cascade.store(node, S::_pausedTotal, Time{at - node.get(S::startTime).seconds - node.get(S::elapsedTime).seconds});
    cascade.emit(node, S::isPaused, false);
}

/// True while paused. Keeps _pausedTotal, so that the fraction goes on where it was; says at both edges which time it
/// was (8.2.4.4). `stopping`: it ends now, so that a pause that would begin is none.
template <class S>
bool handlePause(Cascade& cascade, const Node& node, bool stopping) {
    const double now = cascade.now();
    const double pause = node.get(S::pauseTime).seconds, resume = node.get(S::resumeTime).seconds;
    if (!node.get(S::isPaused)) {
        if (stopping || !pausesBy<S>(now, node)) return false;
        pauseAt<S>(cascade, node, pause);
        cascade.emit(node, S::pauseTime, Time{pause});
        return true;
    }
    if (resume <= pause || resume > now) return true;
    resumeAt<S>(cascade, node, resume);
    cascade.emit(node, S::resumeTime, Time{resume});
    return false;
}

/// Handles events whose times have passed: the node does now what it would have done then (8.4.1). This happens at
/// once, so that a set_startTime after a set_stopTime with the same timestamp restarts it (8.2.4.3). `finish` sends the
/// remaining events at the end.
template <class S, class Finish>
void heedTime(Cascade& cascade, const Node& node, FieldIndex field, const Finish& finish) {
    if (!node.get(S::isActive)) return;
    const double now = cascade.now();
    const bool isPaused = node.get(S::isPaused);
    if (field == S::stopTime.index) {
        const double stop = node.get(S::stopTime).seconds;
        if (stop > node.get(S::startTime).seconds && stop <= now) finish();
    } else if (field == S::pauseTime.index) {
        if (!isPaused && pausesBy<S>(now, node)) pauseAt<S>(cascade, node, now);
    } else if (field == S::resumeTime.index) {
        const double resume = node.get(S::resumeTime).seconds;
        if (isPaused && resume > node.get(S::pauseTime).seconds && resume <= now) resumeAt<S>(cascade, node, now);
    }
}

}  // namespace rtsg::behaviours
