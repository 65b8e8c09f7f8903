// The built-in behaviours, one function a job; gathered into the table by behaviours.cpp.
#pragma once

#include <rtsg/core/behaviour.h>

namespace rtsg::behaviours {

void appendTimeSensor(std::vector<BuiltinBehaviour>& table);
void appendInterpolators(std::vector<BuiltinBehaviour>& table);
void appendFollowers(std::vector<BuiltinBehaviour>& table);
void appendSplines(std::vector<BuiltinBehaviour>& table);
void appendNurbs(std::vector<BuiltinBehaviour>& table);
void appendEnvironmentalSensors(std::vector<BuiltinBehaviour>& table);
void appendTriggers(std::vector<BuiltinBehaviour>& table);
void appendBindables(std::vector<BuiltinBehaviour>& table);
void appendPointing(std::vector<BuiltinBehaviour>& table);
void appendKeys(std::vector<BuiltinBehaviour>& table);
void appendLoadSensor(std::vector<BuiltinBehaviour>& table);
void appendPickSensors(std::vector<BuiltinBehaviour>& table);
void appendMeasures(std::vector<BuiltinBehaviour>& table);
void appendMedia(std::vector<BuiltinBehaviour>& table);
void appendParticles(std::vector<BuiltinBehaviour>& table);
void appendMotions(std::vector<BuiltinBehaviour>& table);
void appendPoses(std::vector<BuiltinBehaviour>& table);
void appendGeoLod(std::vector<BuiltinBehaviour>& table);
void appendDis(std::vector<BuiltinBehaviour>& table);

template <class T>
void sendIfNew(Cascade& cascade, const Node& node, Field<T> field, const T& value, bool always) {
    if (always || node.get(field) != value) cascade.emit(node, field, value);
}

double lodOnTime(Cascade& cascade, const Node& node);
/// The root is woken when a node has lost a parent.
double rootOnTime(Cascade& cascade, const Node& node);

/// Devices' events come to the root.
void rootOnEvent(Cascade& cascade, const Node& root, FieldIndex field, EventValue value);
void pickedOnEvent(Cascade& cascade, const Node& root, EventValue value);
void viewerOnEvent(Cascade& cascade, const Node& root, EventValue value);
void heardOnEvent(Cascade& cascade, const Node& root, EventValue value);
void keysOnEvent(Cascade& cascade, const Node& root, FieldIndex field, EventValue value);

}  // namespace rtsg::behaviours
