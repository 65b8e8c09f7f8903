// Computes the state hash's terms anew by node and field, to find where two scenes differ.
#include <rtsg/core/hash_terms.h>

#include "state_hash.h"

namespace rtsg {

namespace {

template <class Add>
void forEachTerm(const Scene& scene, const Node& node, Add add) {
    if (node.id() != scene.root())
        add(&NodeHashes::node, detail::nodeTerm(node.id(), hashOfText(node.type().name), node.scope()));
    if (const std::string_view name = scene.name(node.id()); !name.empty())
        add(&NodeHashes::name, detail::nameTerm(node.id(), name));
    for (const Route& r : scene.routesFrom(node.id()))
        add(&NodeHashes::routes,
            detail::routeTerm(node.id(), fieldKey(node.type().fields[r.fromField]), r.toNode,
                              fieldKey(scene.node(r.toNode).type().fields[r.toField]), r.isConnection));
}

Hash128 termOf(const Node& node, FieldIndex field) {
    const FieldDef& def = node.type().fields[field];
    if (!def.readable() || node.isDefault(field)) return {};
    return detail::fieldTerm(node.id(), fieldKey(def), def.type, node.storage(field));
}

}  // namespace

NodeHashes hashesOf(const Scene& scene, const Node& node) {
    NodeHashes result;
    forEachTerm(scene, node, [&](Hash128 NodeHashes::* part, Hash128 term) { result.*part = result.*part + term; });
    result.fields.reserve(node.type().fields.size());
    for (FieldIndex i = 0; i < node.type().fields.size(); ++i) result.fields.push_back(termOf(node, i));
    return result;
}

Hash128 hashOfNode(const Scene& scene, const Node& node) {
    Hash128 sum;
    forEachTerm(scene, node, [&](Hash128 NodeHashes::*, Hash128 term) { sum = sum + term; });
    for (FieldIndex i = 0; i < node.type().fields.size(); ++i) sum = sum + termOf(node, i);
    return sum;
}

}  // namespace rtsg
