// Pick sensors (ISO/IEC 19775-1 V4.0, clause 38): sends their outputs. The picked shapes were found when the frame
// began (input/pick_sensors.cpp), and come as an event of the root.
#include <algorithm>

#include <rtsg/core/x3d.h>

#include "behaviour/behaviours.h"
#include "behaviour/words.h"
#include "input/pick_report.h"

namespace rtsg::behaviours {

namespace {

template <class N>
void sendPick(Cascade& cascade, const Node& node, const PickReport& report) {
    const bool active = !report.geometry.empty(), entered = active && !node.get(N::isActive);
    if (active && !node.get(N::enabled)) return;
    if (active != node.get(N::isActive)) cascade.emit(node, N::isActive, active);
    sendIfNew(cascade, node, N::pickedGeometry, Array<NodeId>(std::span<const NodeId>(report.geometry)), entered);
    const auto column = [&](Vec3f PickedSurface::* member) {
        Array<Vec3f> values;
        for (const PickedSurface& surface : report.surfaces) values.push_back(surface.*member);
        return values;
    };
    if constexpr (requires { N::pickedPoint; })
        sendIfNew(cascade, node, N::pickedPoint, column(&PickedSurface::point), entered);
    if constexpr (requires { N::pickedNormal; }) {
        sendIfNew(cascade, node, N::pickedNormal, column(&PickedSurface::normal), entered);
        sendIfNew(cascade, node, N::pickedTextureCoordinate, column(&PickedSurface::texCoord), entered);
    }
}

template <class... N>
void sendAny(Cascade& cascade, const Node& node, const PickReport& report) {
    (void)((node.is(N::type) && (sendPick<N>(cascade, node, report), true)) || ...);
}

/// A sensor that has been switched off is no longer active.
template <class N>
double pickSensorOnTime(Cascade& cascade, const Node& node) {
    warnOfWords(cascade, node, "sortOrder", {node.get(N::sortOrder)}, {"CLOSEST", "ANY", "ALL", "ALL_SORTED"});
    warnOfWords(cascade, node, "intersectionType", {node.get(N::intersectionType)}, {"BOUNDS", "GEOMETRY"});
    if (!node.get(N::enabled) && node.get(N::isActive)) cascade.emit(node, N::isActive, false);
    return kNever;
}

}  // namespace

void pickedOnEvent(Cascade& cascade, const Node& root, EventValue value) {
    const auto report = PickReport::fromValue(value.as<Array<double>>());
    if (!report) return cascade.warn(root, report.error().text);
    const Node* sensor = cascade.scene().find(report->sensor);
    const auto exists = [&](NodeId id) { return cascade.scene().find(id) != nullptr; };
    if (!sensor || !std::ranges::all_of(report->geometry, exists)) return;
    sendAny<x3d::LinePickSensor, x3d::PointPickSensor, x3d::PrimitivePickSensor, x3d::VolumePickSensor>(
        cascade, *sensor, *report);
}

void appendPickSensors(std::vector<BuiltinBehaviour>& table) {
    table.push_back({x3d::LinePickSensor::type, {.onTime = pickSensorOnTime<x3d::LinePickSensor>}});
    table.push_back({x3d::PointPickSensor::type, {.onTime = pickSensorOnTime<x3d::PointPickSensor>}});
    table.push_back({x3d::PrimitivePickSensor::type, {.onTime = pickSensorOnTime<x3d::PrimitivePickSensor>}});
    table.push_back({x3d::VolumePickSensor::type, {.onTime = pickSensorOnTime<x3d::VolumePickSensor>}});
}

}  // namespace rtsg::behaviours
