// GeoLOD's urls: each becomes an Inline of its own, so that loading, limits and reports are those of Inlines.
// Source: ISO/IEC 19775-1 V4.0 25.3.4.
#include <rtsg/core/x3d.h>

#include "builder_state.h"

namespace rtsg {

void SceneBuilder::State::addTiles(NodeId id, SourceLocation where) {
    using N = x3d::GeoLOD;
    const auto inlineOf = [&](const Array<String>& url, bool load) -> NodeId {
        const NodeId created = scene.createNode(x3d::Inline::type, scope().owner);
        if (!created) return {};
        setHidden(scene, created, x3d::Inline::url.index, Value(url));
        setHidden(scene, created, x3d::Inline::load.index, Value(load));
        scope().inlines.emplace_back(created, where);
        return created;
    };
    // Copies: what refers to a node's fields does not outlast the making of another.
    const Node& node = scene.node(id);
    const Array<String> rootUrl = node.get(N::rootUrl);
    const Array<String> tileUrls[] = {node.get(N::child1Url), node.get(N::child2Url), node.get(N::child3Url),
                                      node.get(N::child4Url)};
    Array<NodeId> root, tiles;
    // 25.3.4: only one of rootNode and rootUrl is meant to be given; what is there needs no loading.
    if (!rootUrl.empty() && node.get(N::rootNode).empty())
        if (const NodeId created = inlineOf(rootUrl, true)) root.push_back(created);
    for (const Array<String>& url : tileUrls)
        if (!url.empty())
            if (const NodeId created = inlineOf(url, false)) tiles.push_back(created);
    if (!root.empty()) setHidden(scene, id, N::_root.index, Value(root));
    if (!tiles.empty()) setHidden(scene, id, N::_tiles.index, Value(tiles));
}

}  // namespace rtsg
