// Scene files: the same state comes back, and damage is refused.
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>
#include <zlib.h>

#include <rtsg/documents/loader.h>
#include <rtsg/documents/scene_exporter.h>
#include <rtsg/documents/writer.h>
#include <rtsg/sync/log_summary.h>
#include <rtsg/sync/scene_file.h>

#include "test_paths.h"

namespace rtsg {
namespace {

std::string path(const char* name) {
    return (std::filesystem::path(testing::TempDir()) / (std::to_string(::getpid()) + name)).string();
}

constexpr const char* kText =
    "#X3D V4.0 utf8\nPROTO P [ inputOutput SFFloat f 1 ] { Transform { } }\n"
    "DEF T Transform { translation 1 2 3 children [ P { f 2 } DEF S Shape { geometry IndexedFaceSet { coordIndex [ 0 1 "
    "2 ] "
    "coord Coordinate { point [ 0 0 0 1 0 0 0 1 0.1 ] } } } ] }\nDEF C TimeSensor { }\n"
    "WorldInfo { title \"a title\" info [ \"one\" \"two\" ] }\nROUTE C.enabled TO C.loop\n";

TEST(SceneFile, GivesTheSameStateBack) {
    Scene scene, again;
    Diagnostics problems("test");
    ASSERT_TRUE(loadText(scene, kText, problems));
    scene.newFrame(7);
    const std::string file = path("a.rtsgb");
    ASSERT_TRUE(writeSceneFile(scene, file));
    EXPECT_TRUE(isSceneFile(file));
    EXPECT_FALSE(isLog(file));
    const auto read = readSceneFile(again, file);
    ASSERT_TRUE(read) << read.error().format();
    EXPECT_EQ(again.hash().hex(), scene.hash().hex());
    EXPECT_EQ(again.dump(), scene.dump());
    EXPECT_FALSE(writeSceneFile(scene, file, Existing::keep));
    std::filesystem::remove(file);
    EXPECT_FALSE(isSceneFile(file));
    Scene none;
    EXPECT_FALSE(readSceneFile(none, file));
}

TEST(SceneFile, RefusesDamageWhereverItIs) {
    Scene scene;
    Diagnostics problems("test");
    ASSERT_TRUE(loadText(scene, kText, problems));
    const std::string file = path("b.rtsgb");
    ASSERT_TRUE(writeSceneFile(scene, file));
    std::ifstream in(file, std::ios::binary);
    const std::string good(std::istreambuf_iterator<char>(in), {});
    for (std::size_t at = 0; at < good.size(); at += 1 + good.size() / 61) {
        std::string bad = good;
        bad[at] = static_cast<char>(bad[at] ^ 0x10);
        std::ofstream(file, std::ios::binary | std::ios::trunc) << bad;
        Scene damaged;
        EXPECT_FALSE(readSceneFile(damaged, file)) << at;
        std::ofstream(file, std::ios::binary | std::ios::trunc) << good.substr(0, at);
        Scene cut;
        EXPECT_FALSE(readSceneFile(cut, file)) << at;
    }
    std::filesystem::remove(file);
}

std::size_t gzipSize(const std::string& text) {
    uLongf size = compressBound(static_cast<uLong>(text.size()));
    std::vector<Bytef> packed(size);
    EXPECT_EQ(compress2(packed.data(), &size, reinterpret_cast<const Bytef*>(text.data()),
                        static_cast<uLong>(text.size()), 9),
              Z_OK);
    return size + 12;  // gzip's frame is longer than zlib's
}

/// The examples without PROTOs, whose nodes a state has for each instance (docs/documents.md).
TEST(SceneFile, IsSmallerThanTheTextInGzip) {
    const std::string file = path("c.rtsgb");
    std::size_t scenes = 0;
    for (const auto& entry : std::filesystem::directory_iterator(RTSG_SOURCE_DIR "/examples")) {
        if (entry.path().extension() != ".x3dv") continue;
        Scene scene;
        Diagnostics problems(entry.path().string());
        ASSERT_TRUE(loadFile(scene, entry.path(), problems));
        if (scene.typeCount() > builtinTypes().size()) continue;
        ++scenes;
        ASSERT_TRUE(writeSceneFile(scene, file));
        std::string text;
        const auto writer = makeWriter(Encoding::classicVrml, [&](std::string_view piece) { text += piece; }, problems);
        SceneExporter(scene, problems).write(*writer, Encoding::classicVrml);
        EXPECT_LT(std::filesystem::file_size(file), gzipSize(text)) << entry.path();
        std::filesystem::remove(file);
    }
    EXPECT_GE(scenes, 3u);
}

}  // namespace
}  // namespace rtsg
