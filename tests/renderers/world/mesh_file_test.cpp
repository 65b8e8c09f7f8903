// Mesh files of a scene, read back by the importers: the same triangles at the same places.
#include <rtsg/renderers/mesh_file.h>

#include <cmath>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <rtsg/documents/loader.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/mesh.h>

namespace rtsg {
namespace {

constexpr const char* kText =
    "#X3D V4.0 utf8\nTransform { translation 10 0 0 rotation 0 0 1 1.5707963 scale 2 1 1 children DEF S Shape { "
    "geometry Box { "
    "size 1 2 3 } appearance Appearance { material DEF M PhysicalMaterial { baseColor 1 0.5 0.25 transparency 0.5 } } "
    "} }\n"
    "Transform { scale -1 1 1 translation 0 5 0 children USE S }\n"
    "Shape { geometry Box { size 2 2 2 } }\nShape { geometry IndexedLineSet { } }\n"
    "Switch { whichChoice -1 children Shape { geometry Sphere { } } }\n";

/// Area, volume and the middle of all triangles in world space, in double precision.
struct Sum {
    double area = 0, volume = 0;
    Vec3d center{0};
    std::size_t triangles = 0;
};

Sum sumOf(const Scene& scene) {
    Flattener flattener;
    const InstanceDelta& delta = flattener.apply(scene, scene.snapshot());
    Sum sum;
    for (const Instance& instance : flattener.instances()) {
        if (!instance.id) continue;
        for (const auto& geometry : delta.geometries) {
            if (geometry.node != instance.geometry || !geometry.mesh) continue;
            const bool mirrored = determinantSign(instance.worldFromLocal) < 0;
            for (std::uint32_t t = 0; t < geometry.mesh->triangleCount; ++t) {
                const auto corner = [&](std::uint32_t c) {
                    return instance.worldFromLocal * glm::dvec4(Vec3d(geometry.mesh->vertex(t, c)), 1);
                };
                const Vec3d a = corner(0), b = corner(mirrored ? 2 : 1), c = corner(mirrored ? 1 : 2);
                const double area = glm::length(glm::cross(b - a, c - a)) / 2;
                sum.area += area;
                sum.volume += glm::dot(a, glm::cross(b, c)) / 6;
                sum.center += area * (a + b + c) / 3.0;
                ++sum.triangles;
            }
        }
    }
    sum.center /= sum.area;
    return sum;
}

class MeshFiles : public testing::TestWithParam<const char*> {};

TEST_P(MeshFiles, HoldTheTrianglesOfTheScene) {
    Scene scene;
    Diagnostics problems("test");
    ASSERT_TRUE(loadText(scene, kText, problems));
    const Sum expected = sumOf(scene);
    // Two boxes of 2 x 2 x 3 (one scaled) and 1 x 2 x 3, and one of 2 x 2 x 2.
    EXPECT_NEAR(expected.volume, 12 + 6 + 8, 1e-4);
    const std::string file =
        (std::filesystem::path(testing::TempDir()) / (std::to_string(::getpid()) + "mesh" + GetParam())).string();
    MeshFormat format{};
    ASSERT_TRUE(meshFormatFromName(file, format));
    const auto written = writeMeshFile(scene, file, format, problems);
    ASSERT_TRUE(written) << written.error().format();
    EXPECT_EQ(written->shapes, 3u);
    EXPECT_EQ(written->triangles, 36u);
    Scene again;
    Diagnostics reading(file);
    ASSERT_TRUE(loadFile(again, file, reading));
    EXPECT_EQ(reading.errors(), 0u);
    const Sum found = sumOf(again);
    EXPECT_EQ(found.triangles, 36u);
    EXPECT_NEAR(found.area, expected.area, 1e-4);
    EXPECT_NEAR(found.volume, expected.volume, 1e-4) << "faces look the same way, those of mirrored shapes too";
    EXPECT_LT(glm::length(found.center - expected.center), 1e-5);
    std::filesystem::remove(file);
}

INSTANTIATE_TEST_SUITE_P(Formats, MeshFiles, testing::Values(".stl", ".obj", ".ply", ".glb"),
                         [](const auto& param) { return std::string(param.param + 1); });

TEST(MeshFile, GlbSharesGeometryAndKeepsMaterials) {
    Scene scene;
    Diagnostics problems("test");
    ASSERT_TRUE(loadText(scene, kText, problems));
    const std::string file =
        (std::filesystem::path(testing::TempDir()) / (std::to_string(::getpid()) + "m.glb")).string();
    ASSERT_TRUE(writeMeshFile(scene, file, MeshFormat::glb, problems));
    Scene again;
    Diagnostics reading(file);
    ASSERT_TRUE(loadFile(again, file, reading));
    const NodeId shared = again.findName("mesh0");
    ASSERT_TRUE(shared);
    EXPECT_EQ(again.dump().find("baseColor 1 0.5 0.25") != std::string::npos, true);
    EXPECT_EQ(again.dump().find("transparency 0.5") != std::string::npos, true);
    std::filesystem::remove(file);
}

TEST(MeshFile, ASceneWithoutTrianglesIsNoFile) {
    Scene scene;
    Diagnostics problems("test");
    ASSERT_TRUE(loadText(scene, "#X3D V4.0 utf8\nGroup { }\n", problems));
    const std::string file =
        (std::filesystem::path(testing::TempDir()) / (std::to_string(::getpid()) + "n.stl")).string();
    const auto written = writeMeshFile(scene, file, MeshFormat::stl, problems);
    ASSERT_FALSE(written);
    EXPECT_THAT(written.error().text, testing::HasSubstr("shows no triangles"));
    EXPECT_FALSE(std::filesystem::exists(file));
}

}  // namespace
}  // namespace rtsg
