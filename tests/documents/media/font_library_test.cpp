// FontLibrary (X3D 4.1): which file becomes its font, which styles it serves, what is refused, and what a run changes.
#include <fstream>

#include <gmock/gmock.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/scene_builder.h>

#include "core/scene_check.h"
#include "media/font_file.h"
#include "support/temp_folder.h"
#include "support/written_font.h"

namespace rtsg {
namespace {

using testing::HasSubstr;
using L = x3d::FontLibrary;

class FontLibraries : public testing::Test {
  protected:
    void write(const std::string& name, const std::string& bytes) {
        std::ofstream(folder / name, std::ios::binary) << bytes;
    }
    void load(const std::string& text) {
        write("main.x3dv", "#X3D V4.1 utf8\n" + text);
        ASSERT_TRUE(loadFile(scene, folder / "main.x3dv", diagnostics));
    }
    NodeId node(const char* name) const { return scene.findName(name); }
    std::string fontOf(const char* library) const {
        const Array<std::int32_t>& packed = scene.node(node(library)).get(L::_font);
        if (packed.empty()) return {};
        return {reinterpret_cast<const char*>(packed.data() + 1), static_cast<std::size_t>(packed[0])};
    }
    NodeId libraryOf(const char* style) const { return scene.node(node(style)).get(x3d::FontStyle::_library); }
    std::string problems() const { return test::allText(diagnostics); }

    const test::TempFolder own;
    const std::filesystem::path folder = own.path();
    const std::string font = test::WrittenFont().bytes();
    Scene scene;
    Diagnostics diagnostics;
};

TEST_F(FontLibraries, ServeTheStylesOfTheirFamilies) {
    write("box.ttf", font);
    load(R"(DEF LIB FontLibrary { family [ "Other" "Boxes" ] url "box.ttf" }
        Shape { geometry Text { fontStyle DEF B FontStyle { family "OTHER" } } }
        Shape { geometry Text { fontStyle DEF C FontStyle { family [ "SANS" "Boxes" ] } } }
        Shape { geometry Text { fontStyle DEF D ScreenFontStyle { family "Boxes" } } }
        Shape { geometry Text { fontStyle DEF E FontStyle { family "Box" } } }
        Shape { geometry Text { fontStyle DEF A FontStyle { family [ "Nowhere" "boxes" ] } } })");
    EXPECT_EQ(problems(), "");
    EXPECT_EQ(libraryOf("A"), node("LIB"));
    EXPECT_EQ(fontOf("LIB"), font);
    EXPECT_EQ(libraryOf("B"), node("LIB"));
    EXPECT_EQ(libraryOf("C"), NodeId{}) << "SANS stays as it is";
    EXPECT_EQ(scene.node(node("D")).get(x3d::ScreenFontStyle::_library), node("LIB"));
    EXPECT_EQ(libraryOf("E"), NodeId{});
}

TEST_F(FontLibraries, StayWithinTheirExecutionContext) {
    write("box.ttf", font);
    write("part.x3dv", "#X3D V4.1 utf8\nShape { geometry Text { fontStyle DEF S FontStyle { family \"Boxes\" } } }");
    load(R"(PROTO P [ ] { Group { children [ Shape { geometry Text { fontStyle DEF S FontStyle { family "Boxes" } } }
            DEF OWN FontLibrary { family "Boxes" url "box.ttf" } ] } }
        DEF I P { }
        DEF LIB FontLibrary { family "Boxes" url "box.ttf" }
        DEF J Inline { url "part.x3dv" })");
    EXPECT_EQ(problems(), "");
    const NodeId inside = scene.findName("OWN", node("I"));
    ASSERT_TRUE(inside);
    EXPECT_EQ(scene.node(scene.findName("S", node("I"))).get(x3d::FontStyle::_library), inside);
    EXPECT_EQ(scene.node(scene.findName("S", node("J"))).get(x3d::FontStyle::_library), NodeId{});
}

TEST_F(FontLibraries, TakeTheFirstUrlThatIsAFont) {
    write("box.ttf", font);
    write("page.ttf", "<html>not found</html>");
    write("short.ttf", font.substr(0, font.size() / 2));
    load("\nDEF LIB FontLibrary { family \"Boxes\" url [ \"gone.ttf\" \"page.ttf\" \"short.ttf\" \"box.ttf\" ] }");
    EXPECT_EQ(fontOf("LIB"), font);
    EXPECT_THAT(problems(), HasSubstr("main.x3dv:3:1: warning: FontLibrary LIB: 'gone.ttf' is not there"));
    EXPECT_THAT(problems(), HasSubstr("'page.ttf' is not used: it is no font"));
    EXPECT_THAT(problems(), HasSubstr("'short.ttf' is not used: its table"));
}

TEST_F(FontLibraries, WhatCannotBeHadIsAnErrorAtItsPlace) {
    const test::TempFolder elsewhere;
    std::ofstream(elsewhere.path() / "box.ttf", std::ios::binary) << font;
    load("\n\nDEF LIB FontLibrary { family \"Boxes\" url [ \"" + (elsewhere.path() / "box.ttf").string() +
         "\" \"https://example.org/box.ttf\" ] }");
    EXPECT_EQ(fontOf("LIB"), "");
    EXPECT_THAT(problems(), HasSubstr("main.x3dv:4:1: error: FontLibrary LIB: "));
    EXPECT_THAT(problems(), HasSubstr("https://example.org/box.ttf"));
}

TEST_F(FontLibraries, TellOnceWhatIsNotThere) {
    load(R"(DEF LIB FontLibrary { family "Boxes" url "gone.ttf" })");
    EXPECT_EQ(diagnostics.errors(), 1u) << problems();
    BuildOptions options;
    options.file = folder / "main.x3dv";
    InlineLoader loader(scene, diagnostics, options);
    for (const double t : {1, 2}) scene.newFrame(t), loader.update();
    EXPECT_EQ(diagnostics.errors(), 1u) << problems();
    ASSERT_TRUE(scene.set(node("LIB"), L::url, Array<String>{"lost.ttf"}));
    for (const double t : {3, 4}) scene.newFrame(t), loader.update();
    EXPECT_EQ(diagnostics.errors(), 2u) << problems();
}

TEST_F(FontLibraries, FollowARun) {
    write("box.ttf", font);
    test::WrittenFont wider;
    wider.right = 650;
    write("wide.ttf", wider.bytes());
    load(R"(DEF LIB FontLibrary { family "Boxes" url "box.ttf" load FALSE }
        DEF T Shape { geometry Text { fontStyle DEF S FontStyle { family "Boxes" } } }
        DEF W LoadSensor { children USE LIB })");
    BuildOptions options;
    options.file = folder / "main.x3dv";
    InlineLoader loader(scene, diagnostics, options);
    double now = 0;
    const auto frame = [&] {
        scene.newFrame(++now);
        loader.update();
        scene.newFrame(++now);
        loader.update();
        scene.newFrame(++now);
    };
    const auto isLoaded = [&] { return scene.node(node("W")).get(x3d::LoadSensor::isLoaded); };
    frame();
    EXPECT_EQ(fontOf("LIB"), "");
    EXPECT_EQ(libraryOf("S"), NodeId{});
    ASSERT_TRUE(scene.set(node("LIB"), L::load, true));
    frame();
    EXPECT_EQ(fontOf("LIB"), font);
    EXPECT_EQ(libraryOf("S"), node("LIB"));
    EXPECT_TRUE(isLoaded());
    ASSERT_TRUE(scene.set(node("LIB"), L::url, Array<String>{"wide.ttf"}));
    frame();
    EXPECT_EQ(fontOf("LIB"), wider.bytes());
    ASSERT_TRUE(scene.set(node("LIB"), L::family, Array<String>{"Wide"}));
    frame();
    EXPECT_EQ(libraryOf("S"), NodeId{});
    ASSERT_TRUE(scene.set(node("S"), x3d::FontStyle::family, Array<String>{"wide"}));
    frame();
    EXPECT_EQ(libraryOf("S"), node("LIB"));
    ASSERT_TRUE(scene.set(node("LIB"), L::url, Array<String>{"gone.ttf"}));
    frame();
    EXPECT_EQ(fontOf("LIB"), "");
    EXPECT_EQ(libraryOf("S"), NodeId{});
    EXPECT_FALSE(isLoaded());
    EXPECT_THAT(problems(), HasSubstr("'gone.ttf' is not there"));
}

// Directories of tables that lie: none is taken for a font, and nothing is read beyond the end.
TEST(FontFile, DamageIsSeen) {
    const std::string whole = test::WrittenFont().bytes();
    std::string why;
    EXPECT_TRUE(detail::isFontFile(whole, why)) << why;
    for (std::size_t size = 0; size + 4 < whole.size(); ++size)
        EXPECT_FALSE(detail::isFontFile(whole.substr(0, size), why)) << size;
    const auto with = [&](std::size_t at, std::string_view bytes) {
        std::string changed = whole;
        changed.replace(at, bytes.size(), bytes);
        return detail::isFontFile(changed, why);
    };
    EXPECT_FALSE(with(4, std::string_view("\0\0", 2))) << "no tables";
    EXPECT_FALSE(with(4, "\xFF\xFF")) << "more than there is room for";
    EXPECT_FALSE(with(12, "cmaq"));
    EXPECT_EQ(why, "it has no table 'cmap'");
    EXPECT_FALSE(with(12 + 16, "glyg"));
    EXPECT_EQ(why, "it has no outlines");
    EXPECT_FALSE(with(12 + 8, "\xFF\xFF\xFF\xFF")) << "an offset of a table";
    EXPECT_FALSE(with(12 + 12, "\xFF\xFF\xFF\xFF")) << "a length of a table";
}

// FreeType takes as much memory as the head of such a file says that it has unpacked.
TEST(FontFiles, HeadsThatPromiseMoreThanThereIsAreNotBelieved) {
    const auto put = [](std::string& to, std::uint64_t number, int bytes) {
        for (int i = bytes - 1; i >= 0; --i) to += static_cast<char>(number >> (8 * i) & 255);
    };
    const auto woff = [&](const std::string& kind, std::uint64_t unpacked) {
        std::string file = kind;
        put(file, 0x00010000, 4), put(file, 200, 4), put(file, 0, 4), put(file, unpacked, 4);
        file.resize(200);
        return file;
    };
    std::string why;
    EXPECT_FALSE(detail::isFontFile(woff("wOFF", 0x70000000), why));
    EXPECT_THAT(why, HasSubstr("its head says 1879048192 bytes unpacked"));
    EXPECT_FALSE(detail::isFontFile(woff("wOFF", 1'000'000), why));
    EXPECT_THAT(why, HasSubstr("its head says 1000000 bytes unpacked"));
    EXPECT_FALSE(detail::isFontFile(woff("wOF2", 0x70000000), why));
    EXPECT_THAT(why, HasSubstr("bytes unpacked"));
    EXPECT_TRUE(detail::isFontFile(woff("wOF2", 1'000'000), why)) << why;
}

}  // namespace
}  // namespace rtsg
