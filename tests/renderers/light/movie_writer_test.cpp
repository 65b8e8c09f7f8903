// Films that are made: read back picture by picture, the same bytes each time, and whole or not there.
#include <rtsg/renderers/movie_writer.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

#include <gmock/gmock.h>

#include <rtsg/core/resource.h>

#include "support/temp_folder.h"
#include "texture/movie.h"

namespace rtsg {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

/// Red grows with `step`; the lower half is blue, the right half green.
Picture pictureOf(int step, int width = 32, int height = 16) {
    Picture picture(width, height);
    picture.space = ColorSpace::display;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            picture.pixels[static_cast<std::size_t>(y * width + x)] = {
                static_cast<float>(step) * .1f, 2 * x < width ? 0 : .6f, 2 * y < height ? 0 : .8f, 1};
    return picture;
}

class WrittenFilms : public testing::Test {
  protected:
    std::string bytesOf(const std::string& name) const {
        std::ifstream file(folder_.path() / name, std::ios::binary);
        return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    }
    Result<Movie> open(const std::string& name) const {
        auto file = Resources(folder_.path()).open(folder_.path(), name);
        EXPECT_TRUE(file);
        return Movie::open(std::move(*file));
    }
    void make(const std::string& name, int pictures) const {
        auto film = MovieWriter::create(folder_.path() / name, 32, 16, 25);
        ASSERT_TRUE(film) << film.error().format();
        for (int i = 0; i < pictures; ++i) ASSERT_TRUE(film->add(pictureOf(i)));
        EXPECT_FALSE(fs::exists(folder_.path() / name)) << "not before it is whole";
        ASSERT_TRUE(film->finish());
    }
    /// As bytes, from the lower left.
    static Vec4f texelAt(const Texture& texture, int x, int y) {
        return 255.0f * texture.sample((static_cast<float>(x) + .5f) / static_cast<float>(texture.width()),
                                       (static_cast<float>(y) + .5f) / static_cast<float>(texture.height()), 0,
                                       TextureAccess{.smooth = false}, ColorSpace::display);
    }
    const test::TempFolder folder_;
};

TEST_F(WrittenFilms, ShowTheirPicturesInTheirColours) {
    make("film.mp4", 10);
    auto movie = open("film.mp4");
    ASSERT_TRUE(movie) << movie.error().format();
    EXPECT_NEAR(movie->seconds(), .4, 1e-6);
    for (int i = 0; i < 10; ++i) {
        auto texture = movie->frameAt(i / 25.0 + 1e-3);
        ASSERT_TRUE(texture && *texture) << i;
        EXPECT_EQ((*texture)->width(), 32);
        EXPECT_EQ((*texture)->height(), 16);
        constexpr float kRounding = 5;  // of 255: 8 bits of luminance and colour, and of the encoder
        for (const auto& [x, y, green, blue] : {std::tuple(4, 3, 0.0f, .8f), {27, 3, .6f, .8f}, {4, 12, 0.0f, 0.0f}}) {
            const Vec4f texel = texelAt(**texture, x, y);
            EXPECT_NEAR(texel.r, 25.5f * static_cast<float>(i), kRounding) << i << ' ' << x << ' ' << y;
            EXPECT_NEAR(texel.g, 255 * green, kRounding) << i << ' ' << x << ' ' << y;
            EXPECT_NEAR(texel.b, 255 * blue, kRounding) << i << ' ' << x << ' ' << y;
        }
    }
}

TEST_F(WrittenFilms, AreTheSameBytesEachTime) {
    make("one.mp4", 30);
    make("two.mp4", 30);
    EXPECT_EQ(bytesOf("one.mp4"), bytesOf("two.mp4"));
    EXPECT_EQ(bytesOf("one.mp4").substr(4, 4), "ftyp");
}

TEST_F(WrittenFilms, HoldAPictureAsLongAsIsSaid) {
    auto film = MovieWriter::create(folder_.path() / "film.mp4", 32, 16, 10);
    ASSERT_TRUE(film);
    ASSERT_TRUE(film->add(pictureOf(2)));
    ASSERT_TRUE(film->hold(4));
    ASSERT_TRUE(film->add(pictureOf(8)));
    ASSERT_TRUE(film->hold(1));
    ASSERT_TRUE(film->finish());
    auto movie = open("film.mp4");
    ASSERT_TRUE(movie);
    EXPECT_NEAR(movie->seconds(), .7, 1e-6);
    float shown = 0;
    for (const double t : {.05, .45, .55}) {
        auto texture = movie->frameAt(t);
        ASSERT_TRUE(texture);
        if (*texture) shown = texelAt(**texture, 4, 12).r;
        EXPECT_NEAR(shown, t < .5 ? 51 : 204, 5) << t;
    }
}

/// Two seconds at 48 kHz: on the left a tone of 1 kHz, on the right 10 ms of one of 3 kHz, one second after the
/// beginning.
std::vector<float> toneAndMark() {
    constexpr int kRate = 48000, kMark = kRate / 100;
    std::vector<float> samples;
    for (int i = 0; i < 2 * kRate; ++i) {
        const double t = double(i) / kRate, window = i >= kRate && i < kRate + kMark
                                                         ? std::pow(std::sin(std::numbers::pi * (i - kRate) / kMark), 2)
                                                         : 0;
        samples.push_back(static_cast<float>(.5 * std::sin(2 * std::numbers::pi * 1000 * t)));
        samples.push_back(static_cast<float>(.8 * window * std::sin(2 * std::numbers::pi * 3000 * t)));
    }
    return samples;
}

TEST_F(WrittenFilms, AreHeardFromTheirFirstPictureOn) {
    const std::vector<float> samples = toneAndMark();
    for (const std::string name : {"one.mp4", "two.mp4"}) {
        auto film = MovieWriter::create(folder_.path() / name, 32, 16, 25, MovieWriter::Sound::awaited);
        ASSERT_TRUE(film) << film.error().format();
        for (int i = 0; i < 50; ++i) ASSERT_TRUE(film->add(pictureOf(i / 5)));
        ASSERT_TRUE(film->addSound(samples, 48000, 2));
        ASSERT_TRUE(film->finish());
    }
    EXPECT_EQ(bytesOf("one.mp4"), bytesOf("two.mp4"));
    auto movie = open("one.mp4");
    ASSERT_TRUE(movie) << movie.error().format();
    EXPECT_NEAR(movie->seconds(), 2, .025) << "a piece of sound is 21 ms";
    auto texture = movie->frameAt(1.21);
    ASSERT_TRUE(texture && *texture);
    EXPECT_NEAR(texelAt(**texture, 4, 12).r, 25.5 * 6, 5);
    const auto heard = movieSound(*Resources(folder_.path()).open(folder_.path(), "one.mp4"), 1 << 20);
    ASSERT_TRUE(heard) << heard.error().format();
    EXPECT_EQ(heard->sampleRate, 48000);
    ASSERT_EQ(heard->channels, 2);
    EXPECT_NEAR(double(heard->samples.size()) / 2, 96000, 1024);
    double tone = 0, mark = 0, markAt = 0;
    const std::size_t all = std::min<std::size_t>(heard->samples.size() / 2, 96000);
    for (std::size_t i = 0; i < all; ++i) {
        const double left = heard->samples[2 * i], right = heard->samples[2 * i + 1];
        tone += left * left;
        mark += right * right;
        markAt += right * right * double(i);
    }
    EXPECT_NEAR(std::sqrt(tone / double(all)), .5 / std::numbers::sqrt2, .01);
    EXPECT_NEAR(markAt / mark / 48000, 1.005, .0005) << "neither early nor late by what the coder delays";
    EXPECT_NEAR(mark, .5 * .64 * .375 * 480, .05 * .5 * .64 * .375 * 480);
}

TEST_F(WrittenFilms, ThatAwaitSoundAreFilmsWithoutIt) {
    auto film = MovieWriter::create(folder_.path() / "film.mp4", 32, 16, 25, MovieWriter::Sound::awaited);
    ASSERT_TRUE(film);
    for (int i = 0; i < 10; ++i) ASSERT_TRUE(film->add(pictureOf(i)));
    ASSERT_TRUE(film->finish());
    make("silent.mp4", 10);
    EXPECT_EQ(bytesOf("film.mp4"), bytesOf("silent.mp4"));
    EXPECT_FALSE(movieSound(*Resources(folder_.path()).open(folder_.path(), "film.mp4"), 1 << 20));
}

TEST_F(WrittenFilms, RefuseSoundThatTheyCannotHold) {
    const std::vector<float> samples(4096);
    for (const auto& [rate, channels] : {std::pair(48000, 3), {48000, 0}, {12345, 2}, {0, 1}}) {
        auto film = MovieWriter::create(folder_.path() / "film.mp4", 32, 16, 25, MovieWriter::Sound::awaited);
        ASSERT_TRUE(film);
        ASSERT_TRUE(film->add(pictureOf(1)));
        EXPECT_FALSE(film->addSound(samples, rate, channels)) << rate << ' ' << channels;
        EXPECT_FALSE(film->finish());
        EXPECT_FALSE(fs::exists(folder_.path() / "film.mp4"));
    }
}

TEST_F(WrittenFilms, LieOnBlackWhereTheyAreTransparent) {
    auto film = MovieWriter::create(folder_.path() / "film.mp4", 32, 16, 10);
    ASSERT_TRUE(film);
    Picture picture = pictureOf(10);
    for (Vec4f& pixel : picture.pixels) pixel = Vec4f(.5f, .5f, .5f, .5f);  // white, half there
    ASSERT_TRUE(film->add(picture));
    ASSERT_TRUE(film->finish());
    auto movie = open("film.mp4");
    ASSERT_TRUE(movie);
    auto texture = movie->frameAt(0);
    ASSERT_TRUE(texture && *texture);
    EXPECT_NEAR(texelAt(**texture, 9, 9).g, 128, 4);
}

TEST_F(WrittenFilms, RefuseWhatIsNone) {
    const fs::path file = folder_.path() / "film.mp4";
    const auto odd = MovieWriter::create(file, 31, 16, 25);
    ASSERT_FALSE(odd);
    EXPECT_THAT(odd.error().format(), HasSubstr("even, not 31 x 16"));
    EXPECT_FALSE(MovieWriter::create(file, 32, 16, 0));
    EXPECT_FALSE(MovieWriter::create(file, 32, 16, NAN));
    EXPECT_FALSE(MovieWriter::create(folder_.path() / "none" / "film.mp4", 32, 16, 25));
    EXPECT_FALSE(MovieWriter::create(file, 1 << 20, 2, 25));
    auto film = MovieWriter::create(file, 32, 16, 25);
    ASSERT_TRUE(film);
    ASSERT_TRUE(film->add(pictureOf(0)));
    const auto other = film->add(pictureOf(0, 16, 16));
    ASSERT_FALSE(other);
    EXPECT_THAT(other.error().format(), HasSubstr("32 x 16 and 16 x 16"));
    film = MovieWriter::create(folder_.path() / "other.mp4", 32, 16, 25);
    EXPECT_TRUE(fs::is_empty(folder_.path()) || !fs::exists(file)) << "what was not finished is not there";
    EXPECT_TRUE(MovieWriter::isName("a.MP4"));
    EXPECT_FALSE(MovieWriter::isName("mp4"));
}

TEST_F(WrittenFilms, AFullDiskIsSaid) {
    fs::create_symlink("/dev/full", folder_.path() / "film.mp4");
    auto film = MovieWriter::create(folder_.path() / "film.mp4", 320, 160, 25);
    Result<> done = film ? Result<>() : Result<>(std::unexpected(film.error()));
    for (int i = 0; done && i < 100; ++i) done = film->add(pictureOf(i % 10, 320, 160));
    if (done) done = film->finish();
    ASSERT_FALSE(done);
    EXPECT_THAT(done.error().format(), HasSubstr("No space left on device"));
}

}  // namespace
}  // namespace rtsg
