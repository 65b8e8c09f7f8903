// Follows routes back from a field to the change that set it off in the same frame.
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

/// The field of the scene's root that gets the device input of such nodes (rtsg/core/device_input.h).
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

/// True for TimeSensor, followers and media: what they send follows from what they received earlier.
bool actsOverTime(const NodeType& type) {
    return type.find("isActive") != kNoField;
}

}  // namespace

void FrameTouches::add(const ChangeSet& set) {
    for (const Change& c : set.changes)
        if (c.kind == ChangeKind::setField || c.kind == ChangeKind::insertChild || c.kind == ChangeKind::removeChild ||
            c.kind == ChangeKind::event || c.kind == ChangeKind::createNode)
            fields_[key(c.node, c.field)] |= c.external;
    if (set.input)  // for a log in input mode, which has nothing else
        for (const Change& c : set.input->events) fields_[key(c.node, c.field)] = true;
    if (!set.authors) return;
    authors_.insert(authors_.end(), set.authors->begin(), set.authors->end());
    for (const Authored& one : *set.authors)
        if (one.field != kNoField) fields_[key(one.node, one.field)] = true;
}

bool FrameTouches::isCreated(NodeId node) const {
    const auto found = fields_.find(key(node, kNoField));
    return found != fields_.end() && found->second;
}

/// Prefers the author of the field, then that of another field of the node, since input by one field may show in
/// another. The author who made the node counts for all of its fields; one who did something else with the node, such
/// as naming it, for none.
std::string FrameTouches::authorOf(NodeId node, FieldIndex field) const {
    std::string ofNode, ofOther;
    for (const Authored& one : authors_) {
        if (one.node != node) continue;
        if (one.field == field) return one.author.str();
        (one.field == kNoField ? ofNode : ofOther) = one.author.str();
    }
    if (!isCreated(node) || ofNode.empty()) return ofOther;
    const auto found = fields_.find(key(node, field));
    const bool followed = found != fields_.end() && !found->second;
    return followed && !ofOther.empty() ? ofOther : ofNode;
}

/// Goes one step back, to a changed field that is not yet on the way. With `anyField` it may have come into any field
/// of the node. ROUTEs go before IS connections, by which a field of a PROTO instance also gets back values of its own
/// body.
std::string FrameTouches::routeInto(const Scene& scene, NodeId& node, FieldIndex& field, bool anyField,
                                    std::vector<std::uint64_t>& path) const {
    std::vector<Route> routes = scene.routesTo(node);
    std::ranges::stable_partition(routes, [](const Route& r) { return !r.isConnection; });
    for (const Route& r : routes) {
        if (!anyField && r.toField != field) continue;
        if (!has(r.fromNode, r.fromField)) continue;
        if (std::ranges::find(path, key(r.fromNode, r.fromField)) != path.end()) continue;
        path.push_back(key(r.fromNode, r.fromField));
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
        if (const auto found = fields_.find(key(node, i)); found != fields_.end() && found->second) return true;
    return false;
}

FrameTouches::Cause FrameTouches::cause(const Scene& scene, NodeId node, FieldIndex field) const {
    const bool created = isCreated(node);
    constexpr int kLongest = 16;  // most steps back
    std::vector<std::uint64_t> path{key(node, field)};
    std::string text;
    bool outside = false;
    for (int step = 0; step < kLongest; ++step) {
        const auto found = fields_.find(key(node, field));
        outside = found != fields_.end() && found->second;
        if (outside || !scene.find(node)) break;
        // The first step needs a route to the field itself. Where a node has sent the value, a route to any of its
        // fields will do.
        const NodeType& type = scene.node(node).type();
        const FieldDef& def = type.fields[field];
        std::string route = routeInto(scene, node, field, step > 0 || !def.writable(), path);
        // Nodes like BooleanToggle write to their own fields what came in by others. For other nodes nothing is
        // guessed.
        if (route.empty() && step == 0 && (type.writesInputs || type.kind == NodeType::Kind::script))
            route = routeInto(scene, node, field, true, path);
        if (route.empty()) {
            // All fields of a new node come from its creation, defaults included.
            outside = step > 0 ? anyFromOutside(scene, node) : created && found == fields_.end();
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
    if (outside) return {then(kSetFromOutside), authorOf(node, field), created && text.empty(), true};
    return {text.empty() ? text : fmt::format("ROUTE {}", text), {}, false, false};
}

/// The root's field for the device input from which such a node makes events, if it changed. Else kNoField.
FieldIndex FrameTouches::deviceFor(const Scene& scene, const NodeType& type) const {
    const bool isPointed = type.find("isOver") != kNoField;  // also true for GeoTouchSensor, of another component
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
