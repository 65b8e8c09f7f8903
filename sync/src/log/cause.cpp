// Follows routes back from a field to what began it in that frame.
#include "cause.h"

#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/frame_input.h>

#include "codec/node_label.h"

namespace rtsg {

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
    if (outside)
        return {text.empty() ? std::string(kSetFromOutside) : fmt::format("{}, then ROUTE {}", kSetFromOutside, text),
                authorOf(node, field), made && text.empty()};
    return {text.empty() ? text : fmt::format("ROUTE {}", text), {}, false};
}

}  // namespace rtsg
