// Embree's objects at the end of the process.
#include <cstdlib>
#include <memory>

#include <gtest/gtest.h>

#include <rtsg/documents/loader.h>
#include <rtsg/renderers/shared_world.h>

namespace rtsg {
namespace {

/// exit() destroys it after Embree's own static data, which were made when the first world was.
TEST(BvhDeathTest, AWorldMayLiveAsLongAsTheProcess) {
    GTEST_FLAG_SET(death_test_style, "threadsafe");
    const auto run = [] {
        static std::unique_ptr<Scene> scene;
        static std::unique_ptr<SharedWorld> world;
        // Made here, destroyed as the very last.
        std::atexit([] { world.reset(), scene.reset(); });
        scene = std::make_unique<Scene>();
        Diagnostics diagnostics("test");
        const bool loaded = loadText(*scene, "#X3D V4.0 utf8\nPROFILE Full\nShape { geometry Box {} }\n", diagnostics);
        world = std::make_unique<SharedWorld>(*scene);
        scene->newFrame(0);
        std::exit(loaded && world->rays().intersect({.origin = Vec3f(0, 0, 5)}) ? 7 : 1);
    };
    EXPECT_EXIT(run(), testing::ExitedWithCode(7), "");
}

}  // namespace
}  // namespace rtsg
