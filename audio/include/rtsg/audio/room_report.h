// RoomReport: the figures of a room at several places, their averages, and the curves behind them, as text, JSON or one
// self-contained HTML page.
//
// Source: ISO 3382-1:2009, clause 8 (spatial averages: the arithmetic mean over all pairs of source and listener) and
// table A.1 (single numbers: the mean of the octaves of 500 and 1000 Hz); ISO 3382-2:2008, annex C, for how much places
// differ. A figure that is NaN somewhere is averaged over the places that have it. Threading: a plain value.

// Example:
//     #include <rtsg/audio/room_report.h>
//     rtsg::RoomReport report;  // or SoundRenderer::survey()
//     report.title = "hall";
//     const std::string page = report.toHtml();
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/bands.h>
#include <rtsg/audio/echogram.h>
#include <rtsg/audio/panning.h>
#include <rtsg/audio/room_metrics.h>
#include <rtsg/audio/room_openings.h>
#include <rtsg/audio/room_plan.h>
#include <rtsg/audio/room_size.h>
#include <rtsg/audio/speech_transmission.h>
#include <rtsg/core/diagnostic.h>

namespace rtsg {

struct RoomReport {
    /// One source at one listening place.
    struct Pair {
        std::string source, listener;
        glm::dvec3 sourceAt{0}, listenerAt{0};
        MetricsEstimate metrics;
        Bands escaped{};  // share of the energy that escaped
        Echogram echogram;
        std::optional<Echogram> directed;  // for impulse responses, see ListenReport::Source::directed
        int bandsTraced = 0;               // TraceResult::bandsTraced
        glm::dvec3 sourceAim{0};           // the unit direction in which it points; 0 if it is omnidirectional
        glm::dmat3 listenerAxes{1.0};      // right, up, back
        double headRadius = kHeadRadius;   // of binaural responses
        SpeechEstimate speech;
        double schroederHz = std::numeric_limits<double>::quiet_NaN();  // ListenReport::Source::schroederHz
    };
    /// A material of the surfaces, with the name or the line of the node that defines it.
    struct Material {
        std::string name;
        double area = 0;  // m^2
        AcousticMaterial material;
    };
    /// How much sound of one source leaves the room, and by which opening most of it.
    struct Losses {
        std::string source;
        RoomOpenings openings;
    };
    struct Average {
        RoomMetrics mean, deviation;  // the latter is that of the sample; NaN with fewer than two places
        RoomMetrics count;            // number of places with the figure
    };

    std::string title;
    Air air;
    std::vector<Pair> pairs;
    std::vector<Losses> losses;  // one for each source
    SpeechOptions speech;        // of the STI
    /// The room around the first source, as far as it is known; its materials, the largest area first; and
    /// reverberation times by formulas, s.
    RoomSize room;
    std::vector<Material> materials;
    Bands sabine = allBands(std::numeric_limits<double>::quiet_NaN()), eyring = sabine;
    RoomPlan plan;            // at the height of the first listener
    std::uint64_t rays = 0;   // summed over sources; listeners share them
    double seconds = 0;       // of computing
    Diagnostics diagnostics;  // leaks and sealed sources that were not reported before

    Average average() const;
    /// The largest numbers, over all pairs, of bands that were traced and of bands whose figures were computed. Bands
    /// that walls and air treat alike are computed once.
    int bandsTraced() const;
    int bandsMeasured() const;
    /// The mean of the known STIs; NaN if there are none.
    double meanSpeech() const;
    /// The Schroeder frequency 2000 sqrt(T / V), Hz: below it single modes dominate, which rays do not model. That of
    /// the first pair, or else with Sabine's T; NaN if the room is not closed.
    double schroederHz() const;
    /// The mean of the octaves of 500 and 1000 Hz.
    static double single(const Bands& figure) { return (figure[kBand1k - 1] + figure[kBand1k]) / 2; }

    std::string toText() const;
    /// {"title":…,"bands_hz":[…],"bands_computed":{"walls":…,"figures":…},"pairs":[{"source":…,"listener":…,…}],"average":{"mean":{…},"deviation":{…}},
    /// "single":{…},"room":{…},"losses":[{"source":…,"escaped":…,"by":{"share":…,"center":[…],…}}]};
    /// what is no number is null.
    std::string toJson() const;
    /// A page that can be printed: figures with their intervals, a plan, materials, decay curves with the fitted lines,
    /// reflectograms and energograms, drawn in SVG. Colours show how many just noticeable differences an interval is
    /// wide, or a place is away from the mean of all.
    std::string toHtml() const;
};

}  // namespace rtsg
