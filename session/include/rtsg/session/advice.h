// Advice: what each setting costs in a scene at hand, how far its result is from the truth there, and what follows.
//
// advise() makes short trials of the scene as it is and as it runs: pictures, played sound, figures of rooms, mirrors.
// Invariant: a setting is marked as beaten only if another is no worse in any cost and surely no worse in error, and
// better in one of them. The truth of pictures and rooms is two long independent trials, so a trial's error is
// unbiased: mean((trial - a)(trial - b)). Costs are CPU seconds of the whole process, which nothing else should use.
// Threading: advise() on the scene's thread; trials use as many threads as AdviceOptions::cores.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/renderers/light_renderer.h>
#include <rtsg/session/notices.h>

namespace rtsg {

enum class Sense : std::uint8_t { pictures, sound, rooms, mirror, touch };
inline constexpr std::string_view kSenseNames[] = {"pictures", "sound", "rooms", "mirror", "touch"};
constexpr std::string_view nameOf(Sense sense) {
    return kSenseNames[static_cast<std::size_t>(sense)];
}

/// One setting and what became of it.
struct Trial {
    std::string setting;        // options of the verb: "--integrator path --spp 16"
    std::vector<double> costs;  // in the units of the table
    double error = std::numeric_limits<double>::quiet_NaN(), interval = 0;  // half of 95 %, in the table's unit
    bool predicted = false;                                                 // computed from other trials
    bool beaten = false;
};
/// Sets Trial::beaten of all trials; those without an error neither beat nor are beaten.
void markBeaten(std::span<Trial> trials);

/// How error and cost of pictures by path depend on their samples: `errorOfOne` / samples^power, and CPU seconds. The
/// power is .5 for independent samples, and more where even ones help.
struct PathCost {
    double errorOfOne = 0, power = .5, relativeInterval = 0, fixed = 0, perSample = 0;

    double errorAt(double samples) const { return errorOfOne * std::pow(samples, -power); }
    /// The least samples for an error above 0, and the cost of so many.
    double samplesFor(double error) const {
        return std::max(1.0, std::ceil(std::pow(errorOfOne / error, 1 / power) - 1e-9));
    }
    double costOf(double samples) const { return fixed + perSample * samples; }
};

struct AdviceTable {
    Sense sense = Sense::pictures;
    std::string how;                     // how it was measured, in a sentence
    std::vector<std::string> costUnits;  // "CPU-s a picture"
    std::string errorUnit;               // "RMS / mean"
    std::vector<Trial> trials;
    std::vector<std::string> sentences;  // what follows
    std::optional<PathCost> path;        // of pictures
};

/// The settings that trials found best, for later runs (--plan). In a file, a line for each verb has them as they are
/// typed, and # begins a comment.
struct Plan {
    std::optional<std::string> integrator;  // of render
    std::optional<int> samples;
    bool linear = false;            // --color-space linear
    std::optional<double> quality;  // of listen
    std::optional<int> diffraction;
    double pictureError = 0, soundError = 0;  // expected: RMS / mean, JND; not in the file

    std::string toText(const std::string& scene) const;
    /// Error: a file that cannot be read, or is no plan, with its line and column.
    static Result<Plan> read(const std::string& file);
};

struct Advice {
    std::string scene;
    std::vector<AdviceTable> tables;
    std::vector<std::string> missing;  // what was asked for and could not be measured
    double seconds = 0, cpuSeconds = 0;
    Plan plan;
    Diagnostics diagnostics;

    std::string toText() const;
    std::string toJson() const;
    /// A page with the tables and a diagram each, and the diagrams alone.
    std::string toHtml() const;
    std::string toSvg() const;
};

struct AdviceOptions {
    std::string document;          // the scene as it is typed in commands
    std::vector<Sense> senses;     // empty: what the scene has
    ImageOptions image;            // size, viewpoint
    double picturesPerSecond = 0;  // 0: no deadline
    unsigned cores = 0;            // 0: all
    double seconds = 20;           // of all measuring
    std::uint64_t seed = 1;
    double error = .05;  // of pictures, that the plan aims at
    Resources resources;
    SessionContext context;
    /// Seconds of a clock; a test may have its own.
    std::function<double()> now;
    /// False ends the trials.
    std::function<bool()> goOn;
    /// Runs the scene to a time since its start; false at its end. It is called with rising times.
    std::function<bool(double)> runTo;
};

/// Error: cancelled; the world follows its scene no more.
Result<Advice> advise(SharedWorld& world, const AdviceOptions& options);

/// What can be made of one picture for so many CPU seconds, trials included: `best` is what is left to do. It makes
/// short trials by `light` for a tenth of it.
struct BudgetChoice {
    ImageOptions best;
    double expectedError = 0;  // RMS / mean; NaN: unknown
    double spent = 0;          // CPU seconds
};
Result<BudgetChoice> chooseFor(LightRenderer& light, const ImageOptions& image, double cpuSeconds,
                               const std::function<bool()>& goOn = {});

}  // namespace rtsg
