// A Script that writes coordinates deforms a mesh like any interpolator: followed in place, refitted, and hit where it
// is.
#include <gtest/gtest.h>

#include <rtsg/documents/loader.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/ray_world.h>
#include <rtsg/scripts/run_scripts.h>

namespace rtsg {
namespace {

TEST(ScriptDeform, ARefittedMeshIsHitWhereTheScriptPutIt) {
    Scene scene;
    runScripts(scene);
    Diagnostics diagnostics("test");
    ASSERT_TRUE(loadText(scene, R"(#X3D V4.0 utf8
PROFILE Full
Shape { geometry IndexedTriangleSet { solid FALSE index [ 0 1 2 ]
    coord DEF C Coordinate { point [ -1 -1 0, 1 -1 0, 0 1 0 ] } } }
DEF S Script { outputOnly MFVec3f points url "ecmascript:
    var n = 0;
    function prepareEvents() {
        ++n;
        points = new MFVec3f(new SFVec3f(-1, -1, -n), new SFVec3f(1, -1, -n), new SFVec3f(0, 1, -n));
    }" }
ROUTE S.points TO C.set_point
)",
                         diagnostics));
    ASSERT_EQ(diagnostics.errors(), 0u);
    Flattener flattener;
    RayWorld world;
    scene.seal();
    world.apply(flattener.apply(scene, scene.snapshot()));
    EXPECT_FLOAT_EQ(world.intersect({{0, 0, 10}, 0, {0, 0, -1}}).t, 10);
    for (int frame = 1; frame <= 20; ++frame) {
        world.apply(flattener.apply(scene, *scene.newFrame(frame)));
        EXPECT_FLOAT_EQ(world.intersect({{0, 0, 10}, 0, {0, 0, -1}}).t, 10 + static_cast<float>(frame));
    }
    EXPECT_TRUE(scene.diagnostics().all().empty());
    EXPECT_GT(world.stats().meshRefits, 10u);
}

}  // namespace
}  // namespace rtsg
