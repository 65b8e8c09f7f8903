// OutputReport: the outputs that were made of a scene, and those that are missing, for the reports of verbs.
// Threading: none of its own.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/audio/live_sound.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/renderers/shared_world.h>

namespace rtsg {

/// The account of the outputs that were made.
struct OutputReport {
    /// For each picture: the number of the state that it shows, that of the state of which the sound at the same time
    /// was made (0: none), and the time in seconds from the start.
    std::vector<std::uint64_t> pictureStates, soundStates;
    std::vector<double> pictureTimes;
    std::vector<double> pictureSamples;  // RenderStats::samples of each picture
    double kept = 0;                     // RenderStats::kept, summed over the pictures
    double unreached = 0, error = 0;     // of RenderStats, the most of any picture
    double soundSeconds = 0;
    double maxBehind = 0;          // the most seconds of scene time that outputs were behind the scene
    std::uint64_t overlapped = 0;  // frames that came while outputs of the frame before were still being made
    std::string missing;           // "7 of 20 pictures, 1.4 of 4 s of sound"; empty if nothing is missing
    SharedWorld::Counts world;
    std::optional<Flattener::Cuts> cuts;  // with --tessellation
    struct Live {
        std::uint64_t states = 0;                           // of the scene, while it was followed
        std::uint64_t statesPictured = 0, statesHeard = 0;  // the other states were merged with these
        std::uint64_t picturesSkipped = 0;  // times k / F that passed while another picture was being made
        std::optional<LiveReport> device;
    };
    std::optional<Live> live;

    void addMissing(std::string_view what);
    /// In seconds. Adds nothing if all of it is there.
    void addMissingSound(double created, double wanted);
    /// The sound has not been written to a file; nor have the pictures, if they are one file.
    void forget(bool pictures);
    double meanKept() const { return pictureStates.empty() ? 0 : kept / static_cast<double>(pictureStates.size()); }
    /// Members ,"pictures":… of a JSON object.
    std::string json() const;
    /// One line of text.
    std::string text() const;
};

/// Members "seconds":… of a JSON object: how sound was played.
std::string liveFigures(const LiveReport& report);

/// The text for RenderStats::kept; empty for 0.
std::string keptText(double fraction);

/// Says by how much a picture misses --error, by its RenderStats. Empty if it does not.
std::string missingError(double asked, double reached, double unreached);
/// Warnings if paths find light by chance alone, or not at all: by RenderStats::hiddenLight and lostLight.
std::vector<Diagnostic> hiddenLightWarnings(const std::string& scene, double hidden, double lost);

/// Members ,"tessellation":… of a JSON object.
std::string tessellationJson(const Flattener::Cuts& cuts);

}  // namespace rtsg
