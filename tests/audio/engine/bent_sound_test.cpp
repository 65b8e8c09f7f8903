// Sound of a moving source round edges, as it is played, against the exact field of the half plane at every moment.
#include <cmath>
#include <complex>
#include <filesystem>
#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include "edges/diffraction_wedge.h"
#include "engine/acoustic_engine.h"

#include "played_frames.h"

namespace rtsg {
namespace {

constexpr double kBentRate = 48000, kBentTone = 1000, kBentSpeed = 343;
using BentTrajectory = std::function<glm::dvec3(double seconds)>;

/// The plane y = 0, x > 0, which mirrors all; its edge is the z axis.
const std::string kHalfPlane =
    "Shape { appearance Appearance { acousticProperties AcousticProperties { specular 1 } } geometry IndexedFaceSet { "
    "solid FALSE coordIndex [ 0 1 2 3 ] coord Coordinate { point [ 0 0 -300, 300 0 -300, 300 0 300, 0 0 300 ] } } }\n";

AcousticOptions inFirstOrder() {
    AcousticOptions options;
    options.ambisonicOrder = 1;
    options.levels = AcousticOptions::Levels::physical;
    return options;
}

/// First channel of what is played while the source goes; levels are those of pressure at 1 m.
std::vector<double> playBent(const std::string& walls, const glm::dvec3& listener, double seconds,
                             const BentTrajectory& positionAt, AcousticOptions options = inFirstOrder(),
                             const std::string& sound = "minBack 300 minFront 300") {
    options.trace.air.absorbs = false;
    options.trace.air.speedOfSound = kBentSpeed;
    options.trace.rays = 50;
    options.trace.maxSeconds = .5;
    const std::string text = fmt::format(
        "{}DEF Car Transform {{ children Sound {{ {} maxBack 900 maxFront 900 source OscillatorSource {{ "
        "frequency 1000 }} }} }}\nListenerPointSource {{ position {} {} {} }}\n",
        walls, sound, listener.x, listener.y, listener.z);
    const SoundBuffer played =
        test::playedFrames(text, "Car", options, 60, seconds, [&](Scene& scene, NodeId car, double t) {
            EXPECT_TRUE(scene.set(car, x3d::Transform::translation, Vec3f(positionAt(t))));
        });
    std::vector<double> first;
    const auto channels = static_cast<std::size_t>(played.channels);
    for (std::size_t i = 0; i < played.frames(); ++i)
        first.push_back(static_cast<double>(played.samples[channels * i]));
    return first;
}

/// The tone that arrives at a moment by way of `length`, with what else happens to it there at the pitch that it has.
std::complex<double> arriving(double t, const BentTrajectory& positionAt,
                              const std::function<double(const glm::dvec3&)>& length,
                              const std::function<std::complex<double>(const glm::dvec3&, double waveNumber)>& field) {
    const auto leftAt = [&](double arrives) {
        double left = arrives;
        for (int step = 0; step < 14; ++step) left = arrives - length(positionAt(left)) / kBentSpeed;
        return left;
    };
    const double left = leftAt(t), pitch = (leftAt(t + 5e-4) - leftAt(t - 5e-4)) / 1e-3;
    const double w = 2 * std::numbers::pi * kBentTone;
    return field(positionAt(left), w * pitch / kBentSpeed) * std::polar(1.0, w * left);
}

WedgePath pathAt(const glm::dvec3& source, const glm::dvec3& listener) {
    const auto angle = [](const glm::dvec3& p) {
        const double a = std::atan2(p.y, p.x);
        return a < 0 ? a + 2 * std::numbers::pi : a;
    };
    WedgePath path;
    path.opening = 2 * std::numbers::pi;
    path.sourceRadius = std::hypot(source.x, source.y);
    path.receiverRadius = std::hypot(listener.x, listener.y);
    path.along = listener.z - source.z;
    path.sourceAngle = angle(source);
    path.receiverAngle = angle(listener);
    return path;
}

double detourLength(const glm::dvec3& source, const glm::dvec3& listener) {
    const WedgePath path = pathAt(source, listener);
    return std::hypot(path.sourceRadius + path.receiverRadius, path.along);
}

/// All that the half plane makes of the tone, each part at its time.
std::complex<double> exactAt(double t, const BentTrajectory& positionAt, const glm::dvec3& listener) {
    const auto by = [&](const std::function<double(const glm::dvec3&)>& length,
                        const std::function<std::complex<double>(const WedgeField&)>& part) {
        return arriving(t, positionAt, length, [&](const glm::dvec3& source, double k) {
            return part(wedgeField(pathAt(source, listener), k)) * std::polar(1.0, k * length(source));
        });
    };
    const auto mirrored = [](const glm::dvec3& p) { return glm::dvec3(p.x, -p.y, p.z); };
    return by([&](const glm::dvec3& s) { return glm::distance(s, listener); },
              [](const WedgeField& f) { return f.direct; }) +
           by([&](const glm::dvec3& s) { return glm::distance(mirrored(s), listener); },
              [](const WedgeField& f) { return f.mirrored; }) +
           by([&](const glm::dvec3& s) { return detourLength(s, listener); },
              [](const WedgeField& f) { return f.besideDirect + f.besideMirrored; });
}

struct BentLine {
    double amplitude, besideDb;
};
/// How much of what is expected is heard, in phase and beside it, and all else; of every fifth sample.
template <class Expected>
BentLine compared(const std::vector<double>& heard, double from, double to, const Expected& expected) {
    double cc = 0, ss = 0, cs = 0, xc = 0, xs = 0, xx = 0;
    for (auto i = static_cast<std::size_t>(from * kBentRate); i < static_cast<std::size_t>(to * kBentRate); i += 5) {
        const std::complex<double> e = expected(static_cast<double>(i) / kBentRate);
        const double c = e.real(), s = e.imag(), x = heard[i];
        cc += c * c, ss += s * s, cs += c * s, xc += x * c, xs += x * s, xx += x * x;
    }
    const double determinant = cc * ss - cs * cs;
    const double p = (xc * ss - xs * cs) / determinant, q = (xs * cc - xc * cs) / determinant;
    return {std::hypot(p, q), 10 * std::log10(std::max(xx - p * xc - q * xs, 1e-300) / xx)};
}

BentTrajectory radially(double degrees, double from, double speed) {
    const double a = degrees * std::numbers::pi / 180;
    return [=](double t) { return (from + speed * t) * glm::dvec3(std::cos(a), std::sin(a), 0); };
}
glm::dvec3 inShadow(double degrees) {
    const double a = degrees * std::numbers::pi / 180;
    return {2 * std::cos(a), 2 * std::sin(a), 0};
}

TEST(BentSound, OfAMovingSourceIsShiftedAndNothingIsBesideItsLine) {
    for (const double degrees : {300.0, 250.0})
        for (const double speed : {1.0, 5.0, 34.0, -10.0}) {
            const BentTrajectory positionAt = radially(60, speed < 0 ? 20 : 3, speed);
            const glm::dvec3 listener = inShadow(degrees);
            const auto heard = playBent(kHalfPlane, listener, 1.3, positionAt);
            const BentLine line = compared(heard, .5, 1.2, [&](double t) { return exactAt(t, positionAt, listener); });
            EXPECT_LE(line.besideDb, -75) << speed << " m/s, " << degrees << "°";
            EXPECT_NEAR(20 * std::log10(line.amplitude), 0, .05) << speed << " m/s, " << degrees << "°";
            RecordProperty(fmt::format("beside_{}_{}", speed, degrees), std::to_string(line.besideDb));
        }
}

/// dB by which what is heard in each fiftieth of a second is off; from the first that is complete.
double worstLevel(const std::vector<double>& heard, const BentTrajectory& positionAt, const glm::dvec3& listener,
                  double from, double to, const std::string& what) {
    constexpr std::size_t kWindow = 960;
    double worst = 0;
    for (auto at = static_cast<std::size_t>(from * kBentRate); at + kWindow < static_cast<std::size_t>(to * kBentRate);
         at += kWindow) {
        double energy = 0, expected = 0;
        for (std::size_t i = at; i < at + kWindow; i += 5) {
            energy += heard[i] * heard[i];
            const double e = exactAt(static_cast<double>(i) / kBentRate, positionAt, listener).imag();
            expected += e * e;
        }
        const double off = 10 * std::log10(energy / expected);
        EXPECT_NEAR(off, 0, .1) << what << " at " << static_cast<double>(at) / kBentRate << " s";
        if (std::abs(off) > std::abs(worst)) worst = off;
    }
    return worst;
}

TEST(BentSound, IsContinuousWhereASourceGoesIntoTheShadowAndOutOfTheImage) {
    // Behind the plane from the light, and before it to where the image is seen; and back.
    for (const double side : {-1.0, 1.0})
        for (const auto& [speed, seconds] : {std::pair(.5, 1.6), std::pair(2.5, 1.0), std::pair(7.7, .8)})
            for (const bool back : {false, true}) {
                const glm::dvec3 listener(-1, 1.7 * side, 0);
                const double middle = 1.53, direction = back ? -1 : 1;
                // It stands still at first, and is half way when it passes the boundary.
                const double start = middle - direction * speed * seconds * .4;
                const BentTrajectory positionAt = [=, v = speed * direction](double t) {
                    return glm::dvec3(start + v * std::max(0.0, t - .05), 2.6, 0);
                };
                const auto heard = playBent(kHalfPlane, listener, seconds, positionAt);
                const std::string what = fmt::format("side {}, {} m/s{}", side, speed, back ? " back" : "");
                const double worst = worstLevel(heard, positionAt, listener, .1, seconds - .01, what);
                RecordProperty(fmt::format("worst_{}_{}_{}", side, speed, back), std::to_string(worst));
            }
}

/// By the levels of X3D direct sound is as loud here wherever it comes from, and what bends beside it as much louder
/// than physics has it, at the moment when both are heard.
TEST(BentSound, IsAsLoudAsGoesWithDirectSound) {
    const glm::dvec3 listener(-1, -1.7, 0);
    const BentTrajectory positionAt = [](double t) { return glm::dvec3(7.7 * std::max(0.0, t - .05), 2.6, 0); };
    AcousticOptions options = inFirstOrder();
    options.levels = AcousticOptions::Levels::x3d;
    const auto straight = [&](const glm::dvec3& s) { return glm::distance(s, listener); };
    auto heard = playBent(kHalfPlane, listener, .6, positionAt, options);
    for (std::size_t i = 0; i < heard.size(); ++i)
        heard[i] /= std::abs(arriving(static_cast<double>(i) / kBentRate, positionAt, straight,
                                      [&](const glm::dvec3& s, double) { return std::complex<double>(straight(s)); }));
    worstLevel(heard, positionAt, listener, .1, .59, "X3D");
}

/// Radians by which the phase of what is heard goes on beside that of a line, a sample; of all of them, by least
/// squares.
double pitchOf(const std::vector<double>& heard, double from, double to, double hz) {
    constexpr std::size_t kWindow = 2400;
    double sum = 0, st = 0, stt = 0, sp = 0, stp = 0, last = 0, rotations = 0;
    for (auto at = static_cast<std::size_t>(from * kBentRate); at + kWindow < static_cast<std::size_t>(to * kBentRate);
         at += kWindow / 4) {
        std::complex<double> tone;
        for (std::size_t i = 0; i < kWindow; ++i)
            tone += heard[at + i] * (.5 - .5 * std::cos(2 * std::numbers::pi * double(i) / kWindow)) *
                    std::polar(1.0, -2 * std::numbers::pi * hz * static_cast<double>(at + i) / kBentRate);
        const double phase = std::arg(tone), t = static_cast<double>(at) / kBentRate;
        if (sum > 0) rotations -= 2 * std::numbers::pi * std::round((phase - last) / (2 * std::numbers::pi));
        last = phase;
        sum += 1, st += t, stt += t * t, sp += phase + rotations, stp += t * (phase + rotations);
    }
    return hz + (sum * stp - st * sp) / (sum * stt - st * st) / (2 * std::numbers::pi);
}

/// A wall 2 m thick, seen from either side of which no edge is seen from both: sound bends twice.
TEST(BentSound, RoundTwoEdgesIsShifted) {
    const std::string wall =
        "Transform { translation 1 -150 0 children Shape { appearance Appearance { acousticProperties "
        "AcousticProperties { specular 1 } } geometry Box { size 2 300 600 } } }\n";
    const glm::dvec3 listener(3.5, -2, 0);
    for (const double speed : {1.0, 5.0, 34.0}) {
        // Along the line on which sound goes to the first edge.
        const BentTrajectory positionAt = [=](double t) {
            return (2 + speed * t) * glm::normalize(glm::dvec3(-1, -1.5, 0));
        };
        const auto heard = playBent(wall, listener, 1.3, positionAt);
        const double hz = kBentTone / (1 + speed / kBentSpeed);
        EXPECT_NEAR(pitchOf(heard, .5, 1.2, hz) / hz, 1, 1e-4) << speed;
    }
}

TEST(BentSound, FollowsInOtherSoundThanAmbisonic) {
    AcousticOptions binaural, head;
    binaural.binaural = true;
    head.binaural = true;
    std::vector<AcousticOptions> all{{}};
    if (AcousticEngine::create(binaural)) all.push_back(binaural);
    const std::filesystem::path file = "/usr/share/libmysofa/default.sofa";
    if (std::filesystem::exists(file)) {
        head.hrtf = *Hrtf::load(file, static_cast<int>(kBentRate));
        all.push_back(head);
    }
    const BentTrajectory positionAt = radially(60, 3, 5);
    const glm::dvec3 listener = inShadow(300);
    for (AcousticOptions& options : all) {
        options.levels = AcousticOptions::Levels::physical;
        const auto heard = playBent(kHalfPlane, listener, 1.3, positionAt, options);
        const BentLine line = compared(heard, .5, 1.2, [&](double t) { return exactAt(t, positionAt, listener); });
        EXPECT_LE(line.besideDb, -75) << options.binaural << (options.hrtf != nullptr);
        EXPECT_GT(line.amplitude, .1);
    }
}

}  // namespace
}  // namespace rtsg
