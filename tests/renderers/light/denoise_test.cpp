// Denoising: noise goes, edges and textures stay, means are kept, and what may not be filtered is refused.
#include <rtsg/renderers/denoise.h>

#include <cmath>
#include <random>

#include "light_scene.h"
#include "picture/denoise_filter.h"

namespace rtsg {
namespace {

using namespace test;

/// A picture of one surface by functions of the pixel: depth, normal, albedo, and what it shows.
struct Created {
    Picture picture{64, 64};
    template <class Depth, class Normal, class Albedo, class Light>
    Created(const Depth& depth, const Normal& normal, const Albedo& albedo, const Light& light) {
        PictureLayer layer;
        layer.channels = {"Z", "N.X", "N.Y", "N.Z", "albedo.R", "albedo.G", "albedo.B"};
        for (int y = 0; y < 64; ++y)
            for (int x = 0; x < 64; ++x) {
                const Vec3f n = normal(x, y), a = albedo(x, y);
                for (const float v : {static_cast<float>(depth(x, y)), n.x, n.y, n.z, a.r, a.g, a.b})
                    layer.values.push_back(v);
                picture.at(x, y) = Vec4f(a * static_cast<float>(light(x, y)), 1);
            }
        picture.layers.push_back(std::move(layer));
    }
};
constexpr auto kFlat = [](int, int) { return 3.0; };
constexpr auto kFacing = [](int, int) { return Vec3f(0, 0, 1); };
constexpr auto kWhite = [](int, int) { return Vec3f(1); };

/// Mean and standard deviation of green over columns.
std::pair<double, double> meanOf(const Picture& picture, int first, int last) {
    double sum = 0, squares = 0;
    int count = 0;
    for (int y = 8; y < 56; ++y)
        for (int x = first; x < last; ++x) {
            const double v = picture.at(x, y).g;
            sum += v, squares += v * v, ++count;
        }
    return {sum / count, std::sqrt(std::max(squares / count - sum * sum / count / count, 0.0))};
}

TEST(Denoise, NoiseGoesAndTheMeanStays) {
    std::mt19937 random(7);
    std::exponential_distribution<double> noise(2);  // mean .5, as much deviation: that of a few paths
    Created created(kFlat, kFacing, kWhite, [&](int, int) { return noise(random); });
    const auto [before, roughBefore] = meanOf(created.picture, 8, 56);
    ASSERT_TRUE(denoise(created.picture));
    const auto [after, roughAfter] = meanOf(created.picture, 8, 56);
    EXPECT_NEAR(after, before, .05 * before);
    EXPECT_LT(roughAfter, .15 * roughBefore);
}

// Light of two strengths meets at edges that depth, the normal or the colour show: no more than noise of each side is
// mixed into the other.
TEST(Denoise, EdgesStay) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> noise(-.2, .2);
    const auto light = [&](int x, int) { return (x < 32 ? .3 : 1.) + noise(random); };
    const auto step = [](int x, int) { return x < 32 ? 3.0 : 5.0; };
    const auto bend = [](int x, int) { return x < 32 ? Vec3f(0, 0, 1) : Vec3f(1, 0, 0); };
    for (int kind = 0; kind < 2; ++kind) {
        Created created = kind == 0 ? Created(step, kFacing, kWhite, light) : Created(kFlat, bend, kWhite, light);
        ASSERT_TRUE(denoise(created.picture));
        EXPECT_NEAR(meanOf(created.picture, 31, 32).first, .3, .04) << kind;
        EXPECT_NEAR(meanOf(created.picture, 32, 33).first, 1, .04) << kind;
    }
    // A texture: even light on a surface of two colours.
    Created created(
        kFlat, kFacing, [](int x, int y) { return Vec3f((x / 2 + y / 2) % 2 ? .8f : .1f); },
        [&](int, int) { return .5 + noise(random); });
    ASSERT_TRUE(denoise(created.picture));
    for (int y = 20; y < 40; ++y)
        for (int x = 20; x < 40; ++x)
            EXPECT_NEAR(created.picture.at(x, y).g, ((x / 2 + y / 2) % 2 ? .8 : .1) * .5, .03) << x << " " << y;
}

// A plane that runs away from the eye is one surface, and so is what lies in front of the sky; the sky is left alone.
// A lamp in a ceiling: black, and in the ceiling's plane. Its light stays its own; pixels that show both stay as they
// are.
TEST(Denoise, LampsDoNotRunIntoWhatTheyHangIn) {
    std::mt19937 random(5);
    std::exponential_distribution<double> noise(2);
    const auto albedo = [](int x, int) { return Vec3f(x < 40 ? .7f : x == 40 ? .35f : 0.f); };
    Created created(kFlat, kFacing, albedo, [&](int, int) { return noise(random); });
    for (int y = 0; y < 64; ++y)
        for (int x = 40; x < 64; ++x) created.picture.at(x, y) = Vec4f(Vec3f(x == 40 ? 2.7f : 5.f), 1);
    const double before = meanOf(created.picture, 4, 40).first;
    ASSERT_TRUE(denoise(created.picture));
    const auto [after, rough] = meanOf(created.picture, 4, 40);
    EXPECT_NEAR(after, before, .05 * before);
    EXPECT_LT(rough, .2 * before);
    for (int y = 0; y < 64; ++y)
        for (int x = 40; x < 64; ++x)
            ASSERT_NEAR(created.picture.at(x, y).g, x == 40 ? 2.7f : 5.f, 1e-4) << x << ' ' << y;
}

TEST(Denoise, SlopesAreOneSurfaceAndTheSkyIsNone) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> noise(0, 1);
    Created created([](int x, int y) { return x < 48 ? 2 + .2 * y : INFINITY; }, kFacing, kWhite,
                    [&](int x, int) { return x < 48 ? noise(random) : 7 + noise(random); });
    const Picture before = created.picture;
    ASSERT_TRUE(denoise(created.picture));
    EXPECT_LT(meanOf(created.picture, 8, 40).second, .08);
    EXPECT_NEAR(meanOf(created.picture, 40, 48).first, .5, .05);
    for (int y = 0; y < 64; ++y)
        for (int x = 48; x < 64; ++x) EXPECT_EQ(created.picture.at(x, y), before.at(x, y));
}

// One sample a pixel of a room under a sky, against many: nearer by far.
TEST(Denoise, APathTracedPictureComesNearerToTheTruth) {
    LightScene s(
        "Viewpoint { position 0 1.5 6 } Background { skyColor 1 1 1 } Transform { rotation 1 0 0 -1.5707963 "
        "children " +
            square(6, matte(".7 .7 .7")) +
            " } Transform { translation 0 1 0 children Shape { "
            "appearance Appearance { " +
            matte(".8 .3 .2") + " } geometry Sphere { } } }",
        64, 64);
    s.options.settings.integrator = Integrator::path;
    s.options.settings.colorSpace = ColorSpace::linear;
    s.options.settings.samplesPerPixel = 256;
    const Picture truth = s.picture();
    s.options.settings.samplesPerPixel = 1;
    s.options.settings.layers = kLayersOfDenoising;
    Picture picture = s.picture();
    const auto before = compare(picture, truth);
    ASSERT_TRUE(before);
    ASSERT_TRUE(denoise(picture));
    const auto after = compare(picture, truth);
    ASSERT_TRUE(after);
    EXPECT_LT(after->rmse, .6 * before->rmse);
}

/// The filter as its formulas say it: a pixel at a time, in double precision, of one picture or of two halves.
class PlainFilter {
  public:
    PlainFilter(const Picture& guide, std::vector<Picture*> pictures)
        : guide_(guide), pictures_(std::move(pictures)), w_(guide.width), h_(guide.height) {}
    void run() {
        for (int i = 0; i < w_ * h_; ++i) kinds_.push_back(kindOf(i % w_, i / w_));
        for (const Picture* picture : pictures_) lights_.push_back(lightOf(*picture));
        for (int i = 0; i < w_ * h_; ++i) estimate(i % w_, i / w_);
        for (int round = 0; round < 5; ++round) {
            const auto before = lights_;
            for (std::size_t k = 0; k < lights_.size(); ++k)
                for (int i = 0; i < w_ * h_; ++i) smooth(before[k], lights_[k], i % w_, i / w_, 1 << round);
        }
        for (std::size_t k = 0; k < lights_.size(); ++k)
            for (int i = 0; i < w_ * h_; ++i)
                if (kinds_[i] != Kind::sky)
                    for (int c = 0; c < 3; ++c)
                        pictures_[k]->pixels[i][c] = static_cast<float>(lights_[k][i].color[c] * colorOf(i)[c]);
    }

  private:
    enum class Kind { sky, lit, dark, rim };
    struct Light {
        Vec3d color;
        double variance = 0;
    };
    using Lights = std::vector<Light>;

    double layer(int i, int channel) const {
        return double{guide_.layers[0].values[static_cast<std::size_t>(7 * i + channel)]};
    }
    bool isSky(int i) const { return !std::isfinite(layer(i, 0)); }
    bool isDark(int i) const { return !isSky(i) && std::max({layer(i, 4), layer(i, 5), layer(i, 6)}) < .02; }
    Vec3d colorOf(int i) const { return glm::max(Vec3d(layer(i, 4), layer(i, 5), layer(i, 6)), .02); }
    static double luminance(const Vec3d& c) { return .2126 * c.r + .7152 * c.g + .0722 * c.b; }  // ITU-R BT.709
    bool inside(int x, int y) const { return x >= 0 && y >= 0 && x < w_ && y < h_; }
    int at(int x, int y) const { return y * w_ + x; }
    double shown(int i) const {
        double sum = 0;
        for (const Picture* picture : pictures_) sum += luminance(Vec3d(picture->pixels[i]));
        return sum;
    }
    Kind kindOf(int x, int y) const {
        const int i = at(x, y);
        if (isSky(i) || isDark(i)) return isSky(i) ? Kind::sky : Kind::dark;
        for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx)
                if (inside(x + dx, y + dy) && isDark(at(x + dx, y + dy)) && shown(at(x + dx, y + dy)) > shown(i))
                    return Kind::rim;
        return Kind::lit;
    }
    Lights lightOf(const Picture& picture) const {
        Lights lights;
        for (int i = 0; i < w_ * h_; ++i) lights.push_back({Vec3d(picture.pixels[i]) / colorOf(i)});
        return lights;
    }
    /// The depth's change to the nearer of both neighbours.
    double slope(int x, int y, int axis) const {
        double minimum = INFINITY;
        for (const int step : {-1, 1}) {
            const int nx = x + (axis == 0 ? step : 0), ny = y + (axis == 1 ? step : 0);
            if (inside(nx, ny) && !isSky(at(nx, ny)))
                minimum = std::min(minimum, std::abs(layer(at(nx, ny), 0) - layer(at(x, y), 0)));
        }
        return std::isfinite(minimum) ? minimum : 0;
    }
    double alike(int x, int y, int dx, int dy) const {
        if (!inside(x + dx, y + dy)) return 0;
        const int p = at(x, y), q = at(x + dx, y + dy);
        if (kinds_[q] == Kind::sky) return 0;
        if (p == q) return 1;
        if (kinds_[q] != kinds_[p] || kinds_[q] == Kind::rim) return 0;
        const double expected = slope(x, y, 0) * std::abs(dx) + slope(x, y, 1) * std::abs(dy);
        const double off = std::abs(layer(p, 0) - layer(q, 0));
        double cosine = 0;
        for (int c = 1; c < 4; ++c) cosine += layer(p, c) * layer(q, c);
        return std::pow(std::clamp(cosine, 0., 1.), 64) * std::exp(-off / (expected + 1e-3 * layer(p, 0)));
    }
    void estimate(int x, int y) {
        double weights = 0, mean = 0, squares = 0;
        const bool two = lights_.size() > 1;
        const auto apart = [&](int i) { return luminance(lights_[0][i].color) - luminance(lights_.back()[i].color); };
        for (int dy = -3; dy <= 3; ++dy)
            for (int dx = -3; dx <= 3; ++dx) {
                const double w = alike(x, y, dx, dy);
                if (w == 0) continue;
                const int q = at(x + dx, y + dy);
                const double l = luminance(lights_[0][q].color);
                weights += w;
                squares += w * (two ? apart(q) * apart(q) / 2 : l * l);
                mean += two ? 0 : w * l;
            }
        if (weights == 0) return;
        double variance = std::max(0., squares / weights - mean * mean / weights / weights);
        if (two) variance = std::max(variance, apart(at(x, y)) * apart(at(x, y)) / 2);
        for (Lights& lights : lights_) lights[at(x, y)].variance = variance;
    }
    double deviation(const Lights& lights, int x, int y) const {
        double sum = 0, weights = 0;
        for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx) {
                if (!inside(x + dx, y + dy) || kinds_[at(x + dx, y + dy)] == Kind::sky) continue;
                const double w = (2 - std::abs(dx)) * (2 - std::abs(dy));
                weights += w, sum += w * lights[at(x + dx, y + dy)].variance;
            }
        return std::sqrt(sum / weights);
    }
    void smooth(const Lights& from, Lights& to, int x, int y, int step) const {
        constexpr double kKernel[] = {1 / 16., 1 / 4., 3 / 8., 1 / 4., 1 / 16.};
        const int p = at(x, y);
        if (kinds_[p] == Kind::sky) return;
        const double range = 4 * deviation(from, x, y) + 1e-6;
        Light sum{Vec3d(0)};
        double weights = 0;
        for (int j = -2; j <= 2; ++j)
            for (int i = -2; i <= 2; ++i) {
                double w = kKernel[i + 2] * kKernel[j + 2] * alike(x, y, i * step, j * step);
                if (w == 0) continue;
                const Light& one = from[at(x + i * step, y + j * step)];
                if (step > 1 || lights_.size() > 1)
                    w *= std::exp(-std::abs(luminance(one.color) - luminance(from[p].color)) / range);
                sum.color += w * one.color, sum.variance += w * w * one.variance, weights += w;
            }
        to[p] = {sum.color / weights, sum.variance / weights / weights};
    }

    const Picture& guide_;
    const std::vector<Picture*> pictures_;
    const int w_, h_;
    std::vector<Kind> kinds_;
    std::vector<Lights> lights_;
};

/// A bent, sloping, coloured surface with a lamp in it, before the sky, in noise whose channels differ.
Picture bentAndNoisy(unsigned seed) {
    std::mt19937 random(seed);
    std::exponential_distribution<float> noise(2);
    Picture picture(37, 13);
    PictureLayer layer;
    layer.channels = {"Z", "N.X", "N.Y", "N.Z", "albedo.R", "albedo.G", "albedo.B"};
    for (int y = 0; y < picture.height; ++y)
        for (int x = 0; x < picture.width; ++x) {
            const bool sky = x > 33 && y < 4, lamp = x > 3 && x < 6 && y > 5 && y < 8;
            const float angle = .06f * static_cast<float>(std::min(x, 9)) + .03f * static_cast<float>(y * y) / 10;
            const Vec3f albedo = lamp ? Vec3f(0) : (x + y) % 3 ? Vec3f(.7f, .4f, .05f) : Vec3f(.3f, .5f, .6f);
            for (const float v : {sky ? INFINITY : 3 + .05f * static_cast<float>(x) + .02f * static_cast<float>(y * y),
                                  std::sin(angle), 0.f, std::cos(angle), albedo.r, albedo.g, albedo.b})
                layer.values.push_back(v);
            const Vec3f light = lamp ? Vec3f(9) : albedo * Vec3f(noise(random), noise(random), noise(random));
            picture.at(x, y) = Vec4f(light, .5f);
        }
    picture.layers.push_back(std::move(layer));
    return picture;
}

void expectAsPlain(const Picture& found, const Picture& expected, const char* what) {
    double maximum = 0;
    for (std::size_t i = 0; i < found.pixels.size(); ++i)
        for (int c = 0; c < 4; ++c)
            maximum = std::max(maximum, std::abs(double{found.pixels[i][c]} - double{expected.pixels[i][c]}));
    EXPECT_LT(maximum, 2e-4) << what;
}

TEST(Denoise, IsWhatItsFormulasSayInDoublePrecision) {
    const Picture first = bentAndNoisy(1), second = bentAndNoisy(2);
    Picture alone = first, plain = first;
    ASSERT_TRUE(denoise(alone));
    PlainFilter(first, {&plain}).run();
    expectAsPlain(alone, plain, "one picture");
    Picture a = first, b = second, plainA = first, plainB = second;
    ASSERT_TRUE(denoiseHalves(first, a, b, {}).value_or(false));
    PlainFilter(first, {&plainA, &plainB}).run();
    expectAsPlain(a, plainA, "the first half");
    expectAsPlain(b, plainB, "the second half");
}

TEST(Denoise, RefusesWhatItMayNotTouch) {
    Picture bare(4, 4);
    EXPECT_FALSE(denoise(bare)) << "no layers";
    Created display(kFlat, kFacing, kWhite, kFlat);
    display.picture.space = ColorSpace::display;
    EXPECT_FALSE(denoise(display.picture));
    Created known(kFlat, kFacing, kWhite, kFlat);
    known.picture.interval.resize(known.picture.pixels.size());
    EXPECT_FALSE(denoise(known.picture));
    // Numbers that are none neither spread nor stay.
    Created wild(kFlat, kFacing, kWhite, [](int x, int y) { return x == 30 && y == 30 ? double{NAN} : .5; });
    ASSERT_TRUE(denoise(wild.picture));
    for (const Vec4f& pixel : wild.picture.pixels) EXPECT_TRUE(std::isfinite(pixel.g));
}

}  // namespace
}  // namespace rtsg
