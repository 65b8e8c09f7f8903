// How long sounds and films play, and how large pictures and Texts are, against headers written here.
#include <cmath>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/scene_builder.h>

#include "media/media_length.h"
#include "media/picture_size.h"

namespace rtsg {
namespace {

std::string number(std::uint64_t value, int size, bool big) {
    std::string bytes;
    for (int i = 0; i < size; ++i) bytes += static_cast<char>(value >> 8 * (big ? size - 1 - i : i) & 0xFF);
    return bytes;
}
std::string little(std::uint64_t value, int size) {
    return number(value, size, false);
}
std::string big(std::uint64_t value, int size) {
    return number(value, size, true);
}

std::string wave(int format, int channels, int rate, int bits, std::size_t bytes, const std::string& before = {},
                 std::uint64_t claimed = 0) {
    const int block = channels * bits / 8;
    return "RIFF" + little(36 + bytes, 4) + "WAVE" + before + "fmt " + little(16, 4) +
           little(std::uint64_t(format), 2) + little(std::uint64_t(channels), 2) + little(std::uint64_t(rate), 4) +
           little(std::uint64_t(rate * block), 4) + little(std::uint64_t(block), 2) + little(std::uint64_t(bits), 2) +
           "data" + little(claimed ? claimed : bytes, 4) + std::string(bytes, '\0');
}
std::optional<double> secondsOf(const std::string& bytes) {
    return mediaSeconds({bytes.size(), [&](std::uint64_t offset, std::size_t length) {
                             return offset < bytes.size() ? bytes.substr(offset, length) : std::string();
                         }});
}
std::string box(const std::string& name, const std::string& content) {
    return big(8 + content.size(), 4) + name + content;
}
std::string movie(std::uint64_t scale, std::uint64_t duration, int version) {
    const int size = version == 1 ? 8 : 4;
    const std::string head = big(std::uint64_t(version) << 24, 4) + big(1, size) + big(2, size) + big(scale, 4) +
                             big(duration, size) + std::string(80, '\0');
    return box("ftyp", "isomxxxx") + box("mdat", std::string(100, 'x')) +
           box("moov", box("udta", "") + box("mvhd", head));
}

TEST(MediaLength, IsWhatTheHeaderSays) {
    EXPECT_EQ(secondsOf(wave(1, 2, 44100, 16, 4 * 66150)), 1.5);
    EXPECT_EQ(secondsOf(wave(3, 1, 8000, 32, 4 * 2000)), .25);
    EXPECT_EQ(secondsOf(wave(1, 1, 8, 8, 9, "LIST" + little(3, 4) + "abc" + std::string(1, '\0'))), 1.125)
        << "an odd chunk before it is padded";
    EXPECT_EQ(secondsOf(wave(1, 1, 8, 8, 16, {}, 0xFFFFFFFF)), 2) << "a stream's length is what is there";
    EXPECT_EQ(secondsOf(wave(2, 1, 8000, 4, 100, "fact" + little(4, 4) + little(4000, 4))), .5) << "packed";
    EXPECT_EQ(secondsOf(movie(600, 1500, 0)), 2.5);
    EXPECT_EQ(secondsOf(movie(90'000, std::uint64_t{90'000} * 100'000, 1)), 1e5);
}

TEST(MediaLength, OfWhatSaysNothingNobodyKnows) {
    EXPECT_EQ(secondsOf(""), std::nullopt);
    EXPECT_EQ(secondsOf("OggS and so on, at length"), std::nullopt);
    EXPECT_EQ(secondsOf(wave(1, 1, 0, 8, 16)), std::nullopt) << "no rate";
    EXPECT_EQ(secondsOf(wave(1, 0, 8, 8, 16)), std::nullopt) << "no channels";
    EXPECT_EQ(secondsOf(movie(0, 10, 0)), std::nullopt);
    EXPECT_EQ(secondsOf(movie(1000, 0xFFFFFFFF, 0)), std::nullopt) << "not known";
    std::mt19937 random(1);
    for (const std::string& whole : {wave(1, 2, 100, 16, 40, "LIST" + little(4, 4) + "abcd"), movie(600, 1500, 1)})
        for (int i = 0; i < 20'000; ++i) {
            std::string broken = whole.substr(0, random() % (whole.size() + 1));
            for (int k = static_cast<int>(random() % 4); k > 0 && !broken.empty(); --k)
                broken[random() % broken.size()] = static_cast<char>(random());
            const auto seconds = secondsOf(broken);
            EXPECT_TRUE(!seconds || (std::isfinite(*seconds) && *seconds >= 0));
        }
}

TEST(MediaLength, IsAskedOfTheApplicationWhereNoHeaderIsKnown) {
    Scene scene;
    Diagnostics diagnostics("test");
    ASSERT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\nDEF A AudioClip { url \"data:audio/ogg,OggS-of-four\" }",
                         diagnostics));
    BuildOptions options;
    options.resources = Resources();
    std::string asked;
    options.mediaLength = [&](const Resource& file) -> std::optional<double> {
        asked += file.readAt(0, 100);
        return 4;
    };
    InlineLoader loader(scene, diagnostics, options);
    scene.newFrame(100);
    EXPECT_EQ(loader.update(), 1u);
    EXPECT_EQ(loader.update(), 0u);
    scene.newFrame(101);
    EXPECT_EQ(asked, "OggS-of-four");
    const Node& clip = scene.node(scene.findName("A"));
    EXPECT_EQ(clip.get(x3d::AudioClip::duration_changed).seconds, 4);
    EXPECT_FALSE(clip.get(x3d::AudioClip::isActive)) << "it ended at 4";
}

TEST(MediaLength, WhatHasNoneIsTold) {
    Scene scene;
    Diagnostics diagnostics("test");
    ASSERT_TRUE(loadText(scene, R"(#X3D V4.0 utf8
PROFILE Full
DEF A AudioClip { url [ "none.wav" "data:audio/ogg,OggS" ] }
DEF B AudioClip { url "none.wav" load FALSE }
DEF C BufferAudioSource { url "none.wav" buffer [ 0 1 ] }
DEF D AudioClip { }
)",
                         diagnostics));
    BuildOptions options;
    options.resources = Resources();
    InlineLoader loader(scene, diagnostics, options);
    scene.newFrame(100);
    loader.update();
    ASSERT_EQ(diagnostics.all().size(), 1u);
    const Diagnostic& reported = diagnostics.all()[0];
    EXPECT_EQ(reported.severity, Severity::warning);
    EXPECT_TRUE(reported.text.starts_with("AudioClip A never plays: 'none.wav' ")) << reported.text;
    EXPECT_TRUE(reported.text.ends_with("'data:audio/ogg,OggS' is no sound or film whose length can be told"))
        << reported.text;
    ASSERT_TRUE(scene.set(scene.findName("B"), x3d::AudioClip::load, true));
    scene.newFrame(101);
    loader.update();
    ASSERT_EQ(diagnostics.all().size(), 2u) << "asked for now";
    EXPECT_TRUE(diagnostics.all()[1].text.starts_with("AudioClip B never plays: "));
}

/// "width x height", or "none".
std::string pictureOf(const std::string& bytes) {
    const auto size = pictureSize({bytes.size(), [&](std::uint64_t offset, std::size_t length) {
                                       return offset < bytes.size() ? bytes.substr(offset, length) : std::string();
                                   }});
    return size ? std::to_string(size->width) + " x " + std::to_string(size->height) : "none";
}
std::string png(std::uint64_t width, std::uint64_t height) {
    return "\x89PNG\r\n\x1A\n" + number(13, 4, true) + "IHDR" + number(width, 4, true) + number(height, 4, true) +
           std::string(5, '\0');
}
std::string gif(std::uint64_t width, std::uint64_t height) {
    return "GIF89a" + number(width, 2, false) + number(height, 2, false) + std::string(3, '\0');
}
/// With a comment, a table and a fill byte before the frame.
std::string jpeg(std::uint64_t width, std::uint64_t height, char frame) {
    const auto segment = [](char marker, const std::string& content) {
        return std::string("\xFF") + marker + number(content.size() + 2, 2, true) + content;
    };
    return std::string("\xFF\xD8") + segment('\xFE', "a comment") + segment('\xC4', std::string(300, 'x')) + "\xFF" +
           segment(frame, "\x08" + number(height, 2, true) + number(width, 2, true) + "\x03...");
}

TEST(PictureSizes, AreReadOffTheHeaders) {
    EXPECT_EQ(pictureOf(png(70'000, 3)), "70000 x 3");
    EXPECT_EQ(pictureOf(gif(300, 5)), "300 x 5");
    EXPECT_EQ(pictureOf(jpeg(640, 480, '\xC0')), "640 x 480");
    EXPECT_EQ(pictureOf(jpeg(640, 480, '\xC2')), "640 x 480") << "progressive";
}

TEST(PictureSizes, OfWhatHasNoPixelsNobodyKnows) {
    EXPECT_EQ(pictureOf(""), "none");
    EXPECT_EQ(pictureOf("BM and so on, at quite some length"), "none");
    EXPECT_EQ(pictureOf(png(0, 3)), "none");
    EXPECT_EQ(pictureOf(gif(3, 0)), "none");
    EXPECT_EQ(pictureOf(jpeg(640, 480, '\xDA')), "none") << "the pixels begin before the frame";
    std::string comments = "\xFF\xD8";
    for (int i = 0; i < 5000; ++i) comments += std::string("\xFF\xFE\0\2", 4);
    EXPECT_EQ(pictureOf(comments + jpeg(6, 4, '\xC0').substr(2)), "none") << "too far behind";
    std::mt19937 random(1);
    for (const std::string& whole : {png(10, 20), gif(10, 20), jpeg(10, 20, '\xC0')})
        for (int i = 0; i < 20'000; ++i) {
            std::string broken = whole.substr(0, random() % (whole.size() + 1));
            for (int k = static_cast<int>(random() % 4); k > 0 && !broken.empty(); --k)
                broken[random() % broken.size()] = static_cast<char>(random());
            EXPECT_FALSE(pictureOf(broken).starts_with("0 ") || pictureOf(broken).ends_with(" 0"));
        }
}

TEST(TextSizes, AreAskedOfWhoKnowsFontsWhenTheyMayBeOthers) {
    Scene scene;
    Diagnostics diagnostics("test");
    ASSERT_TRUE(loadText(scene,
                         "#X3D V4.0 utf8\nPROFILE Full\nPROTO F [ ] { DEF S FontStyle { } }\n"
                         "Shape { geometry DEF A Text { string \"a\" fontStyle DEF P F { } } }\n"
                         "Shape { geometry DEF B Text { string \"b\" } }",
                         diagnostics));
    InlineLoader loader(scene, diagnostics);
    scene.newFrame(0);
    EXPECT_EQ(loader.update(), 0u) << "nobody knows fonts";
    std::string asked;
    loader.measureTexts([&](const Scene& s, const Node& text) {
        asked += s.name(text.id());
        return Array<float>{3, 2, -1, 5, 0, 3, 1, 2, 1};
    });
    EXPECT_EQ(loader.update(), 2u);
    scene.newFrame(1);
    EXPECT_EQ(asked, "AB");
    using T = x3d::Text;
    const Node& a = scene.node(scene.findName("A"));
    EXPECT_EQ(a.get(T::textBounds), Vec2f(3, 2));
    EXPECT_EQ(a.get(T::origin), Vec3f(-1, 5, 0));
    EXPECT_EQ(a.get(T::lineBounds), (Array<Vec2f>{{3, 1}, {2, 1}}));
    EXPECT_EQ(loader.update(), 0u) << "what was told asks nothing anew";
    EXPECT_EQ(asked, "AB");
    const NodeId style = scene.findName("S", scene.findName("P"));
    ASSERT_TRUE(scene.set(style, x3d::FontStyle::size, 2.0f));
    scene.newFrame(2);
    EXPECT_EQ(loader.update(), 0u) << "it was as large as before";
    EXPECT_EQ(asked, "ABA") << "the font style in the body of a PROTO is the first one's alone";
    ASSERT_TRUE(scene.set(scene.findName("B"), T::string, Array<String>{String("c")}));
    scene.newFrame(3);
    loader.update();
    EXPECT_EQ(asked, "ABAB");
}

TEST(TextSizes, AreNoneOfATextThatHasBeenEmptied) {
    Scene scene;
    Diagnostics diagnostics("test");
    ASSERT_TRUE(
        loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\nShape { geometry DEF A Text { string \"a\" } }", diagnostics));
    InlineLoader loader(scene, diagnostics);
    using T = x3d::Text;
    loader.measureTexts([](const Scene&, const Node& text) {
        return text.get(T::string).empty() ? Array<float>() : Array<float>{3, 2, -1, 5, 0, 3, 2};
    });
    const Node& a = scene.node(scene.findName("A"));
    double now = 0;
    const auto show = [&](Array<String> lines) {
        ASSERT_TRUE(scene.set(a.id(), T::string, lines));
        for (int i = 0; i < 2; ++i) scene.newFrame(++now), loader.update();
        scene.newFrame(++now);
    };
    show({String("b")});
    EXPECT_EQ(a.get(T::textBounds), Vec2f(3, 2));
    show({});
    EXPECT_EQ(a.get(T::textBounds), Vec2f(0));
    EXPECT_EQ(a.get(T::origin), Vec3f(0));
    EXPECT_TRUE(a.get(T::lineBounds).empty());
    show({String("c")});
    EXPECT_EQ(a.get(T::lineBounds), (Array<Vec2f>{{3, 2}}));
}

TEST(TextSizes, AreAskedOnlyWhereSomebodyMayHear) {
    Scene scene;
    Diagnostics diagnostics("test");
    ASSERT_TRUE(
        loadText(scene,
                 "#X3D V4.0 utf8\nPROFILE Full\n"
                 "Shape { geometry DEF A Text { string \"a\" } } Shape { geometry DEF B Text { string \"b\" } }\n"
                 "Shape { geometry DEF C Text { string \"c\" } } DEF M Transform { }\n"
                 "ROUTE A.origin TO M.translation",
                 diagnostics));
    InlineLoader loader(scene, diagnostics);
    std::string asked;
    loader.measureTexts(
        [&](const Scene& s, const Node& text) {
            asked += s.name(text.id());
            return Array<float>{3, 2, -1, static_cast<float>(asked.size()), 0, 3, 1};
        },
        InlineLoader::Texts::heard);
    const auto frame = [&] {
        scene.newFrame(scene.now() + 1);
        return loader.update();
    };
    using T = x3d::Text;
    EXPECT_EQ(frame(), 1u);
    EXPECT_EQ(asked, "A") << "its origin goes along a route";
    frame();
    EXPECT_EQ(scene.node(scene.findName("M")).get(x3d::Transform::translation), Vec3f(-1, 1, 0));
    const NodeId b = scene.findName("B"), c = scene.findName("C");
    ASSERT_TRUE(scene.set(b, T::string, Array<String>{String("longer")}));
    frame();
    EXPECT_EQ(asked, "A") << "whatever becomes of it nobody hears of it";
    EXPECT_TRUE(scene.node(b).isDefault(T::_measured.index));
    ASSERT_TRUE(scene.listenTo(b, T::textBounds.index));
    frame();
    EXPECT_EQ(asked, "AB");
    EXPECT_TRUE(frame() == 0 && scene.node(b).get(T::textBounds) == Vec2f(3, 2));
    scene.stopListening(b, T::textBounds.index);
    ASSERT_TRUE(scene.set(b, T::string, Array<String>{String("again")}));
    frame();
    EXPECT_EQ(asked, "AB") << "nobody listens any longer";
    // A Script may find any node by its name, and read what it says.
    ASSERT_TRUE(scene.createNode("Script"));
    frame();
    EXPECT_EQ(asked, "ABBC");
    EXPECT_EQ(scene.node(c).get(T::_measured).size(), 7u);
}

}  // namespace
}  // namespace rtsg
