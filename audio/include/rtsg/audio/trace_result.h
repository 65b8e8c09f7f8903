// The options of a trace of sound, and its result.
//
// Threading: values.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/echogram.h>
#include <rtsg/audio/image_sources.h>
#include <rtsg/audio/room_metrics.h>
#include <rtsg/audio/room_openings.h>

namespace rtsg {

struct TraceOptions {
    /// By default as high as the candidates allow and is worth it: images are exact where rays are noisy (flutter
    /// echoes above all), but of walls that scatter they have little.
    int imageOrder = 1000;
    std::size_t maxImageCandidates = 60'000;
    /// Sound that is scattered and then mirrored at most so many times (0 to 3) is connected with the images of the
    /// listener that are worth most. Other mirrored sound has to meet the ball.
    int connectedOrder = 3;
    std::uint64_t rays = 20'000;
    /// Independent parts that the rays are divided into, for the confidence intervals; at least 2.
    int batches = 16;
    /// Length of the echogram; 0: until 65 dB are gone: 1 s to a minute, or 10 s where that takes 4,000 reflections.
    double maxSeconds = 0;
    double binsPerSecond = 1000;
    /// The radius of the ball, m; 0 chooses it by the room: half a metre in 100 m^3, three metres in 100,000 m^3.
    double receiverRadius = 0;
    std::uint64_t seed = 1;
    Air air;
    /// Sound bends round edges (see edge_rows/diffraction_edges.h), 0 to 2 of them in a row; and, but with 0, round
    /// cylinders and spheres (see round_bodies/diffraction_round_bodies.h).
    int diffractionOrder = 2;
    /// The most rays of each batch and run that TraceResult::exits tells of those that escape.
    int exits = 0;
    /// The directivity of the source, which holds for rays and for paths to the images.
    SourcePattern pattern = {};
    /// Whether results tell what comes from the sides, which LF and IACC need: TraceResult::across.
    bool lateral = false;
    /// Asked now and then while rays are traced, on any thread and on several at once; once it says false tracing ends
    /// soon, and what it gave is no result.
    std::function<bool()> goOn = {};
};

/// Pairs of edges round which sound goes, where it does not come straight.
struct EdgePairCount {
    std::size_t heard = 0;
    std::size_t leftOut = 0;  // there were too many: the shortest ways were looked at
};

struct TraceResult {
    std::vector<Arrival> arrivals;         // exact part
    EdgeField edges;                       // and what of it edges bend
    std::vector<EnergyHistogram> batches;  // random part: equally good estimates of the same
    std::uint64_t rays = 0;
    /// Bands that were traced; walls treat the others as one of them, so that these cost nothing.
    int bandsTraced = 0;
    int imageOrder = 0;     // that was complete within maxImageCandidates
    double imageShare = 0;  // of energy that the paths of images keep at best, at least
    std::size_t imageCandidates = 0;
    EdgePairCount edgePairs;
    double seconds = 0;         // length of the echogram
    double receiverRadius = 0;  // used
    double receiverVolume = 0;  // m^3 of the ball that are seen from the listener
    /// More than 0 in bands of which something might have arrived by chance; where nothing of them did, the figures
    /// have no interval.
    Bands tried{};
    /// Shares of the emitted energy: absorbed by surfaces and air, gone to infinity, still on its way at maxSeconds.
    Bands absorbed{}, escaped{}, truncated{};
    /// Some of the rays that escaped, as many as were asked for, each chosen with the same chance; a few thousand at
    /// most.
    std::vector<EscapedRay> exits;
    /// The level axis through the ears of who faces the source, to the right, unit (x where the source is straight
    /// above or below): what EnergyHistogram::lateral is about. 0: not asked for.
    glm::dvec3 across{0};

    /// Whether nothing arrived at all.
    bool silent() const;
    Echogram echogram() const;
    /// Without the times whose decay the end of the echogram cuts: T30, T20 and EDT are NaN when more than -45, -35,
    /// -20 dB of a band's energy was still on its way then, and with EDT all other figures.
    MetricsEstimate metrics() const;
};

}  // namespace rtsg
