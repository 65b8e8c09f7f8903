// The Tessellator shares, remembers and forgets meshes.
#include <rtsg/renderers/tessellator.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

#include "mesh_check.h"

namespace rtsg {
namespace {

TEST(Tessellator, EqualPrimitivesAreOneMesh) {
    Scene scene;
    Tessellator tessellator;
    const auto box = [&](Vec3f size) {
        const NodeId id = scene.createNode(x3d::Box::type);
        EXPECT_TRUE(scene.set(id, x3d::Box::size, size));
        return tessellator.mesh(scene, id);
    };
    const auto a = box({1, 2, 3}), b = box({1, 2, 3}), c = box({1, 2, 4});
    EXPECT_EQ(a, b);
    EXPECT_NE(a, c);
    EXPECT_DOUBLE_EQ(enclosedVolume(*c), 8);
    // The same numbers in another type, and the same type with another flag.
    const NodeId cone = scene.createNode(x3d::Cone::type), open = scene.createNode(x3d::Cone::type);
    const NodeId cylinder = scene.createNode(x3d::Cylinder::type);
    ASSERT_TRUE(scene.set(open, x3d::Cone::bottom, false));
    EXPECT_NE(tessellator.mesh(scene, cone)->triangleCount, tessellator.mesh(scene, open)->triangleCount);
    EXPECT_NE(tessellator.mesh(scene, cylinder)->triangleCount, tessellator.mesh(scene, cone)->triangleCount);
}

TEST(Tessellator, SpheresShareAllButTheirPositions) {
    Scene scene;
    Tessellator tessellator;
    const NodeId one = scene.createNode(x3d::Sphere::type), two = scene.createNode(x3d::Sphere::type);
    const NodeId bad = scene.createNode(x3d::Sphere::type);
    ASSERT_TRUE(scene.set(two, x3d::Sphere::radius, 2.5f));
    ASSERT_TRUE(scene.set(two, x3d::Sphere::solid, false));
    ASSERT_TRUE(scene.set(bad, x3d::Sphere::radius, -1.0f));
    const auto a = tessellator.mesh(scene, one), b = tessellator.mesh(scene, two);
    EXPECT_TRUE(a->triangles.sameStorage(b->triangles));
    EXPECT_TRUE(a->normals.indices().sameStorage(b->normals.indices()));
    EXPECT_TRUE(a->texCoords[0].values.indices().sameStorage(b->texCoords[0].values.indices()));
    EXPECT_EQ(findDefect(*b), "");
    EXPECT_FALSE(b->solid);
    // Bit for bit what tessellating it alone gives.
    const Mesh alone = tessellate(SphereParams{.radius = 2.5f});
    EXPECT_EQ(b->positions, alone.positions);
    EXPECT_EQ(b->triangles, alone.triangles);
    EXPECT_EQ(b->bounds.max, alone.bounds.max);
    EXPECT_TRUE(tessellator.mesh(scene, bad)->empty());
    EXPECT_EQ(tessellator.diagnostics().warnings(), 1u);
}

TEST(Tessellator, MeshesLiveAsLongAsTheyAreHeld) {
    Scene scene;
    Tessellator tessellator;
    const NodeId id = scene.createNode(x3d::Box::type);
    std::weak_ptr<const Mesh> last;
    for (int i = 1; i <= 1000; ++i) {
        ASSERT_TRUE(scene.set(id, x3d::Box::size, Vec3f(static_cast<float>(i))));
        last = tessellator.mesh(scene, id);
        EXPECT_TRUE(last.expired());
    }
    EXPECT_LE(tessellator.sharedCount(), 64u);
}

TEST(Tessellator, FailuresAreNoted) {
    Scene scene;
    Tessellator tessellator;
    EXPECT_EQ(tessellator.mesh(scene, NodeId{4711}), nullptr);
    EXPECT_EQ(tessellator.mesh(scene, scene.createNode(x3d::Group::type)), nullptr);
    EXPECT_EQ(tessellator.diagnostics().errors(), 2u);
    EXPECT_TRUE(tessellator.mesh(scene, scene.createNode(x3d::NurbsPatchSurface::type))->empty());
    EXPECT_EQ(tessellator.diagnostics().warnings(), 1u);
}

}  // namespace
}  // namespace rtsg
