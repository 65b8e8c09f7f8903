// Runs recorded input in a scene.
#include "replay_input.h"

#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/frame_input.h>

#include "codec/node_label.h"

namespace rtsg {

Result<NodeId> InputPlayer::here(NodeId node) const {
    if (!recorded_ || !node || node == live_.root()) return node;
    if (const auto found = created_.find(node.value); found != created_.end() && live_.find(found->second))
        return found->second;
    const std::string_view name = recorded_->name(node);
    if (!name.empty()) {
        NodeId scope;
        if (const Node* n = recorded_->find(node); n && n->scope()) {
            const Result<NodeId> outer = here(n->scope());
            if (!outer) return outer;
            scope = *outer;
        }
        if (const NodeId found = live_.findName(name, scope)) return found;
        return fail(fmt::format("there is no {} any more", name));
    }
    const Node *then = recorded_->find(node), *now = live_.find(node);
    if (then && now && then->type().name == now->type().name) return node;
    return fail(fmt::format("node #{} has no name to find it by, and its number is another node's now", node.value));
}

Result<InputPlayer::NodeField> InputPlayer::here(NodeId node, FieldIndex field) const {
    const Result<NodeId> found = here(node);
    if (!found) return std::unexpected(found.error());
    if (!recorded_) return NodeField{*found, field};
    const Node *then = recorded_->find(node), *now = live_.find(*found);
    if (!then || !now || field >= then->type().fields.size()) return NodeField{*found, field};
    const FieldDef& def = then->type().fields[field];
    const FieldIndex index = now->type().findExact(def.name);
    if (index != kNoField && haveOneType(now->type().fields[index], def)) return NodeField{*found, index};
    return fail(fmt::format("it has no {} any more", def.name));
}

Result<Value> InputPlayer::here(Value value) const {
    if (!recorded_ || sf(value.type()) != FieldType::SFNode) return value;
    if (value.type() == FieldType::SFNode) {
        const Result<NodeId> found = here(value.as<NodeId>());
        if (!found) return std::unexpected(found.error());
        return Value(*found);
    }
    Array<NodeId> nodes;
    for (const NodeId node : value.as<Array<NodeId>>()) {
        const Result<NodeId> found = here(node);
        if (!found) return std::unexpected(found.error());
        nodes.push_back(*found);
    }
    return Value(std::move(nodes));
}

Result<> InputPlayer::create(const Change& change) {
    TypeIndex type{static_cast<std::uint16_t>(change.index)};
    if (recorded_) {
        const auto found = live_.findType(recorded_->type(type).name);
        if (!found) return fail(fmt::format("there is no type {} any more", recorded_->type(type).name));
        type = *found;
    } else if (change.index >= live_.typeCount()) {
        return fail(fmt::format("no node type {} here", change.index));
    }
    const Result<NodeId> scope = here(change.other);
    if (!scope) return std::unexpected(scope.error());
    const NodeId created = live_.createNode(type, *scope);
    if (recorded_) {
        created_[change.node.value] = created;
        return {};
    }
    if (created == change.node) return {};
    return fail(
        fmt::format("a {} that was #{} would be #{} here", live_.type(type).name, change.node.value, created.value));
}

Result<> InputPlayer::edit(const ChangeSet& set, const Change& c) {
    if (c.kind == ChangeKind::defineType) {
        for (const DefinedType& type : set.types)
            if (type.index.value == c.index && !(recorded_ && live_.findType(type.type->name)))
                if (auto ok = live_.defineType(type.type); !ok) return std::unexpected(ok.error());
        return {};
    }
    if (c.kind == ChangeKind::createNode) return create(c);
    if (c.kind == ChangeKind::destroyNode && !recorded_ && !live_.find(c.node)) return {};
    const auto target = here(c.node, c.field);
    if (!target) return std::unexpected(target.error());
    const auto [node, field] = *target;
    const auto value = here(c.value);
    if (!value) return std::unexpected(value.error());
    switch (c.kind) {
        case ChangeKind::setField:
            // An event that is sent again, or something that runs here, writes this field, too.
            if (std::ranges::binary_search(sent_, std::pair(c.node, c.field)) || isOutput(node, field)) return {};
            return live_.setField(node, field, *value);
        case ChangeKind::setName:
            return live_.setName(node, c.value.as<String>().str());
        case ChangeKind::destroyNode:
            return live_.destroyNode(node);
        case ChangeKind::event:
            return live_.sendEvent(node, field, *value);
        case ChangeKind::removeChild:
            return live_.removeChild(node, field, c.index);
        case ChangeKind::insertChild: {
            const Result<NodeId> child = here(c.other);
            if (!child) return std::unexpected(child.error());
            return live_.insertChild(node, field, *child, c.index);
        }
        case ChangeKind::addRoute:
        case ChangeKind::removeRoute: {
            const auto to = here(c.other, c.field2());
            if (!to) return std::unexpected(to.error());
            if (c.kind == ChangeKind::removeRoute) return live_.removeRoute(node, field, to->node, to->field);
            return c.isConnection ? live_.addIsConnection(node, field, to->node, to->field)
                                  : live_.addRoute(node, field, to->node, to->field);
        }
        default:
            return {};
    }
}

bool InputPlayer::isOutput(NodeId id, FieldIndex field) const {
    const Node* node = live_.find(id);
    return node && field < node->type().fields.size() && node->type().fields[field].access == Access::outputOnly;
}

std::string InputPlayer::describe(const Change& change) const {
    const Scene& scene = recorded_ ? *recorded_ : live_;
    const Node* node = scene.find(change.node);
    std::string text = nodeLabel(scene, change.node);
    if (node && change.field < node->type().fields.size()) text += "." + node->type().fields[change.field].name;
    return text;
}

void InputPlayer::begin() {
    if (recorded_) recorded_->forEachNode([this](const Node& node) { pair(node.id()); });
}

void InputPlayer::pair(NodeId node) {
    if (recorded_->name(node).empty()) return;
    if (const Result<NodeId> found = here(node)) created_[node.value] = *found;
}

Result<> InputPlayer::run(const ChangeSet& set) {
    sent_.clear();
    for (const Change& change : set.changes)
        if (change.kind == ChangeKind::event) sent_.emplace_back(change.node, change.field);
    std::ranges::sort(sent_);
    // The input from the log, if it has it. If not, the changes show it as far as the cascade has left it there.
    std::vector<Change> noted;
    const bool exact = set.input && set.input->complete;
    bool ran = exact ? set.input->ran : set.changes.empty() || set.time != live_.now();
    if (exact) {
        sent_.clear();
        noted = set.input->edits;
        noted.insert(noted.end(), set.input->events.begin(), set.input->events.end());
    }
    for (const Change& change : exact ? noted : set.changes) {
        // Edits that were sealed between two frames did not run the cascade.
        ran |= !exact && (!change.external || change.kind == ChangeKind::event);
        if (!change.external || (which_ == ReplayInput::eventsOnly && change.kind != ChangeKind::event)) continue;
        if (auto ok = edit(set, change); !ok)
            return fail(fmt::format("recorded input of {} is refused: {}", describe(change), ok.error().text));
    }
    if (const auto& authors = exact ? set.input->authors : set.authors)
        for (const Authored& one : *authors)
            if (const auto field = here(one.node, one.field)) live_.attribute(one.author, field->node, field->field);
    if (ran)
        live_.newFrame(set.time);
    else
        live_.seal();
    if (recorded_)
        for (const Change& change : set.changes)
            if (change.kind == ChangeKind::setName && recorded_->find(change.node)) pair(change.node);
    return {};
}

}  // namespace rtsg
