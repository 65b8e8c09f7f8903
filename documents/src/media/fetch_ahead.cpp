// Finds the fields that name files, and starts the fetch of those on the network.
#include "fetch_ahead.h"

#include <algorithm>

#include <rtsg/core/web_address.h>
#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

bool namesFiles(const FieldDef& field) {
    return field.type == FieldType::MFString && !field.hidden && (field.name == "url" || field.name.ends_with("Url"));
}

/// Documents are loaded by those who build them.
bool isLeftAlone(const Node& node) {
    return node.is(x3d::Anchor::type) || node.is(x3d::RenderedTexture::type) || node.is(x3d::Inline::type) ||
           node.is(x3d::InlineGeometry::type);
}

bool hasFiles(const Node& node) {
    return !isLeftAlone(node) && std::ranges::any_of(node.type().fields, namesFiles);
}

}  // namespace

bool awaitsUrls(const Scene& scene, const Node& node, FieldIndex field, const Resources& resources) {
    if (!resources.policy().fetcher) return false;
    for (const String& url : node.get(Field<Array<String>>{field})) {
        if (programInUrl(url.view())) return false;
        if (resources.awaits(scene, node, field, url.view())) return true;
        if (resources.open(scene, node, field, url.view())) return false;
    }
    return false;
}

FetchAhead::FetchAhead(const Scene& scene) {
    scene.forEachNode([&](const Node& node) { noteNode(node); });
}

void FetchAhead::noteNode(const Node& node) {
    const auto [type, isNew] = types_.try_emplace(&node.type());
    if (isNew) type->second = hasFiles(node);
    if (type->second) asked_.insert(node.id().value);
}

void FetchAhead::note(const Scene& scene, const ChangeSet& set) {
    for (const Change& change : set.changes) {
        const bool isNew = change.kind == ChangeKind::createNode;
        // Most changes are of other types than `url` and `load`: they cost no look at their node.
        if (!isNew && change.kind != ChangeKind::setField) continue;
        if (!isNew && change.value.type() != FieldType::MFString && change.value.type() != FieldType::SFBool) continue;
        if (const Node* node = scene.find(change.node)) noteNode(*node);
    }
}

void FetchAhead::answer(const Scene& scene, const Resources& resources) {
    for (const std::uint32_t number : std::exchange(asked_, {})) {
        const Node* node = resources.policy().fetcher ? scene.find(NodeId{number}) : nullptr;
        if (!node) continue;
        const FieldIndex load = node->type().findExact("load");
        const bool isBool = load != kNoField && node->type().fields[load].type == FieldType::SFBool;
        if (isBool && !node->get(Field<bool>{load})) continue;
        for (FieldIndex i = 0; i < node->type().fields.size(); ++i)
            if (namesFiles(node->type().fields[i]) && awaitsUrls(scene, *node, i, resources)) asked_.insert(number);
    }
}

}  // namespace rtsg
