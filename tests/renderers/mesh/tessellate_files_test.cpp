// Every geometry of every example scene becomes a mesh without defects.
#include <cstdlib>
#include <filesystem>

#include <rtsg/core/scene.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/tessellator.h>

#include "mesh_check.h"
#include "test_paths.h"

namespace rtsg {
namespace {

std::filesystem::path sceneFolder() {
    if (const char* folder = std::getenv("RTSG_SCENES")) return folder;
    for (const char* relative : {"/../shared/scenes", "/../../shared/scenes"})
        if (std::filesystem::exists(std::string(RTSG_SOURCE_DIR) + relative))
            return std::string(RTSG_SOURCE_DIR) + relative;
    return {};
}

TEST(TessellateFiles, EveryGeometryOfEverySceneIsSound) {
    const std::filesystem::path folder = sceneFolder();
    if (folder.empty()) GTEST_SKIP() << "no folder with scenes beside this project, and RTSG_SCENES is not set";
    std::size_t meshes = 0, triangles = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
        const std::string extension = entry.path().extension().string();
        if (extension != ".x3d" && extension != ".x3dv" && extension != ".wrl" && extension != ".x3dz") continue;
        SCOPED_TRACE(entry.path().string());
        Scene scene;
        Diagnostics diagnostics;
        LoadOptions options;
        options.loadInlines = false;
        loadFile(scene, entry.path(), diagnostics, options);
        Tessellator tessellator;
        scene.forEachNode([&](const Node& node) {
            if (!node.type().isA("X3DGeometryNode")) return;
            const auto mesh = tessellator.mesh(scene, node.id());
            ASSERT_TRUE(mesh);
            ASSERT_EQ(findDefect(*mesh), "") << node.type().name;
            for (std::uint32_t t = 0; t < mesh->triangleCount; ++t)
                ASSERT_NEAR(glm::length(mesh->shadingNormal(t, .25f, .25f)), 1, 1e-4) << node.type().name;
            ++meshes;
            triangles += mesh->triangleCount;
        });
        if (std::getenv("RTSG_VERBOSE"))
            for (const Diagnostic& d : tessellator.diagnostics().all())
                std::printf("%s: %s\n", entry.path().filename().c_str(), d.text.c_str());
    }
    RecordProperty("meshes", std::to_string(meshes));
    RecordProperty("triangles", std::to_string(triangles));
    EXPECT_GT(triangles, 0u);
    if (std::getenv("RTSG_VERBOSE")) std::printf("%zu meshes, %zu triangles\n", meshes, triangles);
}

}  // namespace
}  // namespace rtsg
