// The role of a type in the hierarchy is computed once and kept.
#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "flatten/flattener_roles.h"

namespace rtsg {
namespace {

TEST(RoleTable, KeepsWhatItHasGivenWhateverElseIsAskedFor) {
    Scene scene;
    std::vector<NodeId> nodes;
    for (const auto type : {x3d::Appearance::type, x3d::Shape::type, x3d::Transform::type, x3d::MovieTexture::type})
        nodes.push_back(scene.createNode(type));
    std::ranges::sort(nodes, {}, [&](NodeId id) { return scene.node(id).typeIndex().value; });
    flatten::RoleTable roles;
    std::vector<const flatten::TypeRole*> given;
    for (const NodeId id : nodes) given.push_back(&roles.of(scene.node(id)));
    for (std::size_t i = 0; i < nodes.size(); ++i) EXPECT_EQ(&roles.of(scene.node(nodes[i])), given[i]);
}

}  // namespace
}  // namespace rtsg
