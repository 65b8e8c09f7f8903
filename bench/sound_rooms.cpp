// Writes rooms as scenes, follows them, and moves sources in one of them.
#include "sound_rooms.h"

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <thread>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "bench.h"

namespace rtsg::bench {

void SoundRoom::start() {
    AcousticMaterial usual;
    usual.absorption = allBands(.1);
    usual.scattering = allBands(.5);
    world = std::make_unique<SharedWorld>(scene);
    tables = std::make_unique<AcousticTables>(world->rays(), usual);
    world->add(*tables);
    scene.newFrame(0);
    world->finishBackgroundWork();
    geometry.follow(tables->latest()->walls, world->rays());
}

SoundRoom::~SoundRoom() {
    if (world) world->remove(*tables);
}

namespace {

std::string heardAs(double absorption, double scattering) {
    return fmt::format(
        "appearance Appearance {{ acousticProperties AcousticProperties {{ absorption {} diffuse {} specular {} }} }}",
        absorption, (1 - absorption) * scattering, (1 - absorption) * (1 - scattering));
}

std::string boxShape(const glm::dvec3& low, const glm::dvec3& high, double absorption, double scattering) {
    const glm::dvec3 middle = (low + high) / 2.0, size = high - low;
    return fmt::format(
        "Transform {{ translation {} {} {} children Shape {{ geometry Box {{ size {} {} {} solid FALSE }} {} }} }}\n",
        middle.x, middle.y, middle.z, size.x, size.y, size.z, heardAs(absorption, scattering));
}

/// Quadrilaterals, four corners each.
std::string quadShape(const std::vector<glm::dvec3>& corners, double absorption, double scattering) {
    std::string points, faces;
    for (std::size_t i = 0; i < corners.size(); ++i) {
        points += fmt::format("{} {} {}, ", corners[i].x, corners[i].y, corners[i].z);
        faces += fmt::format("{} {}", i, i % 4 == 3 ? "-1 " : "");
    }
    return fmt::format(
        "Shape {{ geometry IndexedFaceSet {{ solid FALSE coord Coordinate {{ point [ {} ] }} coordIndex [ {} ] }} {} "
        "}}\n",
        points, faces, heardAs(absorption, scattering));
}

std::string clickingVoice(const glm::dvec3& position) {
    constexpr int kRate = 48'000, kClick = kRate / 20;
    std::string samples;
    for (int i = 0; i < kRate; ++i) samples += i == kClick ? "1 " : "0 ";
    return fmt::format(
        "DEF Voice Transform {{ translation {} {} {} children SpatialSound {{ dopplerEnabled TRUE children "
        "BufferAudioSource {{ loop TRUE sampleRate {} numberOfChannels 1 buffer [ {} ] }} }} }}\n",
        position.x, position.y, position.z, kRate, samples);
}

std::unique_ptr<SoundRoom> roomOf(const std::string& name, const std::string& shapes, const glm::dvec3& source,
                                  const glm::dvec3& listener) {
    auto room = std::make_unique<SoundRoom>();
    room->name = name;
    room->source = source;
    room->listener = listener;
    Diagnostics diagnostics;
    const std::string text =
        "#X3D V4.0 utf8\nPROFILE Full\n" + shapes + clickingVoice(source) +
        fmt::format("ListenerPointSource {{ position {} {} {} }}\n", listener.x, listener.y, listener.z);
    if (!loadText(room->scene, text, diagnostics)) return nullptr;
    room->start();
    return room;
}

}  // namespace

std::string boxScene(double scattering) {
    return "#X3D V4.0 utf8\nPROFILE Full\n" + boxShape(glm::dvec3(0), {6, 5, 3}, .1, scattering);
}

std::unique_ptr<SoundRoom> boxRoom(double scattering) {
    return roomOf("box", boxShape(glm::dvec3(0), {6, 5, 3}, .1, scattering), {1, 1, 1.5}, {4, 3, 1.5});
}

std::unique_ptr<SoundRoom> hallRoom() {
    // From the stage (z = 0) to the back (z = 36) it widens from 20 to 28 m, and is 14 m high.
    const auto side = [](double z, double sign) { return sign * (10 + 4 * z / 36); };
    std::string shapes;
    for (const double sign : {-1.0, 1.0})
        shapes += quadShape(
            {{side(0, sign), 0, 0}, {side(36, sign), 0, 36}, {side(36, sign), 14, 36}, {side(0, sign), 14, 0}}, .08,
            .3);
    shapes += quadShape({{-10, 0, 0}, {10, 0, 0}, {10, 14, 0}, {-10, 14, 0}}, .1, .3);
    shapes += quadShape({{-14, 0, 36}, {14, 0, 36}, {14, 14, 36}, {-14, 14, 36}}, .2, .5);
    shapes += quadShape({{-10, 14, 0}, {10, 14, 0}, {14, 14, 36}, {-14, 14, 36}}, .06, .4);
    shapes += quadShape({{-10, 0, 0}, {10, 0, 0}, {14, 0, 36}, {-14, 0, 36}}, .1, .1);
    // Rows of seats, each higher than the one before.
    for (int row = 0; row < 20; ++row) {
        const double z = 10 + 1.2 * row, width = side(z, 1) - 1.5;
        shapes += boxShape({-width, .02, z}, {width, .8 + .15 * row, z + .7}, .6, .7);
    }
    shapes += boxShape({-13, 6.5, 29}, {13, 7.2, 35.9}, .3, .5);
    for (const double z : {8.0, 16.0, 24.0})
        for (const double sign : {-1.0, 1.0}) {
            const double x = side(z, sign) - 1.2 * sign;
            shapes += boxShape({x - .3, .02, z - .3}, {x + .3, 13.98, z + .3}, .05, .2);
        }
    auto room = roomOf("hall", shapes, {1, 1.6, 4}, {-2, 3.4, 20.4});
    if (room) room->earlySeconds = .05;
    return room;
}

std::unique_ptr<SoundRoom> coupledRoom() {
    // 5 x 4 x 5 m each; the wall between them, at x = 5, is open from y = 1 to 2 and z = 2 to 3.
    const auto box = [](double x, double absorption) {
        const double far = x == 0 ? 0 : 10, near = 5;
        return quadShape(
            {{far, 0, 0},  {far, 4, 0}, {far, 4, 5},  {far, 0, 5},  {far, 0, 0},  {near, 0, 0}, {near, 4, 0},
             {far, 4, 0},  {far, 0, 5}, {near, 0, 5}, {near, 4, 5}, {far, 4, 5},  {far, 0, 0},  {near, 0, 0},
             {near, 0, 5}, {far, 0, 5}, {far, 4, 0},  {near, 4, 0}, {near, 4, 5}, {far, 4, 5}},
            absorption, .6);
    };
    const std::string wall = quadShape({{5, 0, 0},
                                        {5, 1, 0},
                                        {5, 1, 5},
                                        {5, 0, 5},
                                        {5, 2, 0},
                                        {5, 4, 0},
                                        {5, 4, 5},
                                        {5, 2, 5},
                                        {5, 1, 0},
                                        {5, 2, 0},
                                        {5, 2, 2},
                                        {5, 1, 2},
                                        {5, 1, 3},
                                        {5, 2, 3},
                                        {5, 2, 5},
                                        {5, 1, 5}},
                                       .05, .6);
    return roomOf("coupled", box(0, .09) + box(5, .015) + wall, {1, 1.5, 1}, {3.6, 1.2, 3.1});
}

std::unique_ptr<SoundRoom> smallRoom() {
    return roomOf(
        "small", boxShape(glm::dvec3(0), {2.4, 2.1, 1.8}, .25, .3) + boxShape({1.6, .01, .3}, {2.38, .75, 1.5}, .1, .2),
        {.4, 1.5, .5}, {1.2, 1.2, 1.1});
}

namespace {

/// A box without what is in it: floor, ceiling and walls of their own.
std::string shell(const glm::dvec3& size, double floor, double ceiling, double walls, double scattering) {
    const auto level = [&](double y, double absorption) {
        return quadShape({{0, y, 0}, {size.x, y, 0}, {size.x, y, size.z}, {0, y, size.z}}, absorption, scattering);
    };
    return level(0, floor) + level(size.y, ceiling) +
           quadShape({{0, 0, 0},
                      {size.x, 0, 0},
                      {size.x, size.y, 0},
                      {0, size.y, 0},
                      {0, 0, size.z},
                      {size.x, 0, size.z},
                      {size.x, size.y, size.z},
                      {0, size.y, size.z},
                      {0, 0, 0},
                      {0, 0, size.z},
                      {0, size.y, size.z},
                      {0, size.y, 0},
                      {size.x, 0, 0},
                      {size.x, 0, size.z},
                      {size.x, size.y, size.z},
                      {size.x, size.y, 0}},
                     walls, scattering);
}

}  // namespace

std::unique_ptr<SoundRoom> officeRoom() {
    std::string shapes = shell({14, 2.8, 9}, .15, .6, .1, .2);
    for (const double x : {2.0, 5.5, 9.0})
        for (const double z : {2.5, 6.5}) {
            shapes += boxShape({x, .72, z - .8}, {x + 1.6, .76, z}, .1, .1);
            shapes += boxShape({x, .72, z + .05}, {x + 1.6, .76, z + .85}, .1, .1);
            shapes += boxShape({x, .01, z + .01}, {x + 1.6, 1.4, z + .04}, .5, .2);
        }
    return roomOf("office", shapes, {6.5, 1.3, 4.6}, {11.3, 1.2, 7.9});
}

std::unique_ptr<SoundRoom> corridorRoom() {
    std::string shapes = shell({30, 2.6, 2}, .05, .3, .05, .1);
    for (const double x : {6.0, 12.0, 18.0}) shapes += boxShape({x, .01, 1.6}, {x + 1, 2, 1.99}, .1, .2);
    return roomOf("corridor", shapes, {2, 1.5, .9}, {20, 1.5, .8});
}

std::optional<MovingSound> moveSources(int sources, double seconds) {
    ::setenv("ALSOFT_DRIVERS", "null", 1);
    std::string text = boxScene(.5);
    for (int i = 0; i < sources; ++i)
        text += fmt::format(
            "DEF V{} Transform {{ translation 0 0 0 children Sound {{ location {} {} 1.5 maxBack 60 maxFront 60 source "
            "OscillatorSource {{ frequency {} }} }} }}\n",
            i, 1 + .4 * (i % 8), 1 + .6 * (i / 8 % 6), 200 + 20 * i);
    Scene scene;
    Diagnostics diagnostics;
    if (!loadText(scene, text + "Viewpoint { position 4 3 1.5 }\n", diagnostics)) return std::nullopt;
    SharedWorld world(scene);
    auto heard = LiveSound::start(world, {});
    if (!heard) return std::nullopt;
    std::vector<NodeId> moving;
    for (int i = 0; i < sources; ++i) moving.push_back(scene.findName(fmt::format("V{}", i)));
    MovingSound result;
    const double begin = wallSeconds(), stolen = stolenSeconds();
    double middle = begin, before = cpuSeconds();
    for (double t = 0; t < seconds; t = wallSeconds() - begin) {
        if (middle == begin && t >= seconds / 2) middle = wallSeconds(), before = cpuSeconds();
        const double start = threadSeconds();
        for (int i = 0; i < sources; ++i)
            static_cast<void>(scene.set(moving[static_cast<std::size_t>(i)], x3d::Transform::translation,
                                        Vec3f(static_cast<float>(.9 * std::sin(t + i)), 0, 0)));
        scene.newFrame(t);
        result.frames.push_back(threadSeconds() - start);
        std::this_thread::sleep_for(std::chrono::microseconds(16'667));
    }
    result.cores = (cpuSeconds() - before) / (wallSeconds() - middle);
    result.stolen = stolenSeconds() - stolen;
    result.reported = (*heard)->stop();
    return result;
}

}  // namespace rtsg::bench
