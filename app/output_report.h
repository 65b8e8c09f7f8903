// What was made of a scene, and what of it is missing, for the reports of verbs.
// Threading: none of its own.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/audio/live_sound.h>
#include <rtsg/renderers/shared_world.h>

namespace rtsg::app {

/// The account of what was made, for the reports of verbs.
struct OutputReport {
    /// The scene's number of the state that each picture shows; of the one that the sound up to the same instant was
    /// made from (0: there is none); and the instant, in seconds from the start.
    std::vector<std::uint64_t> pictureStates, soundStates;
    std::vector<double> pictureTimes;
    std::vector<double> pictureSamples;  // RenderStats::samples of each
    double kept = 0;                     // RenderStats::kept, added up over the pictures
    double unreached = 0;                // RenderStats::unreached, the most of a picture
    double soundSeconds = 0;
    double mostBehind = 0;         // seconds of scene time that the outputs ever were behind the scene
    std::uint64_t overlapped = 0;  // frames that came while what the one before asked for was still in the making
    std::string missing;           // "7 of 20 pictures, 1.4 of 4 s of sound"; empty if all that was asked for is there
    SharedWorld::Counts world;
    std::optional<Flattener::Cuts> cuts;  // with --tessellation
    struct Live {
        std::uint64_t states = 0;                           // of the scene, while it was followed
        std::uint64_t statesPictured = 0, statesHeard = 0;  // of them; the others were merged with these
        std::uint64_t picturesSkipped = 0;  // times k / F that went by while another picture was in the making
        std::optional<LiveReport> device;
    };
    std::optional<Live> live;

    void addMissing(std::string_view what);
    /// Seconds; nothing if it is all there.
    void addMissingSound(double made, double wanted);
    /// The sound that was made has not come into a file, nor have the pictures, if they are one.
    void forget(bool pictures);
    double meanKept() const { return pictureStates.empty() ? 0 : kept / static_cast<double>(pictureStates.size()); }
    /// ,"pictures":… of a JSON object.
    std::string json() const;
    /// A line of text.
    std::string text() const;
};

/// The text for RenderStats::kept; empty for 0.
std::string keptText(double share);

/// Says by how much a picture misses --error if the share `unreached` of its pixels ran out of samples; empty if it
/// does not.
std::string missingError(double error, double unreached);

/// ,"tessellation":… of a JSON object.
std::string tessellationJson(const Flattener::Cuts& cuts);

}  // namespace rtsg::app
