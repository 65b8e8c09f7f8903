// Follows routes back from a field to what began it in that frame.
#include "cause.h"

#include <algorithm>
#include <unordered_set>

#include <fmt/format.h>

#include <rtsg/core/frame_input.h>
#include <rtsg/core/x3d.h>

#include "codec/node_label.h"

namespace rtsg {

namespace {

using Root = x3d::RtsgScene;

/// Which field of the scene's root hears what such nodes make events of (rtsg/core/device_input.h).
struct Device {
    std::string_view component;
    FieldIndex field;
};
const Device kDevices[] = {
    {"PointingDeviceSensor", Root::pointer.index},
    {"KeyDeviceSensor", Root::key.index},
    {"KeyDeviceSensor", Root::text.index},
    {"Picking", Root::picked.index},
    {"DIS", Root::heard.index},
    {"RigidBodyPhysics", Root::contact.index},
    {"EnvironmentalSensor", Root::navigate.index},
    {"EnvironmentalSensor", Root::headPose.index},
    {"EnvironmentalSensor", Root::wheel.index},
    {"Navigation", Root::navigate.index},
};

std::string_view deviceName(FieldIndex field) {
    if (field == Root::pointer.index) return "a pointer";
    if (field == Root::key.index || field == Root::text.index) return "a key";
    if (field == Root::picked.index) return "picking";
    if (field == Root::heard.index) return "DIS";
    return field == Root::contact.index ? "a contact" : "the viewer";
}

/// TimeSensor, followers and media: what they send follows from what came into them earlier.
bool actsOverTime(const NodeType& type) {
    return type.find("isActive") != kNoField;
}

}  // namespace

void FrameTouches::add(const ChangeSet& set) {
    for (const Change& c : set.changes)
        if (c.kind == ChangeKind::setField || c.kind == ChangeKind::insertChild || c.kind == ChangeKind::removeChild ||
            c.kind == ChangeKind::event || c.kind == ChangeKind::createNode)
            places_[key(c.node, c.field)] |= c.external;
    if (set.input)  // of a log that has nothing else
        for (const Change& c : set.input->events) places_[key(c.node, c.field)] = true;
    if (!set.authors) return;
    authors_.insert(authors_.end(), set.authors->begin(), set.authors->end());
    for (const Authored& one : *set.authors)
        if (one.field != kNoField) places_[key(one.node, one.field)] = true;
}

bool FrameTouches::isMade(NodeId node) const {
    const auto found = places_.find(key(node, kNoField));
    return found != places_.end() && found->second;
}

/// Of the field, or else of any of the node's: what came in by one field may show in another. Who made the node made
/// all of its fields; who did something else with the node itself, its name say, none.
std::string FrameTouches::authorOf(NodeId node, FieldIndex field) const {
    std::string ofNode, ofOther;
    for (const Authored& one : authors_) {
        if (one.node != node) continue;
        if (one.field == field) return one.author.str();
        (one.field == kNoField ? ofNode : ofOther) = one.author.str();
    }
    if (!isMade(node) || ofNode.empty()) return ofOther;
    const auto found = places_.find(key(node, field));
    const bool followed = found != places_.end() && !found->second;
    return followed && !ofOther.empty() ? ofOther : ofNode;
}

/// One step back, to a field that changed as well and that is none of the way so far. `anyField`: of what came into the
/// node, whatever its field. ROUTEs before ISs, by which an instance's field has also what its inside only gives back.
std::string FrameTouches::routeInto(const Scene& scene, NodeId& node, FieldIndex& field, bool anyField,
                                    std::vector<std::uint64_t>& way) const {
    std::vector<Route> routes = scene.routesTo(node);
    std::ranges::stable_partition(routes, [](const Route& r) { return !r.isConnection; });
    for (const Route& r : routes) {
        if (!anyField && r.toField != field) continue;
        if (!has(r.fromNode, r.fromField)) continue;
        if (std::ranges::find(way, key(r.fromNode, r.fromField)) != way.end()) continue;
        way.push_back(key(r.fromNode, r.fromField));
        const auto name = [&](NodeId id, FieldIndex index) {
            return fmt::format("{}.{}", nodeLabel(scene, id), scene.node(id).type().fields[index].name);
        };
        std::string text = fmt::format("{} > {}", name(r.fromNode, r.fromField), name(r.toNode, r.toField));
        node = r.fromNode;
        field = r.fromField;
        return text;
    }
    return {};
}

bool FrameTouches::anyFromOutside(const Scene& scene, NodeId node) const {
    for (FieldIndex i = 0; i < scene.node(node).type().fields.size(); ++i)
        if (const auto found = places_.find(key(node, i)); found != places_.end() && found->second) return true;
    return false;
}

FrameTouches::Cause FrameTouches::cause(const Scene& scene, NodeId node, FieldIndex field) const {
    const bool made = isMade(node);
    constexpr int kLongest = 16;  // steps back
    std::vector<std::uint64_t> way{key(node, field)};
    std::string text;
    bool outside = false;
    for (int step = 0; step < kLongest; ++step) {
        const auto found = places_.find(key(node, field));
        outside = found != places_.end() && found->second;
        if (outside || !scene.find(node)) break;
        // Into the very field, or, of what a node has sent, through what it made that of.
        const NodeType& type = scene.node(node).type();
        const FieldDef& def = type.fields[field];
        std::string route = routeInto(scene, node, field, step > 0 || !def.writable(), way);
        // Some write to their own fields what came in by others, as BooleanToggle does; of the rest nothing is guessed.
        if (route.empty() && step == 0 && (type.writesInputs || type.kind == NodeType::Kind::script))
            route = routeInto(scene, node, field, true, way);
        if (route.empty()) {
            // A node that was made has all of its fields from there, those with their defaults too.
            outside = step > 0 ? anyFromOutside(scene, node) : made && found == places_.end();
            break;
        }
        text = text.empty() ? route : fmt::format("{}, {}", route, text);
    }
    const auto then = [&](std::string_view begun) {
        return text.empty() ? std::string(begun) : fmt::format("{}, then ROUTE {}", begun, text);
    };
    if (!outside && scene.find(node)) {
        if (const FieldIndex device = deviceFor(scene, scene.node(node).type()); device != kNoField)
            return {then(fmt::format("from {}", deviceName(device))), authorOf(scene.root(), device), false, true};
        if (const auto start = starts_.find(node.value); start != starts_.end())
            return {then(fmt::format("{} in state {}", start->second.text, start->second.state)), start->second.author,
                    false, true};
    }
    if (outside) return {then(kSetFromOutside), authorOf(node, field), made && text.empty(), true};
    return {text.empty() ? text : fmt::format("ROUTE {}", text), {}, false, false};
}

/// The field of the root by which something came in that such a node makes events of by itself; kNoField: none did.
FieldIndex FrameTouches::deviceFor(const Scene& scene, const NodeType& type) const {
    const bool isPointed = type.find("isOver") != kNoField;  // GeoTouchSensor is of another component
    for (const Device& device : kDevices)
        if ((device.component == type.component || (isPointed && device.field == Root::pointer.index)) &&
            has(scene.root(), device.field))
            return device.field;
    return kNoField;
}

void FrameTouches::rememberStarts(const Scene& scene, NodeId node) {
    std::unordered_set<std::uint32_t> seen{node.value};
    std::vector<NodeId> upstream{node};
    for (std::size_t i = 0; i < upstream.size(); ++i) {
        const NodeId id = upstream[i];
        for (const Route& r : scene.routesTo(id))
            if (seen.insert(r.fromNode.value).second) upstream.push_back(r.fromNode);
        const NodeType& type = scene.node(id).type();
        if (!actsOverTime(type)) continue;
        for (FieldIndex f = 0; f < type.fields.size(); ++f) {
            if (!type.fields[f].writable() || !has(id, f)) continue;
            Cause cause = this->cause(scene, id, f);
            if (!cause.fromOutside) continue;
            starts_[id.value] = {scene.sequence(), std::move(cause.text), std::move(cause.author)};
            break;
        }
    }
}

}  // namespace rtsg
