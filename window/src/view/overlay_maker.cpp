// Reads what the overlay shows from the scene.
#include "overlay_maker.h"

#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/navigation.h>
#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

using Root = x3d::RtsgScene;

constexpr std::size_t kMaxRows = 2000, kMaxChildren = 300, kMaxRoutes = 60;
constexpr std::size_t kLongestText = 160, kMaxElements = 6;
constexpr int kDeepest = 60;  // nodes that Scripts refer to may lead round
constexpr int kFraction = 50;

std::string called(const Scene& scene, NodeId id) {
    const Node* node = scene.find(id);
    if (!node) return "NULL";
    const std::string_view name = scene.name(id);
    return name.empty() ? fmt::format("{} #{}", node->type().name, id.value) : std::string(name);
}

/// The nodes below a node, in the order of its fields; for an instance of a PROTO also its body.
std::vector<NodeId> childrenOf(const Scene& scene, const Node& node) {
    std::vector<NodeId> below;
    const FieldIndex body = node.type().body();
    for (const FieldIndex i : node.type().nodeFields()) {
        const FieldDef& field = node.type().fields[i];
        if (!field.readable() || (field.hidden && i != body)) continue;
        if (node.id() == scene.root() && i != Root::children.index) continue;
        if (field.type == FieldType::SFNode)
            below.push_back(node.get(Field<NodeId>{i}));
        else
            for (const NodeId child : node.get(Field<Array<NodeId>>{i})) below.push_back(child);
    }
    std::erase_if(below, [&](NodeId id) { return !scene.find(id); });
    return below;
}

bool hasChildren(const Scene& scene, const Node& node) {
    const FieldIndex body = node.type().body();
    return std::ranges::any_of(node.type().nodeFields(), [&](FieldIndex i) {
        const FieldDef& field = node.type().fields[i];
        if (!field.readable() || (field.hidden && i != body)) return false;
        if (field.type == FieldType::SFNode) return scene.find(node.get(Field<NodeId>{i})) != nullptr;
        return !node.get(Field<Array<NodeId>>{i}).empty();
    });
}

/// The field that shows or hides a node and its descendants.
FieldIndex visibleField(const Node& node) {
    const FieldIndex field = node.type().findExact("visible");
    if (field == kNoField) return kNoField;
    const FieldDef& def = node.type().fields[field];
    return def.type == FieldType::SFBool && def.access == Access::inputOutput && !def.hidden ? field : kNoField;
}

std::size_t elements(const Value& value) {
    if (!isMF(value.type())) return 1;
    const auto* const header = *static_cast<const detail::ArrayHeader* const*>(value.storage());
    return header ? header->size : 0;
}

std::string clipped(std::string text) {
    std::ranges::replace(text, '\n', ' ');
    if (text.size() <= kLongestText) return text;
    std::size_t end = kLongestText;
    while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;  // not within a letter
    return text.substr(0, end) + "...";
}

std::string shown(const Scene& scene, const Value& value) {
    if (value.type() == FieldType::SFNode) return called(scene, value.as<NodeId>());
    if (value.type() == FieldType::SFImage) {
        const Image& image = value.as<Image>();
        return fmt::format("{} x {}, {} components", image.width(), image.height(), image.components());
    }
    const std::size_t count = elements(value);
    if (value.type() == FieldType::MFNode && count <= kMaxElements) {
        std::string names;
        for (const NodeId id : value.as<Array<NodeId>>()) names += (names.empty() ? "" : ", ") + called(scene, id);
        return clipped(names);
    }
    if (isMF(value.type()) && count > kMaxElements) return fmt::format("{} values", count);
    if (value.type() == FieldType::MFImage) return fmt::format("{} images", count);
    if (value.type() == FieldType::SFString) return clipped(value.as<String>().str());
    return clipped(printFieldText(value));
}

std::string routeText(const Scene& scene, const Route& route) {
    const auto end = [&](NodeId id, FieldIndex field) {
        const Node* node = scene.find(id);
        return called(scene, id) + "." + (node ? node->type().fields[field].name : std::string("?"));
    };
    return fmt::format("{} \xE2\x86\x92 {}{}", end(route.fromNode, route.fromField), end(route.toNode, route.toField),
                       route.isConnection ? " (IS)" : "");
}

std::string viewpointName(const Scene& scene, const Node& node) {
    const FieldIndex description = node.type().findExact("description");
    if (description != kNoField)
        if (const std::string text = node.get(Field<String>{description}).str(); !text.empty()) return clipped(text);
    return called(scene, node.id());
}

}  // namespace

void OverlayMaker::toggle(NodeId node) {
    if (!open_.insert(node).second) open_.erase(node);
}

void OverlayMaker::pickOnPath(const std::vector<NodeId>& path) {
    if (path.empty()) return;
    picked_ = path.back();
    for (const NodeId id : path)
        if (!world_.scene().name(id).empty()) picked_ = id;
    for (const NodeId id : path) {
        if (id == picked_) break;
        open_.insert(id);
    }
}

void OverlayMaker::lookAtAll() {
    const Clock::time_point start = Clock::now();
    if (start < due_) return;
    viewpoints_ = viewpoints(world_.scene());
    triangles_ = world_.rays().stats().instancedTriangles;
    const Clock::time_point end = Clock::now();
    due_ = end + std::max<Clock::duration>(std::chrono::milliseconds(200), kFraction * (end - start));
}

void OverlayMaker::fillViewpoints(OverlayContent& content) {
    lookAtAll();
    const Scene& scene = world_.scene();
    for (const NodeId id : viewpoints_) {
        const Node* node = scene.find(id);
        if (!node) continue;
        const FieldIndex isBound = node->type().findExact("isBound");
        content.viewpoints.push_back(
            {id.value, viewpointName(scene, *node), isBound != kNoField && node->get(Field<bool>{isBound})});
    }
}

void OverlayMaker::fill(OverlayContent& content) {
    lookAtAll();
    const Scene& scene = world_.scene();
    addRows(childrenOf(scene, scene.node(scene.root())), 0, content.tree);
    if (const Node* node = scene.find(picked_)) content.picked = describe(*node);
}

void OverlayMaker::addRows(const std::vector<NodeId>& nodes, int depth, std::vector<OverlayContent::Row>& rows) const {
    const Scene& scene = world_.scene();
    std::size_t shownHere = 0;
    for (const NodeId id : nodes) {
        if (shownHere == kMaxChildren || rows.size() >= kMaxRows) {
            OverlayContent::Row more;
            more.depth = depth;
            more.name = fmt::format("... and {} more", nodes.size() - shownHere);
            rows.push_back(std::move(more));
            return;
        }
        ++shownHere;
        const Node& node = scene.node(id);
        OverlayContent::Row row;
        row.node = id.value;
        row.depth = depth;
        row.name = scene.name(id);
        row.type = node.type().name;
        row.opens = depth < kDeepest && hasChildren(scene, node);
        row.isOpen = row.opens && open_.contains(id);
        row.isPicked = id == picked_;
        const FieldIndex visible = visibleField(node);
        row.hides = visible != kNoField;
        row.isVisible = !row.hides || node.get(Field<bool>{visible});
        const bool isOpen = row.isOpen;
        rows.push_back(std::move(row));
        if (isOpen) addRows(childrenOf(scene, node), depth + 1, rows);
    }
}

OverlayContent::Picked OverlayMaker::describe(const Node& node) const {
    const Scene& scene = world_.scene();
    OverlayContent::Picked picked;
    picked.node = node.id().value;
    picked.name = scene.name(node.id());
    picked.type = fmt::format("{} #{}", node.type().name, node.id().value);
    for (FieldIndex i = 0; i < node.type().fieldCount(); ++i) {
        const FieldDef& def = node.type().fields[i];
        if (def.hidden || !def.readable()) continue;
        const Value value = node.value(i);
        OverlayContent::Field field{def.name, shown(scene, value), node.isDefault(i), 0};
        if (value.type() == FieldType::SFNode) field.node = value.as<NodeId>().value;
        if (value.type() == FieldType::MFNode && elements(value) == 1) field.node = value.as<Array<NodeId>>()[0].value;
        picked.fields.push_back(std::move(field));
    }
    std::ranges::stable_partition(picked.fields, [](const OverlayContent::Field& f) { return !f.isDefault; });
    for (const auto& routes : {scene.routesTo(node.id()), scene.routesFrom(node.id())})
        for (const Route& route : routes)
            if (picked.routes.size() < kMaxRoutes) picked.routes.push_back(routeText(scene, route));
    return picked;
}

}  // namespace rtsg
