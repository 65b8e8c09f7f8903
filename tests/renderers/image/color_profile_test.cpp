// Colour profiles in image files: what is sRGB by its primaries and its curve is none to speak of; others are named.
#include "image/color_profile.h"

#include <array>
#include <cmath>
#include <fstream>
#include <functional>

#include <gmock/gmock.h>
#include <zlib.h>

#include <rtsg/documents/loader.h>
#include <rtsg/renderers/light_renderer.h>

#include "support/temp_folder.h"

namespace rtsg {
namespace {

using FileText = std::string;

FileText big(std::uint32_t number, int size) {
    FileText result;
    for (int shift = 8 * size - 8; shift >= 0; shift -= 8) result += static_cast<char>(number >> shift);
    return result;
}
FileText fixed(double number) {
    return big(static_cast<std::uint32_t>(static_cast<std::int32_t>(std::lround(number * 65536))), 4);
}

using Primaries = std::array<std::array<double, 3>, 3>;
// CIE XYZ of red, green and blue, adapted to D50: sRGB's own profile, Adobe RGB (1998), Display P3.
constexpr Primaries kSrgb{{{.43607, .22249, .01392}, {.38515, .71687, .09708}, {.14307, .06061, .71410}}};
constexpr Primaries kAdobe{{{.60974, .31111, .01947}, {.20528, .62567, .06087}, {.14919, .06322, .74457}}};
constexpr Primaries kP3{{{.51512, .24120, -.00105}, {.29198, .69225, .04189}, {.15710, .06657, .78407}}};

const FileText kSrgbCurve = FileText("para\0\0\0\0\0\3\0\0", 12) + fixed(2.4) + fixed(1 / 1.055) + fixed(.055 / 1.055) +
                            fixed(1 / 12.92) + fixed(.04045);
FileText gamma(double power) {
    return FileText("curv\0\0\0\0\0\0\0\1", 12) + big(static_cast<std::uint32_t>(std::lround(power * 256)), 2);
}
/// By 256 numbers.
FileText tabulated(const std::function<double(double)>& light) {
    FileText result("curv\0\0\0\0\0\0\1\0", 12);
    for (int i = 0; i < 256; ++i) result += big(static_cast<std::uint32_t>(std::lround(65535 * light(i / 255.0))), 2);
    return result;
}
FileText described(const std::string& name, bool inUnicode) {
    if (!inUnicode)
        return FileText("desc\0\0\0\0", 8) + big(static_cast<std::uint32_t>(name.size() + 1), 4) + name +
               FileText(1, '\0');
    FileText text;
    for (const char letter : name) text += big(static_cast<std::uint8_t>(letter), 2);
    return FileText("mluc\0\0\0\0\0\0\0\1\0\0\0\14enUS", 20) + big(static_cast<std::uint32_t>(text.size()), 4) +
           big(28, 4) + text;
}

FileText profile(const std::string& space, const std::vector<std::pair<std::string, FileText>>& tags) {
    FileText head(128, '\0'), table = big(static_cast<std::uint32_t>(tags.size()), 4), content;
    head.replace(16, 4, space), head.replace(36, 4, "acsp");
    const std::size_t first = 132 + 12 * tags.size();
    for (const auto& [name, bytes] : tags) {
        table += name + big(static_cast<std::uint32_t>(first + content.size()), 4) +
                 big(static_cast<std::uint32_t>(bytes.size()), 4);
        content += bytes;
    }
    return head + table + content;
}
FileText rgbProfile(const std::string& name, const Primaries& primaries, const FileText& curve,
                    bool inUnicode = false) {
    std::vector<std::pair<std::string, FileText>> tags{{"desc", described(name, inUnicode)}};
    for (std::size_t i = 0; i < 3; ++i) {
        const std::string color(1, "rgb"[i]);
        FileText xyz("XYZ \0\0\0\0", 8);
        for (const double number : primaries[i]) xyz += fixed(number);
        tags.emplace_back(color + "XYZ", xyz), tags.emplace_back(color + "TRC", curve);
    }
    return profile("RGB ", tags);
}

FileText chunk(const std::string& type, const FileText& content) {
    const FileText named = type + content;
    const auto sum = crc32(0, reinterpret_cast<const Bytef*>(named.data()), static_cast<uInt>(named.size()));
    return big(static_cast<std::uint32_t>(content.size()), 4) + named + big(static_cast<std::uint32_t>(sum), 4);
}
FileText packed(const FileText& content) {
    uLongf length = compressBound(content.size());
    FileText result(length, '\0');
    compress(reinterpret_cast<Bytef*>(result.data()), &length, reinterpret_cast<const Bytef*>(content.data()),
             content.size());
    return result.substr(0, length);
}
/// One grey-blue pixel.
FileText pngWith(const FileText& icc) {
    const FileText head = big(1, 4) + big(1, 4) + FileText("\x08\x02\0\0\0", 5);
    return FileText("\x89PNG\r\n\x1A\n") + chunk("IHDR", head) +
           chunk("iCCP", FileText("in the file\0\0", 13) + packed(icc)) +
           chunk("IDAT", packed(FileText("\0\x50\x60\x70", 4))) + chunk("IEND", "");
}
/// In two segments; no picture follows.
FileText jpegWith(const FileText& icc) {
    FileText file("\xFF\xD8\xFF\xE0\0\4JF", 8);
    const std::size_t half = icc.size() / 2;
    for (int part = 0; part < 2; ++part) {
        const FileText content = FileText("ICC_PROFILE\0", 12) + static_cast<char>(part + 1) + '\2' +
                                 (part == 0 ? icc.substr(0, half) : icc.substr(half));
        file += "\xFF\xE2" + big(static_cast<std::uint32_t>(content.size() + 2), 2) + content;
    }
    return file + FileText("\xFF\xDA\0\2", 4);
}
FileText webpWith(const FileText& icc) {
    const auto little = [](std::size_t number) {
        FileText result;
        for (int shift = 0; shift < 32; shift += 8) result += static_cast<char>(number >> shift);
        return result;
    };
    const FileText before = "VP8X" + little(10) + FileText(10, '\0');
    return "RIFF" + little(4 + before.size() + 8 + icc.size()) + "WEBP" + before + "ICCP" + little(icc.size()) + icc;
}
std::string namedIn(const FileText& file) {
    return foreignColorProfile({reinterpret_cast<const std::uint8_t*>(file.data()), file.size()});
}

TEST(ColorProfile, OthersThanSrgbAreNamedInEveryFormat) {
    const FileText adobe = rgbProfile("Adobe RGB (1998)", kAdobe, gamma(2.2));
    EXPECT_EQ(namedIn(pngWith(adobe)), "Adobe RGB (1998)");
    EXPECT_EQ(namedIn(jpegWith(adobe)), "Adobe RGB (1998)");
    EXPECT_EQ(namedIn(webpWith(adobe)), "Adobe RGB (1998)");
    EXPECT_EQ(namedIn(pngWith(rgbProfile("Display P3", kP3, kSrgbCurve, true))), "Display P3");
}

TEST(ColorProfile, WhatIsSrgbByItsNumbersIsNotNamedWhateverItIsCalled) {
    const auto decoded = [](double x) { return x <= .04045 ? x / 12.92 : std::pow((x + .055) / 1.055, 2.4); };
    for (const FileText& curve : {kSrgbCurve, gamma(2.2), tabulated(decoded)}) {
        EXPECT_EQ(namedIn(pngWith(rgbProfile("c2", kSrgb, curve))), "");
        EXPECT_EQ(namedIn(pngWith(profile("GRAY", {{"kTRC", curve}}))), "");
    }
}

TEST(ColorProfile, CurvesCountAsWellAsPrimaries) {
    EXPECT_EQ(namedIn(pngWith(rgbProfile("linear sRGB", kSrgb, gamma(1)))), "linear sRGB");
    EXPECT_EQ(namedIn(pngWith(rgbProfile("sRGB 1.8", kSrgb, gamma(1.8), true))), "sRGB 1.8");
    EXPECT_EQ(namedIn(pngWith(rgbProfile("even", kSrgb, FileText("curv\0\0\0\0\0\0\0\0", 12)))), "even");
    EXPECT_EQ(namedIn(pngWith(profile("GRAY", {{"kTRC", gamma(1)}}))), "without a name");
    EXPECT_EQ(namedIn(jpegWith(profile("CMYK", {}))), "of inks");
}

TEST(ColorProfile, OfTablesItsNameDecides) {
    EXPECT_EQ(namedIn(pngWith(profile("RGB ", {{"desc", described("sRGB v4 preference", true)}}))), "");
    EXPECT_EQ(namedIn(pngWith(profile("RGB ", {{"desc", described("a scanner", true)}}))), "a scanner");
}

TEST(ColorProfile, DamagedOnesAreLookedAtNoFurther) {
    for (const FileText& whole :
         {pngWith(rgbProfile("Adobe", kAdobe, kSrgbCurve)), jpegWith(rgbProfile("Adobe", kAdobe, gamma(2))),
          webpWith(rgbProfile("Adobe", kAdobe, gamma(2), true))}) {
        EXPECT_EQ(namedIn(whole), "Adobe");
        for (std::size_t length = 0; length < whole.size(); ++length) namedIn(whole.substr(0, length));
        std::uint32_t random = 1;
        for (int i = 0; i < 4000; ++i) {
            FileText other = whole;
            random = random * 1664525 + 1013904223;
            other[random / 7 % other.size()] = static_cast<char>(random >> 24);
            namedIn(other);
        }
    }
    const FileText tag = profile(
        "RGB ", {{"desc", FileText("mluc")}, {"rXYZ", FileText("XYZ ")}, {"rTRC", FileText("para\0\0\0\0\0\4", 10)}});
    EXPECT_EQ(namedIn(pngWith(tag)), "without a name");
}

/// The reports of a picture of a scene with such a texture as its Material's `field`.
std::vector<std::string> saidOf(const FileText& icc, const std::string& field) {
    const test::TempFolder folder;
    const auto file = folder.path() / "main.x3dv";
    std::ofstream(folder.path() / "a.png", std::ios::binary) << pngWith(icc);
    std::ofstream(file) << "#X3D V4.0 utf8\nPROFILE Full\nShape { appearance Appearance { material Material {\n  " +
                               field + " ImageTexture { url \"a.png\" } } }\n geometry Box { } }";
    Scene scene;
    Diagnostics loading;
    LoadOptions options;
    options.resources = Resources::ofFile(file);
    EXPECT_TRUE(loadFile(scene, file, loading, options));
    EXPECT_EQ(loading.all().size(), 0u);
    SharedWorld world(scene);
    LightRenderer light(world, LightRenderer::Options(*options.resources));
    std::vector<std::string> result;
    for (const double t : {0.0, 1.0}) {
        scene.newFrame(t);
        EXPECT_TRUE(light.picture(ImageOptions()));
    }
    for (const Diagnostic& d : light.diagnostics().all()) result.push_back(std::to_string(d.where.line) + " " + d.text);
    return result;
}

TEST(ColorProfile, WhatIsNotAppliedIsSaidOnce) {
    const FileText adobe = rgbProfile("Adobe RGB (1998)", kAdobe, gamma(2.2));
    const auto said = saidOf(adobe, "diffuseTexture");
    ASSERT_EQ(said.size(), 1u);
    EXPECT_THAT(said[0], testing::StartsWith("4 ImageTexture takes the colours of its picture for those of sRGB"));
    EXPECT_THAT(said[0], testing::HasSubstr("a.png: Adobe RGB (1998)"));
    EXPECT_THAT(saidOf(rgbProfile("c2", kSrgb, kSrgbCurve), "diffuseTexture"), testing::IsEmpty());
    EXPECT_THAT(saidOf(adobe, "normalTexture"), testing::IsEmpty());  // numbers, no colours
}

}  // namespace
}  // namespace rtsg
