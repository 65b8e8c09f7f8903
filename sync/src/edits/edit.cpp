// Applies a change to a scene by the scene's public edits.
#include "edit.h"

namespace rtsg::mirror {

namespace {

Result<> carryOut(Scene& scene, const Change& c) {
    switch (c.kind) {
        case ChangeKind::setField:
            return scene.setField(c.node, c.field, c.value);
        case ChangeKind::insertChild:
            return scene.insertChild(c.node, c.field, c.other, c.index);
        case ChangeKind::removeChild: {
            const Node* parent = scene.find(c.node);
            if (!parent || c.field >= parent->type().fields.size() || !parent->type().fields[c.field].readable() ||
                parent->type().fields[c.field].type != FieldType::MFNode)
                return fail("there is no such list");
            const auto& children = parent->get(Field<Array<NodeId>>{c.field});
            if (c.index >= children.size() || children[c.index] != c.other) return fail("that child is not there");
            return scene.removeChild(c.node, c.field, c.index);
        }
        case ChangeKind::setName:
            return scene.setName(c.node, c.value.holds<String>() ? c.value.as<String>().view() : std::string_view());
        case ChangeKind::addRoute:
            return scene.addRoute(c.node, c.field, c.other, c.field2());
        case ChangeKind::removeRoute:
            return scene.removeRoute(c.node, c.field, c.other, c.field2());
        case ChangeKind::destroyNode:
            return scene.destroyNode(c.node);
        case ChangeKind::createNode:
        case ChangeKind::event:
        case ChangeKind::defineType:
            break;
    }
    return fail("this is no edit");
}

}  // namespace

Result<> edit(Scene& scene, const Change& change, std::string_view author) {
    auto done = carryOut(scene, change);
    const bool ofField = change.kind == ChangeKind::setField || change.kind == ChangeKind::insertChild ||
                         change.kind == ChangeKind::removeChild;
    if (done) scene.attribute(author, change.node, ofField ? change.field : kNoField);
    return done;
}

}  // namespace rtsg::mirror
