// The scenes of rtsg bench frames at a small scale: they load without a diagnostic, have the triangles that were
// written, move if they are meant to, and look the same to every mapping and to Embree alone.
#include <filesystem>
#include <fstream>
#include <iterator>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "bench/bench_frames.h"
#include "bench/scenes/scenes.h"

namespace rtsg::bench {
namespace {

std::filesystem::path folder() {
    return std::filesystem::temp_directory_path() / ("rtsg-scenes-test-" + std::to_string(getpid()));
}
std::string contents(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

class BenchScene : public testing::TestWithParam<std::string> {};

TEST_P(BenchScene, IsWhatItSays) {
    const std::string name = GetParam();
    // measureFrames() itself refuses diagnostics of loading and triangles that were not written.
    const auto figures =
        measureFrames(name, {.scale = .01, .width = 96, .height = 64, .budget = .05, .flatTriangles = 1'000'000});
    ASSERT_TRUE(figures) << figures.error().format();
    const bool teapot = name.find('+') != std::string::npos;
    const SceneInfo* info = findBenchScene(name.substr(0, name.find('+')));
    ASSERT_NE(info, nullptr);
    EXPECT_GT(figures->triangles, 0u);
    EXPECT_LT(static_cast<double>(figures->triangles), std::max(.25 * info->triangles, 5e3));
    EXPECT_EQ(figures->moved + figures->deformed > 0, info->animated || teapot);
    for (std::size_t i = 0; i < kMappings.size(); ++i) {
        // 6,144 rays; one may graze an edge.
        EXPECT_LT(figures->differing[i], 2e-4) << kMappingNames[i];
        if (figures->triangles <= 1'000'000 || kMappings[i] != RayWorld::Mapping::merged) {
            EXPECT_EQ(figures->memory[i].instancedTriangles, figures->triangles) << kMappingNames[i];
        }
    }
}

std::vector<std::string> everyScene() {
    std::vector<std::string> names;
    for (const SceneInfo& s : benchScenes()) {
        names.emplace_back(s.name);
        if (s.teapotScale > 0) names.push_back(std::string(s.name) + "+teapot");
    }
    return names;
}

INSTANTIATE_TEST_SUITE_P(All, BenchScene, testing::ValuesIn(everyScene()), [](const auto& test) {
    std::string name = test.param;
    std::erase(name, '+');
    return name;
});

TEST(BenchScenes, AreTheSameEveryTime) {
    std::string files[2];
    for (std::string& file : files) {
        for (const char* name : {"Campus", "Troopers"}) {
            ASSERT_TRUE(writeBenchScene(name, .01, false, folder()));
            file += contents(folder() / (std::string(name) + ".x3dv"));
        }
        std::filesystem::remove_all(folder());
    }
    EXPECT_GT(files[0].size(), 10'000u);
    EXPECT_TRUE(files[0] == files[1]);
}

TEST(BenchScenes, HaveAboutThePapersTriangles) {
    for (const char* name : {"Beetles", "Conference", "Kitchen", "Troopers", "Escherknot"}) {
        const auto written = writeBenchScene(name, 1, false, folder());
        ASSERT_TRUE(written) << written.error().format();
        EXPECT_NEAR(static_cast<double>(*written) / findBenchScene(name)->triangles, 1, .05) << name;
    }
    std::filesystem::remove_all(folder());
}

/// Some start before 0, which is where a stopTime that nobody gives would end them (8.2.4.3).
TEST(BenchScenes, EveryTrooperMarches) {
    ASSERT_TRUE(writeBenchScene("Troopers", .1, false, folder()));
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadFile(scene, (folder() / "Troopers.x3dv").string(), diagnostics));
    std::filesystem::remove_all(folder());
    scene.newFrame(0);
    int figures = 0;
    scene.forEachNode([&](const Node& node) {
        if (!node.is(x3d::TimeSensor::type)) return;
        ++figures;
        EXPECT_TRUE(node.get(x3d::TimeSensor::isActive)) << node.id().value;
    });
    EXPECT_GT(figures, 3);
}

TEST(BenchScenes, RefuseWhatTheyCannot) {
    EXPECT_FALSE(writeBenchScene("Nowhere", 1, false, folder()));
    EXPECT_FALSE(writeBenchScene("Campus", 0, false, folder()));
    EXPECT_FALSE(writeBenchScene("Campus", 2, false, folder()));
    EXPECT_FALSE(writeBenchScene("Beetles", .01, true, folder()));
    EXPECT_FALSE(writeBenchScene("Escherknot", .01, false, "/proc/no/such/place"));
    EXPECT_FALSE(measureFrames("Campus+kettle", {}));
    std::filesystem::remove_all(folder());
}

}  // namespace
}  // namespace rtsg::bench
