// Mesh files of a scene, read back by the importers: the same triangles at the same places.
#include <rtsg/renderers/mesh_file.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <rtsg/core/field_text.h>
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

/// A scene written as GLB and read again, at its beginning.
struct GlbAgain {
    Scene scene, again;
    std::string problems, file;
    std::size_t bytes = 0;

    explicit GlbAgain(const std::string& body) {
        Diagnostics reading("test"), writing("test");
        EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\n" + body, reading));
        for (const Diagnostic& d : reading.all()) ADD_FAILURE() << d.format();
        const std::string path =
            (std::filesystem::path(testing::TempDir()) / (std::to_string(::getpid()) + "g.glb")).string();
        EXPECT_TRUE(writeMeshFile(scene, path, MeshFormat::glb, writing));
        for (const Diagnostic& d : writing.all()) problems += d.format() + "\n";
        Diagnostics rereading(path);
        EXPECT_TRUE(loadFile(again, path, rereading));
        for (const Diagnostic& d : rereading.all()) ADD_FAILURE() << d.format();
        bytes = std::filesystem::file_size(path);
        std::ifstream in(path, std::ios::binary);
        file.assign(std::istreambuf_iterator<char>(in), {});
        std::filesystem::remove(path);
    }
    /// The value of a node's field as text.
    std::string text(const char* name, const char* field) const {
        const NodeId id = again.findName(name);
        if (!id) return "no node is named " + std::string(name);
        const Node& node = again.node(id);
        return printFieldText(node.value(node.type().findExact(field)));
    }
};

TEST(MeshFile, GlbHasViewpointsLightsAndWhatShines) {
    const GlbAgain g(
        "Transform { translation 1 2 3 children [\n"
        "DEF V Viewpoint { position 0 0 4 fieldOfView .5 description \"front\" }\n"
        "DEF P PointLight { location 0 1 0 color 1 .5 .25 intensity 3 radius 20 attenuation 0 0 1 }\n"
        "DEF D DirectionalLight { direction 1 0 0 intensity 2 }\n"
        "DEF S SpotLight { direction 0 -1 0 beamWidth .25 cutOffAngle .5 attenuation 0 0 1 } ] }\n"
        "Shape { appearance Appearance { material DEF U UnlitMaterial { emissiveColor 1 .5 0 } } geometry Box { } }\n"
        "Shape { appearance Appearance { material DEF L PhysicalMaterial { emissiveColor 8 4 0 } } geometry Sphere { } "
        "}");
    EXPECT_EQ(g.problems, "");
    const std::string dump = g.again.dump();
    EXPECT_THAT(dump, testing::HasSubstr("description \"front\""));
    EXPECT_THAT(dump, testing::HasSubstr("fieldOfView 0.5"));
    EXPECT_THAT(dump, testing::HasSubstr("PointLight"));
    EXPECT_THAT(dump, testing::HasSubstr("radius 20"));
    EXPECT_THAT(dump, testing::HasSubstr("cutOffAngle 0.5"));
    EXPECT_EQ(g.text("U", "emissiveColor"), "1 0.5 0");
    EXPECT_EQ(g.text("L", "emissiveColor"), "8 4 0");
    EXPECT_EQ(g.text("V", "translation"), "1 2 7") << "the node of a camera stands where its eye is";
    EXPECT_EQ(g.text("P", "translation"), "1 3 3");
    // A light along -z there shines along x here.
    EXPECT_EQ(g.text("D", "rotation"), "0 -1 0 1.5707964");
}

TEST(MeshFile, GlbHasTheClipsOfTransforms) {
    const std::string clip =
        "DEF Swing TimeSensor { cycleInterval 2 loop TRUE }\n"
        "DEF Turn OrientationInterpolator { key [0 1] keyValue [0 0 1 0, 0 0 1 1] }\n"
        "DEF Step PositionInterpolator { key [0 .5 .5 1] keyValue [0 0 0, 0 0 0, 1 0 0, 1 0 0] }\n"
        "DEF Paint ColorInterpolator { key [0 1] keyValue [0 0 0, 1 1 1] }\n"
        "DEF Outer Transform { translation 5 0 0 children DEF Arm Transform { center 0 1 0 children [\n"
        "  Transform { translation 0 3 0 children Shape { appearance Appearance { material DEF M Material { } } "
        "geometry "
        "Box { } } } DEF Eye Viewpoint { position 0 0 1 } ] } }\n"
        "ROUTE Swing.fraction_changed TO Turn.set_fraction\nROUTE Turn.value_changed TO Arm.rotation\n"
        "ROUTE Swing.fraction_changed TO Step.set_fraction\nROUTE Step.value_changed TO Arm.translation\n";
    GlbAgain g(clip);
    EXPECT_EQ(g.problems, "");
    EXPECT_EQ(g.text("Swing", "cycleInterval"), "2");
    EXPECT_EQ(g.text("Arm", "translation"), "0 1 0") << "its centre";
    const Sum before = sumOf(g.scene), after = sumOf(g.again);
    EXPECT_LT(glm::length(before.center - after.center), 1e-5);
    // It moves as it did: three quarters of the way, by either scene's clock.
    g.scene.newFrame(0), g.again.newFrame(0);
    for (Scene* scene : {&g.scene, &g.again}) {
        const NodeId clock = scene->findName("Swing");
        EXPECT_TRUE(scene->sendEvent(clock, scene->node(clock).type().findExact("startTime"), Value(Time{10})));
        scene->newFrame(10);
        scene->newFrame(11.5);
    }
    const Sum moved = sumOf(g.scene), movedToo = sumOf(g.again);
    EXPECT_GT(glm::length(moved.center - before.center), .5);
    EXPECT_LT(glm::length(moved.center - movedToo.center), 1e-5);
    const GlbAgain painted(clip +
                           "ROUTE Swing.fraction_changed TO Paint.set_fraction\n"
                           "ROUTE Paint.value_changed TO M.diffuseColor\n");
    EXPECT_THAT(painted.problems, testing::HasSubstr("1 things that clocks move are none of glTF's here"));
}

/// A picture of two by two pixels in red that is half there, as PNG.
const std::string kPicture =
    "data:image/png;base64,"
    "iVBORw0KGgoAAAANSUhEUgAAAAIAAAACCAYAAABytg0kAAAAEUlEQVR4nGP4z8DQAMIMMAYAOOgF/REzMMkAAAAASUVORK5CYII=";

std::string lookOf(const std::string& appearance, const char* geometry = "Box { }") {
    return "Shape { appearance Appearance { " + appearance + " } geometry " + geometry + " }\n";
}
constexpr const char* kTriangle =
    "IndexedFaceSet { coordIndex [0 1 2] coord Coordinate { point [0 0 0, 1 0 0, 0 1 0] } ";

TEST(MeshFile, GlbHoldsItsPicturesAndHowTheyAreLookedUp) {
    const std::string image = "ImageTexture { url [\"nowhere.png\" \"" + kPicture + "\"] ";
    const GlbAgain g(
        lookOf("material Material { } texture " + image +
                   "repeatS FALSE textureProperties TextureProperties { boundaryModeS \"CLAMP\" "
                   "boundaryModeT \"MIRRORED_REPEAT\" magnificationFilter \"NEAREST_PIXEL\" } } "
                   "textureTransform TextureTransform { scale 2 3 translation 1 0 }",
               (std::string(kTriangle) + "texCoord TextureCoordinate { point [0 0, 1 0, 0 1] } }").c_str()));
    EXPECT_EQ(g.problems, "");
    const std::string dump = g.again.dump();
    EXPECT_THAT(dump, testing::HasSubstr(kPicture));
    EXPECT_THAT(dump, testing::HasSubstr("boundaryModeS \"CLAMP_TO_EDGE\""));
    EXPECT_THAT(dump, testing::HasSubstr("boundaryModeT \"MIRRORED_REPEAT\""));
    EXPECT_THAT(dump, testing::HasSubstr("magnificationFilter \"NEAREST_PIXEL\""));
    EXPECT_THAT(dump, testing::HasSubstr("alphaMode \"BLEND\"")) << "its pixels are half there";
    EXPECT_THAT(dump, testing::HasSubstr("point [2 0, 4 0, 2 3]"));
    const GlbAgain masked(
        lookOf("alphaMode \"MASK\" alphaCutoff .25 material PhysicalMaterial { normalScale .5 normalTexture " + image +
               "} baseTexture " + image + "} }"));
    EXPECT_THAT(masked.again.dump(), testing::HasSubstr("alphaCutoff 0.25"));
    EXPECT_THAT(masked.again.dump(), testing::HasSubstr("normalScale 0.5"));
}

TEST(MeshFile, GlbHasColoursAsLightAndThoseOfPointsInPlaceOfTheMaterials) {
    const std::string colored = std::string(kTriangle) + "color Color { color [.5 .5 .5, 1 0 0, 0 1 0] } }";
    const GlbAgain plain(lookOf("material DEF M Material { diffuseColor .5 1 0 }"));
    EXPECT_THAT(plain.text("M", "baseColor"), testing::StartsWith("0.2140"));
    const GlbAgain points(lookOf("material DEF M Material { diffuseColor 0 0 1 transparency .5 }", colored.c_str()));
    EXPECT_EQ(points.text("M", "baseColor"), "1 1 1");
    EXPECT_THAT(points.again.dump(), testing::HasSubstr("color [0.2140"));
    EXPECT_THAT(points.again.dump(), testing::HasSubstr("1 0 0 0.5, 0 1 0 0.5]"));
    const GlbAgain physical(lookOf("material PhysicalMaterial { }", colored.c_str()));
    EXPECT_THAT(physical.again.dump(), testing::HasSubstr("color [0.5 0.5 0.5 1,"));
    const GlbAgain unlit(lookOf("material DEF M UnlitMaterial { emissiveColor .25 .5 .75 }"));
    EXPECT_THAT(unlit.text("M", "emissiveColor"), testing::StartsWith("0.25 0.5 0.7"));
}

/// A wavy field of so many points a side, in a shape; `type` is the geometry and what else it has.
std::string fieldOf(std::size_t side, const std::string& type) {
    std::string points, triangles;
    for (std::size_t i = 0; i < side * side; ++i)
        points += fmt::format("{} {} {},", i % side, std::sin(static_cast<double>(i % side)), i / side);
    for (std::size_t i = 0; i + side < side * side; ++i)
        if (i % side + 1 < side)
            triangles += fmt::format("{} {} {} {} {} {} ", i, i + side, i + 1, i + 1, i + side, i + side + 1);
    return fmt::format("Shape {{ geometry {} index [{}] coord Coordinate {{ point [{}] }} }} }}", type, triangles,
                       points);
}

TEST(MeshFile, GlbHasEachVertexOnceAndNoNormalsWhereFacesAreFlat) {
    constexpr std::size_t kSide = 100, kTriangles = 2 * (kSide - 1) * (kSide - 1);
    const GlbAgain flat(fieldOf(kSide, "IndexedTriangleSet { normalPerVertex FALSE"));
    EXPECT_LT(flat.bytes, 20 * kTriangles);
    EXPECT_FALSE(flat.file.contains("NORMAL"));
    const GlbAgain smooth(fieldOf(kSide, "IndexedTriangleSet { "));
    EXPECT_LT(smooth.bytes, 30 * kTriangles);
    EXPECT_TRUE(smooth.file.contains("NORMAL"));
    for (const GlbAgain* g : {&flat, &smooth}) {
        const Sum wanted = sumOf(g->scene), found = sumOf(g->again);
        EXPECT_EQ(found.triangles, kTriangles);
        EXPECT_NEAR(found.area, wanted.area, 1e-6 * wanted.area);
        EXPECT_LT(glm::length(found.center - wanted.center), 1e-4);
    }
    // Triangles that share no points in the scene share them in the file.
    const GlbAgain loose(
        "Shape { geometry TriangleSet { normalPerVertex FALSE coord Coordinate { point [0 0 0, 1 0 0, 0 1 0, 0 1 0, 1 "
        "0 "
        "0, 1 1 1] } } }");
    EXPECT_THAT(loose.file, testing::HasSubstr("\"count\":4,\"type\":\"VEC3\""));
    EXPECT_EQ(sumOf(loose.again).triangles, 2U);
}

TEST(MeshFile, GlbKeepsTextureCoordinatesThatTheAuthorGave) {
    const GlbAgain own(
        lookOf("material Material { }",
               (std::string(kTriangle) + "texCoord TextureCoordinate { point [0 0, .25 0, 0 1] } }").c_str()));
    EXPECT_THAT(own.again.dump(), testing::HasSubstr("point [0 0, 0.25 0, 0 1]"));
    const GlbAgain none(lookOf("material Material { }", (std::string(kTriangle) + "}").c_str()));
    EXPECT_FALSE(none.file.contains("TEXCOORD"));
}

TEST(MeshFile, GlbHasGlass) {
    const GlbAgain g(
        lookOf("material Material { transparency 1 diffuseColor 0 0 0 metadata MetadataSet { name \"RTSG\" value [ "
               "MetadataFloat { name \"refractiveIndex\" value 1.33 } "
               "MetadataFloat { name \"absorption\" value [.5 .25 0] } ] } }"));
    EXPECT_EQ(g.problems, "");
    const std::string dump = g.again.dump();
    EXPECT_THAT(dump, testing::HasSubstr("transparency 1"));
    EXPECT_THAT(dump, testing::ContainsRegex("\"refractiveIndex\"[^#]*value \\[1.33\\]"));
    EXPECT_THAT(dump, testing::ContainsRegex("value \\[0\\.(5|49999)[0-9]*,? 0\\.(25|2499)[0-9]*,? 0\\]"));
}

TEST(MeshFile, WhatIsNotInTheFileIsTold) {
    const std::string lines =
        "Shape { geometry IndexedLineSet { coordIndex [0 1] coord Coordinate { point [0 0 0, 1 1 1] } } }\n";
    const std::string points = "Shape { geometry PointSet { coord Coordinate { point [0 0 0] } } }\n";
    const GlbAgain sky("Background { }\nBackground { }\nFog { }\n" + lines + points + lookOf(""));
    EXPECT_EQ(sky.problems,
              "test: warning: left out of the file, which has none of these: Background (2), Fog, shapes of lines, "
              "shapes of points [picture]\n");
    const GlbAgain seen("NavigationInfo { headlight FALSE }\nPointLight { }\nBillboard { }\nLOD { }\n" + lookOf(""));
    EXPECT_THAT(seen.problems,
                testing::HasSubstr("Billboard, LOD, headlights that are off, lights that weaken otherwise"));
    const auto reported = [](const std::string& appearance) { return GlbAgain(lookOf(appearance)).problems; };
    EXPECT_THAT(reported("material Material { specularColor 1 1 1 }"), testing::HasSubstr("highlights of Materials"));
    EXPECT_THAT(reported("material Material { } backMaterial Material { diffuseColor 1 0 0 }"),
                testing::HasSubstr("materials of backs"));
    EXPECT_THAT(reported("material Material { } texture PixelTexture { image 1 1 3 0xff0000 }"),
                testing::HasSubstr("PixelTextures"));
    EXPECT_THAT(reported("material Material { } texture MultiTexture { texture [ImageTexture { url \"" + kPicture +
                         "\" } ImageTexture { url \"" + kPicture + "\" }] }"),
                testing::HasSubstr("MultiTextures but for their first picture"));
    EXPECT_THAT(reported("material Material { metadata MetadataSet { name \"RTSG\" value MetadataFloat { name "
                         "\"reflectivity\" value .5 } } }"),
                testing::HasSubstr("mirrors of metadata"));
    EXPECT_THAT(reported("material Material { } texture ImageTexture { url \"nowhere.png\" }"),
                testing::HasSubstr("nowhere.png"));
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
