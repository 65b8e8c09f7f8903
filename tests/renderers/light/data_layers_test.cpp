// Layers of pictures beside colour, read back by OpenImageIO: places in closed form, names as Cryptomatte has them.
#include <unistd.h>

#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <string>

#include <OpenImageIO/imageio.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>

#include "image/image_files.h"
#include "picture/data_layers.h"
#include "renderers/light/light_scene.h"

namespace rtsg {
namespace {

using namespace test;

std::filesystem::path temporaryLayers(const std::string& name) {
    return std::filesystem::temp_directory_path() / fmt::format("rtsg_{}_{}", ::getpid(), name);
}

/// The content of a file by the names of its channels.
struct Exr {
    OIIO::ImageSpec spec;
    std::map<std::string, std::vector<float>> channels;
    std::vector<std::uint32_t> ids;
    explicit Exr(const std::filesystem::path& file) {
        auto input = OIIO::ImageInput::open(file.string());
        if (!input) {
            ADD_FAILURE() << OIIO::geterror();
            return;
        }
        spec = input->spec();
        const auto pixels = static_cast<std::size_t>(spec.width) * static_cast<std::size_t>(spec.height);
        for (int c = 0; c < spec.nchannels; ++c) {
            const std::string name = spec.channelnames[static_cast<std::size_t>(c)];
            std::vector<float>& values = channels[name];
            values.resize(pixels);
            EXPECT_TRUE(input->read_image(0, 0, c, c + 1, OIIO::TypeDesc::FLOAT, values.data()));
            if (name != "node.id") continue;
            EXPECT_EQ(spec.channelformat(c), OIIO::TypeDesc::UINT32);
            ids.resize(pixels);
            EXPECT_TRUE(input->read_image(0, 0, c, c + 1, OIIO::TypeDesc::UINT32, ids.data()));
        }
        std::filesystem::remove(file);
    }
    float at(const std::string& name, int x, int y) {
        const auto& values = channels[name];
        const auto index = static_cast<std::size_t>(y * spec.width + x);
        return index < values.size() ? values[index] : std::numeric_limits<float>::quiet_NaN();
    }
    std::uint32_t hash(const std::string& name, int x, int y) { return std::bit_cast<std::uint32_t>(at(name, x, y)); }
    std::string note(const std::string& key) { return spec.get_string_attribute(key); }
};

Exr written(LightScene& s, const char* name) {
    const auto file = temporaryLayers(name);
    EXPECT_TRUE(writePicture(s.picture(), file));
    return Exr(file);
}

// A ball of radius 1 at the origin is met 9 m before the eye at (0, 0, 10) in the middle; elsewhere by the quadratic
// equation of its sphere, in double. Beside it lies a wall at z = -5, and above nothing.
TEST(DataLayers, PlacesAreThoseOfClosedForms) {
    LightScene s(
        "DEF Ball Shape { appearance Appearance { material Material { diffuseColor .8 .4 .2 } } geometry "
        "Sphere { } }\n"
        "Transform { translation 0 -9.5 -5 children DEF Wall " +
            square(10, "material UnlitMaterial { emissiveColor .5 .25 1 }") + "}",
        41, 41);
    s.options.settings.layers = kAllLayers;
    Exr exr = written(s, "places.exr");
    ASSERT_EQ(exr.ids.size(), 41u * 41);
    int balls = 0, walls = 0, empty = 0;
    for (int y = 0; y < 41; ++y) {
        for (int x = 0; x < 41; ++x) {
            SCOPED_TRACE(fmt::format("{} {}", x, y));
            const Vec3d d = pixelDirection(x, y, 41, 41, 0.7854), eye(0, 0, 10);
            const double half = glm::dot(eye, d), root = half * half - (100 - 1);
            const double t = root > 0 ? -half - std::sqrt(root) : 15 / -d.z;
            const Vec3d position = eye + t * d;
            const bool nearEdge = std::abs(root) < 0.05 || std::abs(position.y - 0.5) < 0.05;
            const Vec3d seen(exr.at("P.X", x, y), exr.at("P.Y", x, y), exr.at("P.Z", x, y)),
                normal(exr.at("N.X", x, y), exr.at("N.Y", x, y), exr.at("N.Z", x, y));
            const std::uint32_t id = exr.ids[static_cast<std::size_t>(y * 41 + x)];
            if (nearEdge) continue;
            if (root > 0) {
                ++balls;
                EXPECT_EQ(id, s.node("Ball").value);
                EXPECT_NEAR(glm::length(seen - position), 0, 0.02) << "of a ball of triangles";
                EXPECT_GT(glm::dot(normal, position), 0.999);
                EXPECT_NEAR(exr.at("Z", x, y), 10 - position.z, 0.02);
                EXPECT_NEAR(exr.at("albedo.R", x, y), linearFromSrgb(Vec3f(.8f)).r, 1e-5);
            } else if (position.y < 0.5) {
                ++walls;
                EXPECT_EQ(id, s.node("Wall").value);
                EXPECT_NEAR(glm::length(seen - position), 0, 1e-4);
                EXPECT_NEAR(glm::length(normal - Vec3d(0, 0, 1)), 0, 1e-6);
                EXPECT_NEAR(exr.at("Z", x, y), 15, 1e-4) << "along the view, not along the ray";
                EXPECT_NEAR(exr.at("albedo.G", x, y), linearFromSrgb(Vec3f(.25f)).r, 1e-5);
            } else {
                ++empty;
                EXPECT_EQ(id, 0u);
                EXPECT_EQ(exr.at("Z", x, y), std::numeric_limits<float>::infinity());
                EXPECT_EQ(seen, Vec3d(0));
                EXPECT_EQ(exr.at("CryptoObject00.G", x, y), 0);
            }
        }
    }
    EXPECT_GT(balls, 10);
    EXPECT_GT(walls, 100);
    EXPECT_GT(empty, 100);
}

// Values of the reference implementation (Appleby), seed 0.
TEST(DataLayers, NamesAreHashedAsCryptomatteHasIt) {
    EXPECT_EQ(trace::murmurHash3(""), 0u);
    EXPECT_EQ(trace::murmurHash3("test"), 0xba6bd213u);
    EXPECT_EQ(trace::murmurHash3("Hello, world!"), 0xc0363e43u);
    EXPECT_EQ(trace::murmurHash3("The quick brown fox jumps over the lazy dog"), 0x2e4ff723u);
    // Exponents 0 and 255 are moved inwards, all else stays.
    EXPECT_EQ(std::bit_cast<std::uint32_t>(trace::cryptomatteId(0xba6bd213u)), 0xba6bd213u);
    EXPECT_EQ(std::bit_cast<std::uint32_t>(trace::cryptomatteId(0x00000001u)), 0x00800001u);
    EXPECT_EQ(std::bit_cast<std::uint32_t>(trace::cryptomatteId(0xffffffffu)), 0xff7fffffu);
}

std::uint32_t idOf(const std::string& name) {
    return std::bit_cast<std::uint32_t>(trace::cryptomatteId(trace::murmurHash3(name)));
}

// Two walls meet in the middle of the middle column: each covers half of its pixels, and the ranks say so. A Shape
// without a name has that of the group around it.
TEST(DataLayers, RanksTellWhoseShareOfAPixelIsWhat) {
    LightScene s(
        "DEF Left Transform { translation -10 0 0 children " + square(10, "material DEF Red Material { }") +
            "} DEF Group Group { children Transform { translation 10 0 0 children Shape { appearance DEF Matt "
            "Appearance { } geometry IndexedFaceSet { coordIndex [0 1 2 3 -1] coord Coordinate { point [-10 -10 0, 10 "
            "-10 0, 10 10 0, -10 10 0] } } } } }",
        33, 33);
    s.options.settings.layers = kObjects | kMaterials;
    s.options.settings.samplesPerPixel = 64;
    Exr exr = written(s, "ranks.exr");
    EXPECT_EQ(exr.channels.count("Z"), 0u) << "only what was asked for";
    EXPECT_EQ(exr.hash("CryptoObject00.R", 2, 16), idOf("Left"));
    EXPECT_EQ(exr.at("CryptoObject00.G", 2, 16), 1);
    EXPECT_EQ(exr.at("CryptoObject00.A", 2, 16), 0);
    EXPECT_EQ(exr.hash("CryptoObject00.R", 30, 16), idOf("Group"));
    EXPECT_EQ(exr.at("CryptoObject00.G", 16, 16), 0.5f);
    EXPECT_EQ(exr.at("CryptoObject00.A", 16, 16), 0.5f);
    EXPECT_NE(exr.hash("CryptoObject00.R", 16, 16), exr.hash("CryptoObject00.B", 16, 16));
    EXPECT_EQ(exr.at("CryptoObject02.A", 16, 16), 0);
    EXPECT_EQ(exr.hash("CryptoMaterial00.R", 2, 16), idOf("Red"));
    EXPECT_EQ(exr.hash("CryptoMaterial00.R", 30, 16), idOf("Matt"));
    const std::string key = fmt::format("cryptomatte/{:.7}", fmt::format("{:08x}", trace::murmurHash3("CryptoObject")));
    EXPECT_EQ(exr.note(key + "/name"), "CryptoObject");
    EXPECT_EQ(exr.note(key + "/hash"), "MurmurHash3_32");
    EXPECT_EQ(exr.note(key + "/conversion"), "uint32_to_float32");
    EXPECT_EQ(exr.note(key + "/manifest"),
              fmt::format("{{\"Group\":\"{:08x}\",\"Left\":\"{:08x}\"}}", idOf("Group"), idOf("Left")));
}

// Clear things are looked through, glass is not; a mirror is seen itself.
TEST(DataLayers, AreOfWhatHidesWhatIsBehind) {
    const struct {
        const char* name;
        std::string material;
        double depth;
    } cases[] = {
        {"clear", "material Material { transparency .6 }", 10},
        {"nearly opaque", "material Material { transparency .4 }", 8},
        {"glass", glass(1.5), 8},
        {"mirror", mirror("1"), 8},
    };
    for (const auto& c : cases) {
        SCOPED_TRACE(c.name);
        LightScene s("DEF Wall " + square(9, matte("1 1 1")) + "Transform { translation 0 0 2 children DEF Pane " +
                         square(9, c.material) + "}",
                     5, 5);
        s.options.settings.layers = kDepth | kNode;
        Exr exr = written(s, "clear.exr");
        EXPECT_NEAR(exr.at("Z", 2, 2), c.depth, 1e-5);
        ASSERT_EQ(exr.ids.size(), 25u);
        EXPECT_EQ(exr.ids[12], s.node(c.depth == 10 ? "Wall" : "Pane").value);
    }
}

// Reflecting and refracting surfaces are white in proportion, lamps at most white, and 300 faint layers hide nothing.
TEST(DataLayers, AlbedosAreSharesOfLight) {
    const struct {
        std::string material;
        double albedo;
    } cases[] = {
        {"material Material { diffuseColor .5 .5 .5 }", linearFromSrgb(Vec3f(.5f)).r},
        {mirror("1"), 1},
        {mirror(".25"), .25},
        {glass(1.5), 1},
        {"material Material { transparency 0 diffuseColor 0 0 0 metadata MetadataFloat { name \"refractiveIndex\" "
         "reference \"RTSG\" value 1.5 } }",
         .04},
        {unlit("4 4 4"), 1},
    };
    for (const auto& c : cases) {
        SCOPED_TRACE(c.material);
        LightScene s(square(9, c.material), 3, 3);
        s.options.settings.layers = kAlbedo;
        EXPECT_NEAR(written(s, "albedo.exr").at("albedo.R", 1, 1), c.albedo, 1e-4);
    }
    std::string sheets = "Transform { translation 0 0 1 children DEF L " +
                         square(5, "material UnlitMaterial { transparency .999 }") + "}";
    for (int i = 1; i < 300; ++i)
        sheets += fmt::format("Transform {{ translation 0 0 {} children USE L }}", 1 + i * .01);
    LightScene s(square(9, matte("1 1 1")) + sheets, 3, 3);
    s.options.settings.layers = kDepth;
    EXPECT_NEAR(written(s, "sheets.exr").at("Z", 1, 1), 10, 1e-4);
}

// Each layer of a LayerSet covers what is behind it, and shows what it does not cover.
TEST(DataLayers, LayersOfASceneCoverEachOther) {
    LightScene s("LayerSet { order [1 2] layers [ Layer { children [ Viewpoint { } DEF Back " +
                     square(20, matte("1 0 0")) +
                     "] } Layer { children [ Viewpoint { } DEF Front Transform { translation 0 0 3 children " +
                     square(1, matte("0 1 0")) + "} ] } ] }",
                 33, 33);
    s.options.settings.layers = kDepth | kObjects;
    Exr exr = written(s, "layers.exr");
    EXPECT_NEAR(exr.at("Z", 16, 16), 7, 1e-5);
    EXPECT_EQ(exr.hash("CryptoObject00.R", 16, 16), idOf("Front"));
    EXPECT_NEAR(exr.at("Z", 1, 1), 10, 1e-5);
    EXPECT_EQ(exr.hash("CryptoObject00.R", 1, 1), idOf("Back"));
}

TEST(DataLayers, FilesOfTwoRunsAreTheSameBytes) {
    const auto bytes = [](int threads) {
        LightScene s("DEF A Shape { geometry Sphere { } appearance Appearance { material Material { } } }", 40, 30);
        s.options.settings.layers = kAllLayers;
        s.options.settings.samplesPerPixel = 3;
        s.options.settings.threads = static_cast<unsigned>(threads);
        const auto file = temporaryLayers(fmt::format("bytes{}.exr", threads));
        EXPECT_TRUE(writePicture(s.picture(), file));
        std::ifstream in(file, std::ios::binary);
        std::string content{std::istreambuf_iterator<char>(in), {}};
        std::filesystem::remove(file);
        return content;
    };
    const std::string one = bytes(1);
    EXPECT_GT(one.size(), 1000u);
    EXPECT_EQ(one, bytes(2));
    // Two runs in one second would agree whatever the date.
    EXPECT_NE(one.find("1970:01:01 00:00:00"), std::string::npos);
}

/// The content that OpenImageIO finds in a file's bytes.
struct Found {
    OIIO::ImageSpec spec;
    std::vector<std::byte> pixels;
    explicit Found(const std::vector<unsigned char>& file) {
        const auto name = temporaryLayers("found.exr");
        std::ofstream(name, std::ios::binary)
            .write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
        auto input = OIIO::ImageInput::open(name.string());
        if (input) {
            spec = input->spec();
            pixels.resize(spec.image_bytes(true));
            EXPECT_TRUE(input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::UNKNOWN, pixels.data()))
                << input->geterror();
        }
        EXPECT_TRUE(input) << OIIO::geterror();
        std::filesystem::remove(name);
    }
    std::map<std::string, std::string> attributes() const {
        std::map<std::string, std::string> all;
        for (const auto& one : spec.extra_attribs) all[one.name().string()] = one.get_string();
        return all;
    }
};

// Written by OpenEXR itself a file holds what it holds when OpenImageIO writes it: channels of any name and both kinds,
// attributes, the same bits.
TEST(DataLayers, AreThoseThatOpenImageIoWrites) {
    const auto plain = plainEncoder(".exr");
    ASSERT_TRUE(plain) << plain.error().text;
    if (!*plain) GTEST_SKIP() << "built without OpenEXR's headers";
    for (const auto& [width, height] : {std::pair(1, 1), std::pair(37, 16), std::pair(61, 83)}) {
        const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
        std::vector<float> numbers(pixels * 7);
        for (std::size_t i = 0; i < numbers.size(); ++i)
            numbers[i] = std::bit_cast<float>(static_cast<std::uint32_t>(i * 2'654'435'761u) & 0xBF7F'FFFFu);
        Sheet sheet{.width = width, .height = height, .values = numbers.data()};
        for (const bool layers : {false, true}) {
            if (layers) {
                const std::string longName(100, 'n');
                sheet.channels = {{"Z", &numbers[4 * pixels], 1, false},
                                  {"node.id", &numbers[4 * pixels], 3, true},
                                  {longName, &numbers[4 * pixels + 1], 3, false},
                                  {"N.X", &numbers[4 * pixels + 2], 3, false}};
                sheet.notes = {{"cryptomatte/3ae39a5/manifest", "{\"Böx\":\"0f1d7942\"}"}, {longName, "text"}};
            }
            std::vector<unsigned char> own, again, others;
            ASSERT_EQ((*plain)(sheet, own), nullptr);
            ASSERT_EQ((*plain)(sheet, again), nullptr);
            EXPECT_EQ(own, again);
            ASSERT_EQ((*imageFiles())->encode("x.exr", sheet, others), "");
            const Found a(own), b(others);
            EXPECT_EQ(a.spec.channelnames, b.spec.channelnames);
            EXPECT_EQ(a.spec.channelformats, b.spec.channelformats);
            EXPECT_EQ(a.attributes(), b.attributes());
            EXPECT_GE(a.spec.nchannels, layers ? 8 : 4);
            EXPECT_TRUE(a.pixels == b.pixels) << width << " x " << height << " " << layers;
        }
    }
}

TEST(DataLayers, LeaveTheColoursAsTheyAre) {
    LightScene s("Shape { geometry Sphere { } appearance Appearance { material Material { } } } PointLight { }", 9, 7);
    const Picture plain = toLinear(s.picture());
    s.options.settings.layers = kAllLayers;
    const auto file = temporaryLayers("colours.exr");
    ASSERT_TRUE(writePicture(s.picture(), file));
    const auto read = readPicture(file);
    std::filesystem::remove(file);
    ASSERT_TRUE(read);
    EXPECT_EQ(read->pixels, plain.pixels);
}

/// The layer of motion after `change` of a scene whose first picture was there; in pixels to the right and up.
Exr movedSince(LightScene& s, const std::function<void()>& change, const char* name) {
    s.options.settings.layers = kMotion | kNode;
    Exr first = written(s, name);
    for (const char* channel : {"motion.X", "motion.Y"})
        for (const float value : first.channels[channel])
            EXPECT_EQ(value, 0) << "of the first picture nothing is known";
    change();
    return written(s, name);
}

// A plane 10 m away is half a picture wide for each 10 tan(.3927) m: one that has come .5 m to the right and .25 m up
// was that much to the left and below, everywhere alike; what rests beside it was where it is.
TEST(DataLayers, MotionOfAPlane) {
    constexpr int kSide = 40;
    LightScene s("DEF T Transform { children DEF Plane " + square(2, unlit("1 1 1")) +
                     "} Transform { translation 0 0 -10 children DEF Wall " + square(40, unlit("1 0 0")) + "}",
                 kSide, kSide);
    Exr exr = movedSince(
        s, [&] { ASSERT_TRUE(s.scene.set(s.node("T"), x3d::Transform::translation, Vec3f(.5f, .25f, 0))); },
        "plane.exr");
    const double pixels = kSide / (20 * std::tan(.7854 / 2));
    int planes = 0;
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x) {
            const bool plane = exr.ids[static_cast<std::size_t>(y * kSide + x)] == s.node("Plane").value;
            planes += plane;
            EXPECT_NEAR(exr.at("motion.X", x, y), plane ? -.5 * pixels : 0, 1e-4) << x << " " << y;
            EXPECT_NEAR(exr.at("motion.Y", x, y), plane ? -.25 * pixels : 0, 1e-4) << x << " " << y;
        }
    EXPECT_GT(planes, 50);
}

// An eye that turns to the left by a sees at angle b what was at b - a: all things alike, however far, and the sky too.
TEST(DataLayers, MotionOfATurningEye) {
    constexpr int kSide = 41;
    constexpr double kRotation = .1;
    LightScene s("DEF V Viewpoint { } Transform { translation 0 -5 0 children " + square(5, unlit("1 1 1")) + "}",
                 kSide, kSide);
    Exr exr = movedSince(
        s,
        [&] {
            ASSERT_TRUE(s.scene.set(s.node("V"), x3d::Viewpoint::orientation, Rotation{0, 1, 0, float(kRotation)}));
        },
        "turn.exr");
    const double t = std::tan(.7854 / 2);
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x) {
            // The pixel's direction, turned with the eye, in the axes that it had.
            const double u = (2 * (x + .5) / kSide - 1) * t, v = (1 - 2 * (y + .5) / kSide) * t;
            const Vec3d d(u * std::cos(kRotation) - std::sin(kRotation), v,
                          -u * std::sin(kRotation) - std::cos(kRotation));
            EXPECT_NEAR(exr.at("motion.X", x, y), (d.x / -d.z - u) / t * kSide / 2, 2e-4) << x << " " << y;
            EXPECT_NEAR(exr.at("motion.Y", x, y), (d.y / -d.z - v) / t * kSide / 2, 2e-4) << x << " " << y;
        }
}

// A zoom from one field of view to another moves what is seen along lines through the middle.
TEST(DataLayers, MotionOfAZoom) {
    constexpr int kSide = 20;
    LightScene s("DEF V Viewpoint { fieldOfView 1 }" + square(50, unlit("1 1 1")), kSide, kSide);
    Exr exr =
        movedSince(s, [&] { ASSERT_TRUE(s.scene.set(s.node("V"), x3d::Viewpoint::fieldOfView, .5f)); }, "zoom.exr");
    const double factor = std::tan(.25) / std::tan(.5) - 1;
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x) {
            EXPECT_NEAR(exr.at("motion.X", x, y), (x + .5 - kSide / 2.0) * factor, 1e-4);
            EXPECT_NEAR(exr.at("motion.Y", x, y), -(y + .5 - kSide / 2.0) * factor, 1e-4);
        }
}

// A deforming mesh moves corner by corner: in a square that is stretched to twice its width, outer corners move more.
TEST(DataLayers, MotionOfWhatDeforms) {
    constexpr int kSide = 40;
    LightScene s("Shape { appearance Appearance { " + unlit("1 1 1") +
                     " } geometry IndexedFaceSet { solid FALSE coordIndex [0 1 2 3 -1] coord DEF C Coordinate { point "
                     "[-1 -1 0, 1 -1 0, 1 1 0, -1 1 0] } } }",
                 kSide, kSide);
    Exr exr = movedSince(
        s,
        [&] {
            ASSERT_TRUE(s.scene.set(s.node("C"), x3d::Coordinate::point,
                                    Array<Vec3f>{{-2, -1, 0}, {2, -1, 0}, {2, 1, 0}, {-2, 1, 0}}));
        },
        "deform.exr");
    EXPECT_NEAR(exr.at("motion.X", 26, 20), -(26.5 - 20) / 2, 1e-3);
    EXPECT_NEAR(exr.at("motion.X", 14, 20), (20 - 14.5) / 2, 1e-3);
    EXPECT_NEAR(exr.at("motion.Y", 26, 20), 0, 1e-4);
    EXPECT_EQ(exr.at("motion.X", 2, 20), 0);
}

// All around the eye, the short way round.
TEST(DataLayers, MotionAllAround) {
    LightScene s("DEF V Viewpoint { position 0 0 0 } Shape { appearance Appearance { " + unlit("1 1 1") +
                     " } geometry Sphere { solid FALSE radius 5 } }",
                 40, 20);
    s.options.panorama = true;
    Exr exr = movedSince(
        s, [&] { ASSERT_TRUE(s.scene.set(s.node("V"), x3d::Viewpoint::orientation, Rotation{0, 1, 0, .3f})); },
        "around.exr");
    for (int y = 0; y < 20; ++y)
        for (int x = 0; x < 40; ++x) {
            EXPECT_NEAR(exr.at("motion.X", x, y), -.3 / (2 * kPi) * 40, 1e-3) << x << " " << y;
            EXPECT_NEAR(exr.at("motion.Y", x, y), 0, 1e-3) << x << " " << y;
        }
}

TEST(DataLayers, OnlyOpenExrHoldsThem) {
    LightScene s("Shape { geometry Box { } }", 8, 8);
    s.options.settings.layers = kDepth;
    EXPECT_FALSE(renderToFile(*s.light, temporaryLayers("no.png"), s.options));
    s.options.settings.layers = kAllLayers + 1;
    EXPECT_FALSE(s.light->picture(s.options));
}

}  // namespace
}  // namespace rtsg
