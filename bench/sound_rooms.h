// Rooms to measure sound in: scenes on the product's own BVH, and sources that move in one while it is heard live.
//
// Threading: as SharedWorld and LiveSound.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/audio/live_sound.h>
#include <rtsg/core/scene.h>
#include <rtsg/renderers/shared_world.h>

#include "geometry/world_geometry.h"
#include "scene/acoustic_tables.h"

namespace rtsg::bench {

struct SoundRoom {
    std::string name;
    Scene scene;
    std::unique_ptr<SharedWorld> world;
    std::unique_ptr<AcousticTables> tables;
    WorldGeometry geometry;
    glm::dvec3 source{1, 1, 1.5}, listener{4, 3, 1.5};
    double earlySeconds = .02;  // the first arrivals come within it, counted from direct sound

    /// Once the scene is there.
    void start();
    ~SoundRoom();
};

/// A box of 6 x 5 x 3 m, as a scene: absorption .1, of the rest this share scattered.
std::string boxScene(double scattering);
/// A fan-shaped hall of 12,000 m^3 with raked seats, a balcony and columns; two rooms of 100 m^3 that an opening of 1
/// m^2 couples; a booth of 9 m^3 with a desk; an office of 350 m^3 with desks and screens; a corridor of 30 m with
/// cupboards. In each a Transform "Voice" at the source clicks once a second, .05 s after it begins. Null if the scene
/// cannot be read.
std::unique_ptr<SoundRoom> hallRoom();
std::unique_ptr<SoundRoom> coupledRoom();
std::unique_ptr<SoundRoom> smallRoom();
std::unique_ptr<SoundRoom> officeRoom();
std::unique_ptr<SoundRoom> corridorRoom();
std::unique_ptr<SoundRoom> boxRoom(double scattering);

/// The cost of live sound with sources that move in the box.
struct MovingSound {
    std::vector<double> frames;  // CPU seconds of each frame of the scene's thread
    double cores = 0;            // that all of it takes in the second half, when all sources have reflections
    double stolen = 0;           // core seconds that the machine's host took meanwhile
    LiveReport reported;
};
/// Sources that all move at 60 Hz, in real time, heard for so long on OpenAL's silent device. Nothing: it cannot be
/// heard.
std::optional<MovingSound> moveSources(int sources, double seconds);

}  // namespace rtsg::bench
