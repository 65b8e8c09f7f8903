// Finds out which files can be loaded, and writes this into the LoadSensors that wait for it.
#include "load_reports.h"

#include <algorithm>

#include <rtsg/core/web_address.h>
#include <rtsg/core/x3d.h>

#include "fetch_ahead.h"

namespace rtsg {

namespace {

using S = x3d::LoadSensor;

constexpr std::int32_t kAwaited = -1;

/// 1: loaded, 0: it cannot be, kAwaited: that is not known yet; nothing: it is not to be.
std::optional<std::int32_t> outcomeOf(const Scene& scene, const Node& node, const Resources& resources) {
    const NodeType& type = node.type();
    const FieldIndex url = type.findExact("url"), load = type.findExact("load");
    if (url == kNoField || type.fields[url].type != FieldType::MFString) return std::nullopt;
    const auto& urls = node.get(Field<Array<String>>{url});
    if (urls.empty()) return std::nullopt;
    if (load != kNoField && type.fields[load].type == FieldType::SFBool && !node.get(Field<bool>{load}))
        return std::nullopt;
    if (awaitsUrls(scene, node, url, resources)) return kAwaited;
    if (node.is(x3d::Inline::type)) return node.get(x3d::Inline::body).empty() ? 0 : 1;
    if (node.is(x3d::InlineGeometry::type)) return node.get(x3d::InlineGeometry::body).empty() ? 0 : 1;
    if (node.is(x3d::FontLibrary::type)) return node.get(x3d::FontLibrary::_font).empty() ? 0 : 1;
    // A viewpoint that an Anchor leads to is in this document.
    const bool any = std::ranges::any_of(urls, [&](const String& one) {
        return programInUrl(one.view()) || one.view().starts_with('#') ||
               resources.open(scene, node, url, one.view()).has_value();
    });
    return any ? 1 : 0;
}

}  // namespace

LoadReports::LoadReports(const Scene& scene) {
    scene.forEachNode([&](const Node& node) {
        if (node.is(S::type) && node.get(S::isActive)) asked_.insert(node.id().value);
    });
}

void LoadReports::note(const Scene& scene, const ChangeSet& set) {
    firstCreated_ = UINT32_MAX;
    for (const Change& change : set.changes) note(scene, change);
}

void LoadReports::note(const Scene& scene, const Change& change) {
    if (change.kind == ChangeKind::createNode) firstCreated_ = std::min(firstCreated_, change.node.value);
    if (change.kind != ChangeKind::setField) return;
    // Most changes are of other types than `url`, `load` and `_watched`: they cost no look at their node.
    const FieldType type = change.value.type();
    if (type != FieldType::MFString && type != FieldType::SFBool && type != FieldType::MFInt32) return;
    const Node* node = scene.find(change.node);
    if (!node) return;
    if (node->is(S::type)) {
        if (change.field == S::_watched.index) asked_.insert(change.node.value);
        return;
    }
    const std::string& name = node->type().fields[change.field].name;
    // New nodes are looked at by their sensor anyway.
    if ((name != "url" && name != "load") || change.node.value >= firstCreated_) return;
    for (const ParentRef& parent : scene.parents(change.node))
        if (parent.field == S::children.index && scene.node(parent.node).is(S::type))
            changed_.insert(parent.node.value);
}

std::size_t LoadReports::answer(Scene& scene, const Resources& resources) {
    std::size_t count = 0;
    for (const std::uint32_t number : std::exchange(changed_, {})) {
        asked_.erase(number);
        // It begins anew, and asks again.
        if (scene.find(NodeId{number}) && scene.set(NodeId{number}, S::_outcomes, Array<std::int32_t>{0})) ++count;
    }
    for (const std::uint32_t number : std::exchange(asked_, {})) {
        const Node* sensor = scene.find(NodeId{number});
        if (!sensor || !sensor->get(S::isActive)) continue;
        Array<std::int32_t> rows;
        for (const NodeId id : sensor->get(S::children)) {
            const Node* child = scene.find(id);
            if (!child || !child->type().isA("X3DUrlObject")) continue;
            const auto outcome = outcomeOf(scene, *child, resources);
            if (outcome == kAwaited) asked_.insert(number);
            if (outcome && outcome != kAwaited) {
                rows.push_back(static_cast<std::int32_t>(id.value));
                rows.push_back(*outcome);
            }
        }
        if (rows != sensor->get(S::_outcomes) && scene.set(NodeId{number}, S::_outcomes, rows)) ++count;
    }
    return count;
}

}  // namespace rtsg
