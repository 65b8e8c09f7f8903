// Films: the picture of every time, whatever was asked before; hostile files; the clock of a MovieTexture.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

#include <gmock/gmock.h>

#include <rtsg/core/x3d.h>
#include <rtsg/renderers/picture.h>

#include "renderers/light/light_scene.h"
#include "support/animated_png.h"
#include "support/plain_film.h"
#include "support/taken_memory.h"
#include "support/temp_folder.h"
#include "test_paths.h"
#include "texture/movie.h"

namespace rtsg {
namespace {

using testing::HasSubstr;

using test::plainFilm;

class Films : public testing::Test {
  protected:
    Result<Movie> open(const std::string& bytes, std::uint64_t maximumPixels = 1 << 20) {
        std::ofstream(folder_.path() / "film", std::ios::binary | std::ios::trunc) << bytes;
        auto file = Resources(folder_.path()).open(folder_.path(), "film");
        EXPECT_TRUE(file);
        return Movie::open(std::move(*file), maximumPixels);
    }
    static std::string dataFile(const std::string& name) {
        std::ifstream file(std::string(RTSG_SOURCE_DIR) + "/tests/renderers/light/data/" + name, std::ios::binary);
        EXPECT_TRUE(file.good()) << name;
        return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    }
    static Vec4f texelAt(const Texture& texture, int x, int y) {
        const TextureAccess nearest{.smooth = false};
        return glm::round(255.0f * texture.sample((static_cast<float>(x) + .5f) / static_cast<float>(texture.width()),
                                                  (static_cast<float>(y) + .5f) / static_cast<float>(texture.height()),
                                                  0, nearest, ColorSpace::display));
    }
    /// The frame that a film shows; -1 if it is that of the call before.
    static int frameOf(Movie& movie, double time) {
        auto texture = movie.frameAt(time);
        if (!texture) {
            ADD_FAILURE() << texture.error().format();
            return -2;
        }
        return *texture ? static_cast<int>(std::lround(texelAt(**texture, 0, 0).r / 10)) : -1;
    }
    const test::TempFolder folder_;
};

TEST_F(Films, ShowEachPictureFromItsTimeOn) {
    auto movie = open(plainFilm(5, 10));
    ASSERT_TRUE(movie) << movie.error().format();
    EXPECT_DOUBLE_EQ(movie->seconds(), .5);
    auto first = movie->frameAt(0);
    ASSERT_TRUE(first && *first);
    EXPECT_EQ((*first)->width(), 4);
    EXPECT_EQ((*first)->height(), 2);
    EXPECT_EQ(texelAt(**first, 0, 0), Vec4f(0, 20, 30, 255)) << "the lower left one";
    EXPECT_EQ(texelAt(**first, 3, 1), Vec4f(200, 0, 0, 255));
    EXPECT_EQ(texelAt(**first, 3, 0), Vec4f(0, 0, 0, 255));
    EXPECT_FALSE((*first)->hasAlpha());
    EXPECT_EQ(frameOf(*movie, .0999), -1) << "still the first one";
    EXPECT_EQ(frameOf(*movie, .1 - 3e-7), 1) << "a clock that counts from 1970 is no finer";
    EXPECT_EQ(frameOf(*movie, .45), 4);
    EXPECT_EQ(frameOf(*movie, 7), -1) << "the last one for ever";
    EXPECT_EQ(frameOf(*movie, .21), 2);
    EXPECT_EQ(frameOf(*movie, -1), 0) << "the first one before it";
    EXPECT_EQ(frameOf(*movie, NAN), -1);
}

/// A GIF counts in hundredths of a second, which 30 frames a second are no multiple of.
TEST_F(Films, GifsTakeAsLongAsTheirPicturesDo) {
    for (const double rate : {4., 25., 30., 50., .5}) {
        const std::vector<Picture> pictures(12, Picture(4, 4, Vec4f(.5f, .25f, 1, 1)));
        const auto path = folder_.path() / "rate.gif";
        ASSERT_TRUE(writeAnimation(pictures, path, rate));
        std::ifstream file(path, std::ios::binary);
        const auto film = open({std::istreambuf_iterator<char>(file), {}});
        ASSERT_TRUE(film) << film.error().format();
        EXPECT_NEAR(film->seconds(), 12 / rate, .006) << rate;
        std::filesystem::remove(path);
    }
}

TEST_F(Films, OfAnyKindShowTheSameWhateverWasAskedBefore) {
    std::vector<Picture> pictures;
    for (int i = 0; i < 8; ++i) {
        Picture picture(8, 8);
        for (Vec4f& pixel : picture.pixels) pixel = {i & 1 ? 1 : 0, i & 2 ? 1 : 0, i & 4 ? 1 : 0, 1};
        pictures.push_back(std::move(picture));
    }
    ASSERT_TRUE(writeAnimation(pictures, folder_.path() / "film.gif", 4));
    std::ifstream file(folder_.path() / "film.gif", std::ios::binary);
    const std::string gif{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    std::vector<std::string> pixels;
    for (int i = 0; i < 8; ++i) {
        pixels.emplace_back();
        for (int k = 0; k < 64; ++k)
            for (const int c : {i & 1 ? 255 : 0, i & 2 ? 255 : 0, i & 4 ? 255 : 0, 255})
                pixels.back() += static_cast<char>(c);
    }
    struct {
        std::string bytes;
        int frames;
        double rate, seconds;
    } films[] = {{gif, 8, 4, 2},
                 {test::animatedPng(8, 8, pixels, 1, 4), 8, 4, 2},
                 {dataFile("film.mp4"), 10, 25, .4},
                 {dataFile("film.mpg"), 10, 25, .4},
                 {dataFile("film.webm"), 10, 25, .4},
                 {plainFilm(100, 5), 100, 5, 20}};
    for (const auto& film : films) {
        auto forth = open(film.bytes);
        ASSERT_TRUE(forth) << forth.error().format();
        EXPECT_NEAR(forth->seconds(), film.seconds, 1e-3);
        std::vector<Vec4f> seen;
        for (int i = 0; i < film.frames; ++i) {
            auto texture = forth->frameAt(i / film.rate);
            ASSERT_TRUE(texture && *texture) << i;
            seen.push_back(texelAt(**texture, 1, 1));
            if (film.rate == 4) {
                EXPECT_EQ(seen.back(), Vec4f(i & 1 ? 255 : 0, i & 2 ? 255 : 0, i & 4 ? 255 : 0, 255)) << i;
            }
            if (film.rate == 25) {
                for (int c = 0; c < 3; ++c) EXPECT_NEAR(seen.back()[c], 25 * i, 6) << i;
                for (const int y : {2, 13}) {  // 32 x 16: the right half is red above, blue below
                    const Vec4f right = texelAt(**texture, 24, y);
                    for (int c = 0; c < 3; ++c)
                        EXPECT_NEAR(right[c], (y > 8 ? Vec3f(200, 40, 40) : Vec3f(40, 40, 200))[c], 6) << i << " " << y;
                }
            }
        }
        std::mt19937 random(7);
        auto movie = open(film.bytes);
        ASSERT_TRUE(movie);
        int last = -1;
        for (int k = 0; k < 200; ++k) {
            const int i = static_cast<int>(random() % static_cast<unsigned>(film.frames));
            auto texture = movie->frameAt((i + .3) / film.rate);
            ASSERT_TRUE(texture) << texture.error().format();
            ASSERT_EQ(bool(*texture), i != last);
            if (*texture) {
                ASSERT_EQ(texelAt(**texture, 1, 1), seen[static_cast<std::size_t>(i)]) << i;
            }
            last = i;
        }
    }
}

TEST_F(Films, AreHeardInStepWithTheirPictures) {
    const auto soundOf = [&](const std::string& bytes, std::uint64_t maximum = 1 << 20) {
        std::ofstream(folder_.path() / "film", std::ios::binary | std::ios::trunc) << bytes;
        return movieSound(*Resources(folder_.path()).open(folder_.path(), "film"), maximum);
    };
    const auto sound = soundOf(plainFilm(10, 10, 4, 2, 8000));
    ASSERT_TRUE(sound) << sound.error().format();
    EXPECT_EQ(sound->sampleRate, 8000);
    EXPECT_EQ(sound->channels, 2);
    ASSERT_EQ(sound->samples.size(), 2 * 8000u);
    for (int k = 0; k < 8000; ++k) {
        ASSERT_EQ(sound->samples[static_cast<std::size_t>(2 * k)], static_cast<float>(k) / 32768);
        ASSERT_EQ(sound->samples[static_cast<std::size_t>(2 * k + 1)], static_cast<float>(-k) / 32768);
    }
    EXPECT_THAT(soundOf(plainFilm(10, 10, 4, 2, 8000), 1000).error().text, HasSubstr("more than 1000 samples"));
    EXPECT_THAT(soundOf(plainFilm(10, 10)).error().text, HasSubstr("holds no sound"));
    EXPECT_THAT(soundOf("no film").error().text, HasSubstr("no film that can be read"));
    EXPECT_TRUE(open(plainFilm(10, 10, 4, 2, 8000))) << "its pictures are there all the same";
}

TEST_F(Films, AreRefusedWithAReason) {
    const auto why = [&](const std::string& bytes, std::uint64_t pixels = 1 << 20) {
        const auto movie = open(bytes, pixels);
        return movie ? std::string() : movie.error().text;
    };
    EXPECT_THAT(why("#EXTM3U\n#EXT-X-VERSION:3\n/etc/passwd\n"), HasSubstr("no film of a format that is read"))
        << "a list of other files";
    EXPECT_THAT(why(""), HasSubstr("no film"));
    EXPECT_THAT(why(plainFilm(5, 10).substr(0, 60)), HasSubstr("film"));
    EXPECT_THAT(why(plainFilm(2, 10, 64, 64), 1000), HasSubstr("at most 1000"));
    EXPECT_EQ(why(plainFilm(2, 10, 64, 64), 64 * 64), "");
    EXPECT_THAT(why(dataFile("film.mp4"), 100), HasSubstr("film"));
    const std::string pixel[] = {"abcd", "efgh"};
    const std::string moving = test::animatedPng(1, 1, pixel, 1, 2);
    EXPECT_EQ(why(moving), "");
    std::string still = moving;
    for (std::size_t at = still.find("acTL"); at != std::string::npos; at = still.find("acTL")) still[at] = 'b';
    EXPECT_THAT(why(still), HasSubstr("no film of a format")) << "what follows a chunk that is not known";
    EXPECT_THAT(why(moving.substr(0, 40)), HasSubstr("film"));
    EXPECT_THAT(why(moving.substr(0, moving.find("acTL"))), HasSubstr("no film of a format"));
}

/// An MP4 file of 64 x 64 pixels whose tables count samples: in its head, or in a piece.
std::string filmThatCounts(std::uint32_t samples, bool inAPiece) {
    const auto number = [](std::uint64_t value, int bytes = 4) {
        std::string result;
        for (int i = bytes - 1; i >= 0; --i) result += static_cast<char>(value >> (8 * i) & 255);
        return result;
    };
    const auto box = [&](const char* kind, const std::string& content) {
        return number(8 + content.size()) + kind + content;
    };
    const std::string none = number(0) + number(0), id = number(0) + number(1);
    const std::uint32_t inHead = inAPiece ? 0 : samples;
    const std::string matrix =
        number(0x10000) + std::string(12, '\0') + number(0x10000) + std::string(12, '\0') + number(0x40000000);
    const std::string entry = box("mp4v", std::string(6, '\0') + number(1, 2) + std::string(16, '\0') + number(64, 2) +
                                              number(64, 2) + std::string(46, '\0') + number(24, 2) + number(65535, 2));
    const std::string tables =
        box("stsd", id + entry) + box("stts", inAPiece ? none : id + number(samples) + number(1)) +
        box("stsc", inAPiece ? none : id + number(1) + number(samples) + number(1)) +
        box("stsz", number(0) + number(1) + number(inHead)) + box("stco", inAPiece ? none : id + number(40));
    const std::string media = box("mdhd", std::string(12, '\0') + number(1000) + number(1000) + number(0)) +
                              box("hdlr", none + "vide" + std::string(13, '\0')) +
                              box("minf", box("vmhd", std::string(12, '\0')) + box("stbl", tables));
    const std::string track = box("tkhd", number(7) + std::string(8, '\0') + number(1) + std::string(24, '\0') +
                                              matrix + number(64 << 16) + number(64 << 16)) +
                              box("mdia", media);
    std::string head =
        box("mvhd", std::string(12, '\0') + number(1000) + number(1000) + number(0x10000) + number(0x100, 2) +
                        std::string(10, '\0') + matrix + std::string(24, '\0') + number(2)) +
        box("trak", track);
    if (inAPiece) head += box("mvex", box("trex", id + number(1) + number(1) + number(1) + number(0)));
    std::string film = box("ftyp", "isom" + number(0) + "isom") + box("moov", head);
    if (inAPiece)
        film += box("moof", box("mfhd", id) + box("traf", box("tfhd", number(0x20000) + number(1)) +
                                                              box("trun", number(0) + number(samples))));
    return film + box("mdat", std::string(100, '\0'));
}

// FFmpeg makes an entry of each sample that a table counts.
TEST_F(Films, WhoseTablesCountMoreThanTheFileCanHoldTakeNoMemory) {
    if (!test::kMemoryIsOurs) GTEST_SKIP() << "sanitizers have memory of their own";
    ASSERT_TRUE(open(plainFilm(2, 10)));  // FFmpeg's libraries are there from here on
    for (const bool inAPiece : {false, true}) {
        const std::size_t taken = test::takenBy([&] {
            const auto movie = open(filmThatCounts(80'000'000, inAPiece));
            EXPECT_FALSE(movie);
            return !movie && movie.error().text.contains("80000000 samples, which are not in a file");
        });
        EXPECT_LT(taken, 16 * test::kMegabyte) << inAPiece;
        // The entries that the bytes suffice for are followed.
        const auto movie = open(filmThatCounts(50, inAPiece));
        ASSERT_FALSE(movie);
        EXPECT_THAT(movie.error().text, testing::Not(HasSubstr("samples")));
    }
}

TEST_F(Films, ThatAreDamagedEndInAPictureOrAReason) {
    std::mt19937 random(3);
    int shown = 0;
    for (const std::string& whole : {plainFilm(6, 10), dataFile("film.mp4"), dataFile("film.mpg")})
        for (int i = 0; i < 150; ++i) {
            std::string bytes = random() % 3 ? whole : whole.substr(0, random() % whole.size());
            for (int k = static_cast<int>(random() % 8); k > 0 && !bytes.empty(); --k)
                bytes[random() % bytes.size()] = static_cast<char>(random());
            auto movie = open(bytes);
            if (!movie) continue;
            EXPECT_TRUE(std::isfinite(movie->seconds()) && movie->seconds() > 0);
            for (const double time : {.0, .35, .1, 1e9})
                if (const auto texture = movie->frameAt(time); texture && *texture) ++shown;
        }
    EXPECT_GT(shown, 300);
}

/// A MovieTexture whose film of 4 seconds starts at 10.
struct RunningFilm {
    Scene scene;
    NodeId id;
    explicit RunningFilm(const std::string& fields) {
        Diagnostics problems;
        EXPECT_TRUE(
            loadText(scene,
                     "#X3D V4.0 utf8\nPROFILE Full\nShape { appearance Appearance { texture DEF M MovieTexture { "
                     "startTime 10 " +
                         fields + " } } }",
                     problems));
        id = scene.findName("M");
        EXPECT_TRUE(scene.set(id, x3d::MovieTexture::_duration, Time{4}));
    }
    double at(double time) {
        scene.newFrame(time);
        return movieTime(scene.node(id), 4);
    }
};

TEST(MovieTime, GoesOnWithTheClockAndStaysWhereItEnded) {
    RunningFilm once("");
    EXPECT_EQ(once.at(9), 0);
    EXPECT_EQ(once.at(10), 0);
    EXPECT_DOUBLE_EQ(once.at(11.5), 1.5);
    EXPECT_DOUBLE_EQ(once.at(13.75), 3.75);
    EXPECT_EQ(once.at(15), 4);
    EXPECT_EQ(once.at(90), 4);
    RunningFilm again("loop TRUE stopTime 19");
    EXPECT_DOUBLE_EQ(again.at(13), 3);
    EXPECT_EQ(again.at(14), 0) << "a film that goes on is at its beginning again";
    EXPECT_DOUBLE_EQ(again.at(17.5), 3.5);
    EXPECT_DOUBLE_EQ(again.at(20), 1) << "where it was at 19";
    EXPECT_DOUBLE_EQ(again.at(33), 1);
}

TEST(MovieTime, RunsAtItsSpeedAndBackwards) {
    RunningFilm twice("speed 2 loop TRUE");
    EXPECT_DOUBLE_EQ(twice.at(10), 0);
    EXPECT_DOUBLE_EQ(twice.at(11.5), 3);
    EXPECT_DOUBLE_EQ(twice.at(12.5), 1);
    RunningFilm back("speed -.5");
    EXPECT_EQ(back.at(9), 4) << "before it has run, it is at its end";
    EXPECT_DOUBLE_EQ(back.at(10), 4);
    EXPECT_DOUBLE_EQ(back.at(13), 2.5);
    EXPECT_EQ(back.at(19), 0);
    RunningFilm still("speed 0 loop TRUE");
    EXPECT_EQ(still.at(12), 0);
    RunningFilm paused("pauseTime 11");
    EXPECT_DOUBLE_EQ(paused.at(10.5), .5);
    EXPECT_DOUBLE_EQ(paused.at(11), 1);
    EXPECT_DOUBLE_EQ(paused.at(14), 1);
    ASSERT_TRUE(paused.scene.set(paused.id, x3d::MovieTexture::resumeTime, Time{15}));
    EXPECT_DOUBLE_EQ(paused.at(15), 1);
    EXPECT_DOUBLE_EQ(paused.at(17), 3);
}

TEST_F(Films, AreInThePictureOfEachFrame) {
    // Seen whole: the upper right pixel is the square's upper right quarter of a half.
    test::LightScene scene(
        "Viewpoint { position 0 0 1 fieldOfView 1.5707963 }\n"
        "Shape { appearance Appearance { material UnlitMaterial { } texture DEF M MovieTexture { url "
        "\"" +
            test::dataUrl("video/avi", plainFilm(8, 10)) +
            "\" startTime 1 textureProperties TextureProperties { magnificationFilter \"NEAREST_PIXEL\" } } }\n"
            "  geometry IndexedFaceSet { coordIndex [0 1 2 3] coord Coordinate { point [-1 -1 0, 1 -1 0, 1 1 0, -1 1 "
            "0] }\n"
            "    texCoord TextureCoordinate { point [0 0, 1 0, 1 1, 0 1] } } }",
        40, 20);
    ASSERT_TRUE(scene.scene.set(scene.node("M"), x3d::MovieTexture::_duration, Time{.8}));
    const auto seen = [&](double time) {
        scene.scene.newFrame(time);
        const Picture picture = scene.picture();
        return std::pair(Vec3f(picture.at(11, 19)), Vec3f(picture.at(29, 0)));
    };
    const auto expected = [](int frame) {
        const float level = static_cast<float>(10 * frame) / 255;
        return std::pair(Vec3f(level, 20 / 255.0f, 30 / 255.0f), Vec3f(200 / 255.0f, level, 0));
    };
    const auto near = [](const std::pair<Vec3f, Vec3f>& a, const std::pair<Vec3f, Vec3f>& b) {
        return glm::length(a.first - b.first) + glm::length(a.second - b.second) < 1e-3f;
    };
    EXPECT_TRUE(near(seen(.5), expected(0)));
    EXPECT_TRUE(near(seen(1.25), expected(2)));
    EXPECT_TRUE(near(seen(1.31), expected(3)));
    EXPECT_TRUE(near(seen(1.75), expected(7)));
    EXPECT_TRUE(near(seen(5), expected(7))) << "it stays at its end";
    // It begins anew.
    ASSERT_TRUE(scene.scene.set(scene.node("M"), x3d::MovieTexture::startTime, Time{6}));
    EXPECT_TRUE(near(seen(6.15), expected(1)));
}

TEST_F(Films, ThatCannotBeShownAreNamed) {
    test::LightScene scene(
        "Shape { appearance Appearance { texture MovieTexture { url \"data:video/mp4,nothing of the kind\" } }\n"
        "  geometry Box { } }");
    scene.picture();
    std::string reported;
    for (const Diagnostic& d : scene.light->diagnostics().all()) reported += d.text + "\n";
    EXPECT_THAT(reported, HasSubstr("MovieTexture shows no picture"));
    EXPECT_THAT(reported, HasSubstr("no film of a format that is read"));
}

}  // namespace
}  // namespace rtsg
