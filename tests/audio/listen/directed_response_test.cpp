// Impulse responses of sources that send more to one side than to another, against images summed up in the test and
// against what the same scene sounds like.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "listen_scene.h"

namespace rtsg {
namespace {

using test::room;
using DirectedResponse = test::Listen;

/// Ways are looked for .8 mm beside the listener, and leave the source that much elsewhere.
constexpr double kBeside = 1e-3;

struct Image {
    double seconds, energy;
};

/// All images of a source in the box of room() up to an order, in the order in which they are heard; `gain` is the
/// amplitude that the source sends in a direction.
template <class Gain>
std::vector<Image> imagesInBox(const glm::dvec3& source, const glm::dvec3& listener, double absorption, int order,
                               const Gain& gain) {
    const glm::dvec3 size(6, 5, 3);
    std::vector<Image> images;
    // Along an axis image n is k lengths away, mirrored |n| times; odd ones are turned round.
    for (int x = -order; x <= order; ++x)
        for (int y = -order; y <= order; ++y)
            for (int z = -order; z <= order; ++z) {
                const glm::ivec3 n(x, y, z);
                const int mirrored = std::abs(x) + std::abs(y) + std::abs(z);
                if (mirrored > order) continue;
                glm::dvec3 image(0), rotation(1);
                for (int axis = 0; axis < 3; ++axis) {
                    const bool odd = n[axis] % 2 != 0;
                    rotation[axis] = odd ? -1 : 1;
                    image[axis] = odd ? (n[axis] + 1) * size[axis] - source[axis] : n[axis] * size[axis] + source[axis];
                }
                const glm::dvec3 displacement = listener - image;
                const double distance = glm::length(displacement), amplitude = gain(rotation * displacement / distance);
                images.push_back({distance / 343, amplitude * amplitude * std::pow(1 - absorption, mirrored) /
                                                      (4 * M_PI * distance * distance)});
            }
    std::ranges::sort(images, {}, &Image::seconds);
    return images;
}

/// The cone of 60 and 120 degrees, .25 beyond, that points along `aim`.
double coneOf(const glm::dvec3& aim, const glm::dvec3& direction) {
    const double angle = std::acos(std::clamp(glm::dot(aim, direction), -1.0, 1.0)) * 180 / M_PI;
    return angle <= 30 ? 1 : angle >= 60 ? .25 : 1 - .75 * (angle - 30) / 30;
}

std::string horn(const glm::dvec3& aim) {
    return fmt::format(
        "DEF Horn SpatialSound {{ location 1 1 1.5 direction {} {} {} coneInnerAngle {} coneOuterAngle {} "
        "coneOuterGain .25 children AudioClip {{ url \"impulse.wav\" }} }}\nViewpoint {{ position 4 3 1.5 }}\n",
        aim.x, aim.y, aim.z, M_PI / 3, 2 * M_PI / 3);
}

double energyBetween(const SoundBuffer& sound, double from, double to) {
    const auto channels = static_cast<std::size_t>(sound.channels);
    double sum = 0;
    for (auto i = static_cast<std::size_t>(from * sound.sampleRate);
         i < static_cast<std::size_t>(to * sound.sampleRate); ++i)
        sum += std::pow(static_cast<double>(sound.samples[i * channels]), 2);
    return sum;
}

TEST_F(DirectedResponse, WeighsEveryPathByTheConeAsTheSoundIs) {
    for (const glm::dvec3& aim : {glm::dvec3(1, 0, 0), glm::dvec3(0, -1, 0), glm::dvec3(0, 0, 1)}) {
        SCOPED_TRACE(fmt::format("{} {} {}", aim.x, aim.y, aim.z));
        Scene scene;
        load(scene, room("absorption .3 diffuse 0 specular .7", horn(aim)));
        ListenOptions o = options();
        o.metrics = true;
        o.render.ambisonicOrder = 1;  // the first channel is what one ear that is everywhere hears
        const auto report = listen(scene, o);
        ASSERT_TRUE(report) << report.error().text;
        ASSERT_EQ(report->sources.size(), 1u);
        const ListenReport::Source& source = report->sources[0];
        ASSERT_TRUE(source.directed);
        const auto expected = imagesInBox({1, 1, 1.5}, {4, 3, 1.5}, .3, 4,
                                          [&](const glm::dvec3& direction) { return coneOf(aim, direction); });
        std::vector<Arrival> arrivals = source.directed->arrivals;
        std::ranges::stable_sort(arrivals, {}, &Arrival::seconds);
        // Until the first of a higher order comes; those of one time in one sum, as their order is no matter.
        double heard = 0, meant = 0;
        for (std::size_t i = 0; i < expected.size() && expected[i].seconds < .03; ++i) {
            ASSERT_LT(i, arrivals.size());
            EXPECT_NEAR(arrivals[i].seconds, expected[i].seconds, 1e-7);
            heard += arrivals[i].energy[kBand1k];
            meant += expected[i].energy;
            if (i + 1 < expected.size() && expected[i + 1].seconds > expected[i].seconds + 1e-9) {
                EXPECT_NEAR(heard, meant, kBeside * meant) << i;
            }
        }
        // Figures stay those of an omnidirectional source.
        const auto alike = imagesInBox({1, 1, 1.5}, {4, 3, 1.5}, .3, 0, [](const glm::dvec3&) { return 1; });
        EXPECT_NEAR(source.trace.arrivals.front().energy[kBand1k], alike[0].energy, 1e-6 * alike[0].energy);
        // A WAV has pressure 1 at a metre on the axis. The sum of an impulse between samples stays the same.
        const SoundBuffer response = report->impulseResponses();
        const double direct = expected[0].seconds;
        double sum = 0;
        for (auto k = static_cast<std::size_t>((direct - .001) * kRate); k < (direct + .001) * kRate; ++k)
            sum += static_cast<double>(response.samples[k]);
        EXPECT_NEAR(sum / std::sqrt(4 * M_PI * expected[0].energy), 1, .01);
        // And as it sounds, the clip's impulse being .5.
        const double loud = .25 * std::pow(static_cast<double>(report->gain), 2);
        for (const auto& [from, to] : {std::pair(direct - .001, direct + .001), std::pair(.0125, .0145)})
            EXPECT_NEAR(energyBetween(report->sound, from, to) / loud / energyBetween(response, from, to), 1, .03)
                << from;
    }
}

TEST_F(DirectedResponse, TracesOnceMoreOnlyWhoSendsToOneSide) {
    Scene scene;
    load(scene, room("absorption .3 diffuse 0 specular .7", test::kPair));
    ListenOptions o = options();
    o.metrics = true;
    o.sound = false;
    auto report = listen(scene, o);
    ASSERT_TRUE(report);
    EXPECT_FALSE(report->sources.at(0).directed);
    Scene other;
    load(other, room("absorption .3", horn({1, 0, 0})));
    o.impulseResponses = false;
    report = listen(other, o);
    ASSERT_TRUE(report);
    EXPECT_FALSE(report->sources.at(0).directed);
}

/// Level by ellipsoids that reach further ahead than behind: towards the listener as it is, elsewhere by comparison.
TEST_F(DirectedResponse, WeighsByEllipsoidsForEachListenerOfItsOwn) {
    Scene scene;
    load(scene, room("absorption .3 diffuse 0 specular .7",
                     "DEF Voice Sound { location 1 1 1.5 direction 1 0 0 minBack 1 minFront 4 maxBack 20 maxFront 80 "
                     "source AudioClip { url \"impulse.wav\" } }\n"
                     "DEF Seat Viewpoint { position 4 3 1.5 }\nDEF Aisle Viewpoint { position 2 4 1.2 }\n"));
    SharedWorld world(scene);
    ListenOptions o = options();
    o.sound = false;
    SoundRenderer sound(world, o);
    const auto report = sound.survey();
    ASSERT_TRUE(report) << report.error().text;
    ASSERT_EQ(report->pairs.size(), 2u);
    for (const RoomReport::Pair& pair : report->pairs) {
        const glm::dvec3 source(1, 1, 1.5);
        const double away = glm::distance(source, pair.listenerAt);
        const auto level = [&](const glm::dvec3& direction) {
            const auto radius = [&](double front, double back) {
                return 2 * front * back / (front + back - (front - back) * direction.x);
            };
            const double inner = radius(4, 1), outer = radius(80, 20);
            return away <= inner ? 1 : std::pow(10, -(away - inner) / (outer - inner));
        };
        const double towards = level((pair.listenerAt - source) / away);
        const auto expected = imagesInBox(source, pair.listenerAt, .3, 4,
                                          [&](const glm::dvec3& direction) { return level(direction) / towards; });
        ASSERT_TRUE(pair.directed);
        std::vector<Arrival> arrivals = pair.directed->arrivals;
        std::ranges::stable_sort(arrivals, {}, &Arrival::seconds);
        double heard = 0, meant = 0;
        for (std::size_t i = 0; i < 12; ++i) {
            heard += arrivals.at(i).energy[kBand1k];
            meant += expected.at(i).energy;
            if (expected[i + 1].seconds > expected[i].seconds + 1e-9) {
                EXPECT_NEAR(heard, meant, kBeside * meant) << pair.listener << ' ' << i;
            }
        }
    }
}

}  // namespace
}  // namespace rtsg
