// Finds the humanoids that an HAnimMotion or HAnimPose is in, and their joints. ISO/IEC 19775-1 V4.0, 26.3.2.
#pragma once

#include <functional>
#include <string_view>
#include <unordered_map>

#include <rtsg/core/behaviour.h>

namespace rtsg::behaviours {

/// Calls with each HAnimHumanoid that holds `node` in `field`, itself or behind the interface of a PROTO.
void forEachHumanoidOf(const Scene& scene, const Node& node, FieldIndex field,
                       const std::function<void(const Node&)>& visit);
/// The humanoid's `joints` by their names, those without one left out; of two of one name the first. Valid until one of
/// them is written.
std::unordered_map<std::string_view, const Node*> jointsByName(const Scene& scene, const Node& humanoid);
/// Sends the value to the joint, unless it has it already. A value that the joint does not accept is reported as the
/// asker's fault.
template <class T>
void setJoint(Cascade& cascade, const Node& asker, const Node& joint, Field<T> field, const T& value) {
    if (joint.get(field) == value) return;
    if (const auto ok = cascade.deliver(joint.id(), field.index, Value(value)); !ok)
        cascade.warn(asker, ok.error().text);
}

}  // namespace rtsg::behaviours
