// Follows a replica except for the fields that its user has edited, and settles those when the answers come.
#include <rtsg/sync/optimistic_scene.h>

#include <algorithm>

#include <fmt/format.h>

namespace rtsg {

OptimisticScene::OptimisticScene(MirrorClient& client, Scene& replica) : client_(client), replica_(replica) {
    shown_.setBehavioursEnabled(false);
    attachment_ = replica_.bus().attach(*this, Delivery::immediate);
}
OptimisticScene::~OptimisticScene() = default;

/// Applies the set as the next state of the scene shown, whose hash is its own.
Result<> OptimisticScene::show(ChangeSet set) {
    set.from = shown_.sequence();
    set.to = set.from + 1;
    set.time = std::max(shown_.now(), replica_.now());
    set.hash = {};
    return shown_.apply(std::make_shared<const ChangeSet>(std::move(set)));
}

Result<> OptimisticScene::startOver(const ChangeSet& snapshot) {
    if (shown_.sequence() > 0)
        if (auto ok = shown_.reset(); !ok) return ok;
    shown_.setBehavioursEnabled(false);
    if (auto ok = shown_.apply(std::make_shared<const ChangeSet>(snapshot)); !ok) return ok;
    ChangeSet ours;
    std::erase_if(ours_, [&](const auto& entry) {
        const Node* node = shown_.find(NodeId{entry.first.first});
        const FieldIndex field = entry.first.second;
        return !node || field >= node->type().fields.size() || !node->type().fields[field].holds(entry.second.value);
    });
    for (const auto& [key, mine] : ours_) {
        Change& change = ours.changes.emplace_back();
        change.node = NodeId{key.first};
        change.field = key.second;
        change.value = mine.value;
    }
    return ours.changes.empty() ? Result<>{} : show(std::move(ours));
}

Result<> OptimisticScene::apply(const Scene&, const ChangeSet& changes) {
    if (changes.isSnapshot()) return startOver(changes);
    ChangeSet rest = changes;
    rest.input.reset();
    if (!ours_.empty())
        std::erase_if(rest.changes, [&](const Change& c) {
            if (c.kind == ChangeKind::destroyNode)
                std::erase_if(ours_, [&](const auto& entry) { return entry.first.first == c.node.value; });
            return c.kind == ChangeKind::setField && ours_.contains({c.node.value, c.field});
        });
    return show(std::move(rest));
}

Result<std::uint64_t> OptimisticScene::edit(NodeId id, FieldIndex field, Value value) {
    const Node* node = shown_.find(id);
    if (!node) return fail(fmt::format("no node {}", id.value));
    if (field >= node->type().fields.size()) return fail(fmt::format("{} has no field {}", node->type().name, field));
    const FieldDef& def = node->type().fields[field];
    if (!def.holds(value) || !def.readable() || def.hidden)
        return fail(fmt::format("{}.{} cannot be set to that", node->type().name, def.name));
    if (sf(def.type) == FieldType::SFNode)
        return fail(fmt::format("{}.{} refers to nodes: ask the origin", node->type().name, def.name));
    auto request = client_.submitEdit(id, field, value);
    if (!request) return request;
    ours_[{id.value, field}] = {*request, value};
    ChangeSet set;
    Change& change = set.changes.emplace_back();
    change.node = id;
    change.field = field;
    change.value = std::move(value);
    if (auto ok = show(std::move(set)); !ok) return std::unexpected(ok.error());
    return request;
}

/// From now on the origin's value counts.
void OptimisticScene::settle(const FieldKey& field) {
    const Node *there = replica_.find(NodeId{field.first}), *here = shown_.find(NodeId{field.first});
    if (!there || !here || there->value(field.second) == here->value(field.second)) return;
    ChangeSet set;
    Change& change = set.changes.emplace_back();
    change.node = NodeId{field.first};
    change.field = field.second;
    change.value = there->value(field.second);
    if (auto ok = show(std::move(set)); !ok) shown_.diagnostics().error({}, "what was asked for: " + ok.error().text);
}

std::size_t OptimisticScene::poll(std::chrono::milliseconds timeout) {
    const std::size_t applied = client_.poll(timeout);
    std::vector<MirrorVerdict> verdicts = client_.takeVerdicts();
    // If the origin is another run, requests end without an answer.
    const bool noneLeft = client_.unanswered() == 0;
    std::vector<FieldKey> answered;
    for (const auto& [field, mine] : ours_)
        if (noneLeft || std::ranges::find(verdicts, mine.request, &MirrorVerdict::request) != verdicts.end())
            answered.push_back(field);
    for (const FieldKey& field : answered) {
        ours_.erase(field);
        settle(field);
    }
    std::ranges::move(verdicts, std::back_inserter(verdicts_));
    return applied;
}

std::vector<MirrorVerdict> OptimisticScene::takeVerdicts() {
    return std::exchange(verdicts_, {});
}

}  // namespace rtsg
