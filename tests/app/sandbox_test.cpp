// Files that take over the library that decodes them: what the program says of them, and that nothing else is touched.
#include "program.h"

#include <csignal>
#include <cstdlib>

#include <gmock/gmock.h>

#include <rtsg/core/sandbox.h>

#include "sandbox_paths.h"
#include "support/written_font.h"

namespace rtsg::test {
namespace {

using testing::HasSubstr;
using testing::Not;

/// The head of a PNG file of one pixel, and what the reader is to do.
std::string picture(const std::string& order) {
    using namespace std::string_literals;
    return "\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\1\0\0\0\1\x08\2\0\0\0"s + order;
}

class Hostile : public CommandLine {
  protected:
    void SetUp() override {
        if (const char* const paths = std::getenv("LD_LIBRARY_PATH")) before_ = paths;
        ::setenv("LD_LIBRARY_PATH", (RTSG_HOSTILE_LIBRARIES ":" + before_).c_str(), 1);
    }
    void TearDown() override { ::setenv("LD_LIBRARY_PATH", before_.c_str(), 1); }

    /// Draws squares with these pictures beside each other, 8 pixels each.
    Outcome draw(const std::vector<std::string>& pictures, const std::vector<std::string>& more = {}) {
        std::string text =
            "#X3D V4.0 utf8\nPROFILE Full\nOrthoViewpoint { position 0 0 9 fieldOfView [ -1 -1 1 1 ] }\n";
        for (std::size_t i = 0; i < pictures.size(); ++i) {
            const std::string name = std::to_string(i) + ".png";
            writeFile(folder / name, pictures[i]);
            text += "Transform { translation " + std::to_string(2 * i) +
                    " 0 0 children Shape { appearance Appearance { material UnlitMaterial { } texture ImageTexture { "
                    "url \"" +
                    name + "\" } } geometry Rectangle2D { size 2 2 } } }\n";
        }
        writeFile(file, text);
        std::vector<std::string> words{"render", file, "-o", folder / "out.ppm", "--size", "8x8"};
        words.insert(words.end(), more.begin(), more.end());
        return rtsg(words);
    }
    /// The last pixel, as red, green and blue.
    std::vector<int> lastPixel() {
        const std::string bytes = readFile(folder / "out.ppm");
        if (bytes.size() < 3) return {};
        std::vector<int> result;
        for (std::size_t i = bytes.size() - 3; i < bytes.size(); ++i)
            result.push_back(static_cast<unsigned char>(bytes[i]));
        return result;
    }

  private:
    std::string before_;
};

TEST_F(Hostile, ALibraryThatIsTakenOverMayDoNothing) {
    if (const auto started = startSandbox(); !started) GTEST_SKIP() << started.error().text;
    const Outcome outcome = draw({picture("look")});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(lastPixel(), (std::vector<int>{0, 255, 0})) << outcome.err;
    // The same reader has all rights in the process itself.
    const Outcome trusted = draw({picture("look")}, {"--trust"});
    EXPECT_EQ(lastPixel(), (std::vector<int>{255, 0, 0})) << trusted.err;
}

TEST_F(Hostile, ACrashIsAnErrorOfThatFile) {
    const Outcome outcome = draw({picture("look"), picture("crash"), picture("look ")});
    EXPECT_EQ(lastPixel(), (std::vector<int>{0, 255, 0})) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("1.png: it breaks the library that reads it (Segmentation fault)"));
    EXPECT_THAT(outcome.err, Not(HasSubstr("0.png")));
    EXPECT_THAT(outcome.err, Not(HasSubstr("2.png")));
    EXPECT_EQ(draw({picture("crash")}, {"--trust"}).status, 128 + SIGSEGV);
}

TEST_F(Hostile, SizesThatAreNotThoseOfThePixelsAreAnError) {
    const Outcome outcome = draw({picture("look lie")});
    EXPECT_THAT(outcome.err, HasSubstr("0.png: the library that reads it is broken"));
}

class Decoded : public CommandLine {
  protected:
    /// What a verb writes, as it is and with --trust.
    void expectSame(std::vector<std::string> words, const std::string& result) {
        words.insert(words.end(), {"-o", folder / result});
        const Outcome first = rtsg(words);
        EXPECT_EQ(first.status, 0) << first.err;
        const std::string bytes = readFile(folder / result);
        words.emplace_back("--trust");
        const Outcome second = rtsg(words);
        EXPECT_EQ(second.err, first.err);
        EXPECT_FALSE(bytes.empty());
        EXPECT_EQ(readFile(folder / result), bytes) << words[1];
    }
    static std::string textured(const std::string& picture) {
        return "#X3D V4.0 utf8\nPROFILE Full\nViewpoint { position 0 0 4 }\nShape { appearance Appearance { material "
               "UnlitMaterial { } texture ImageTexture { url \"" +
               picture + "\" } } geometry Rectangle2D { } }\n";
    }
};

TEST_F(Decoded, PicturesOfAllKindsAreTheSameInTheSandbox) {
    for (const char* kind : {".png", ".jpg", ".exr", ".tif", ".webp", ".bmp", ".tga", ".hdr", ".ppm"}) {
        const std::string picture = std::string("picture") + kind;
        ASSERT_EQ(rtsg({"render", file, "-o", folder / picture, "--size", "300x300"}).status, 0) << kind;
        const std::string scene = folder / "textured.x3dv";
        writeFile(scene, textured(picture));
        expectSame({"render", scene, "--size", "32x32"}, "out.ppm");
    }
}

TEST_F(Decoded, FilmsAndTheirSoundAreTheSameInTheSandbox) {
    writeFile(
        file,
        "#X3D V4.0 utf8\nPROFILE Full\nViewpoint { position 0 0 4 }\nDEF T Transform { children Shape { appearance "
        "Appearance { material UnlitMaterial { emissiveColor 1 .5 0 } } geometry Box { } } }\nDEF K TimeSensor { "
        "loop TRUE }\nDEF I OrientationInterpolator { key [ 0 1 ] keyValue [ 0 1 0 0 0 1 0 3 ] }\nROUTE "
        "K.fraction_changed TO I.set_fraction\nROUTE I.value_changed TO T.rotation\n"
        "AudioDestination { gain .5 children OscillatorSource { } }\n");
    const std::vector<std::string> run{"run", file, "--for", "1s", "--fps", "10", "--size", "64x48", "--rays", "10"};
    for (const std::string film : {"film.mp4", "film.gif"}) {
        std::vector<std::string> words = run;
        words.insert(words.end(), {"--render", folder / film});
        if (film == "film.mp4") words.insert(words.end(), {"--listen", folder / film});
        const Outcome outcome = rtsg(words);
        ASSERT_EQ(outcome.status, 0) << outcome.err;
        const std::string scene = folder / "shown.x3dv";
        writeFile(scene,
                  "#X3D V4.0 utf8\nPROFILE Full\nViewpoint { position 0 0 4 }\nShape { appearance Appearance { "
                  "material UnlitMaterial { } texture DEF M MovieTexture { loop TRUE url \"" +
                      film + "\" } } geometry Rectangle2D { size 2 2 } }\nSound { spatialize FALSE source USE M }\n");
        expectSame({"render", scene, "--size", "32x32", "--frames", "12", "--fps", "7"}, "out.gif");
        if (film == "film.mp4") expectSame({"listen", scene, "--for", ".5s", "--rays", "10"}, "out.wav");
    }
}

TEST_F(Decoded, SoundsAndFontsAreTheSameInTheSandbox) {
    ASSERT_EQ(rtsg({"listen", file, "-o", folder / "none.wav", "--for", ".2s", "--rays", "10"}).status, 0);
    expectSame({"listen", file, "--for", ".5s", "--rays", "10"}, "out.wav");
    writeFile(folder / "font.ttf", WrittenFont().bytes());
    // Of letters that the font lacks the nearest one of the system is chosen in the process, and sans serif here
    // (limits.md).
    writeFile(file,
              "#X3D V4.1 utf8\nPROFILE Full\nViewpoint { position 2 0 8 }\nFontLibrary { family \"One\" url "
              "\"font.ttf\" }\nShape { appearance Appearance { material UnlitMaterial { } } geometry Text { string [ "
              "\"AAA\" \"AA\" ] fontStyle FontStyle { family \"One\" } } }\n");
    expectSame({"render", file, "--size", "64x32"}, "out.ppm");
}

}  // namespace
}  // namespace rtsg::test
