// Looks for sensors beside a path, from the Shape outwards.
#include "pointed.h"

#include <ranges>

#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

void add(const Node& node, Pointed& to) {
    to.reacts = true;
    const FieldIndex field = node.type().findExact("description");
    if (field == kNoField || node.type().fields[field].type != FieldType::SFString) return;
    const std::string text = node.get(Field<String>{field}).str();
    if (!text.empty()) to.description += (to.description.empty() ? "" : "\n") + text;
}

bool isEnabled(const Node& node) {
    const FieldIndex field = node.type().findExact("enabled");
    return field == kNoField || node.type().fields[field].type != FieldType::SFBool || node.get(Field<bool>{field});
}

void addSensorsOf(const Scene& scene, const Node& group, Pointed& to) {
    const FieldIndex children = group.type().findExact("children");
    if (children == kNoField || group.type().fields[children].type != FieldType::MFNode) return;
    for (const NodeId id : group.get(Field<Array<NodeId>>{children}))
        if (const Node* node = scene.effectiveNode(id);
            node && node->type().isA("X3DPointingDeviceSensorNode") && isEnabled(*node))
            add(*node, to);
}

}  // namespace

Pointed pointedAt(const Scene& scene, const std::vector<NodeId>& path) {
    Pointed found;
    for (const NodeId id : path | std::views::reverse) {
        const Node* node = scene.find(id);
        if (!node) continue;
        addSensorsOf(scene, *node, found);
        if (node->is(x3d::Anchor::type)) {
            add(*node, found);
            found.anchor = id;
        }
        if (found.reacts) break;
    }
    return found;
}

}  // namespace rtsg
