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
#include <rtsg/audio/room_metrics.h>
#include <rtsg/audio/room_openings.h>

namespace rtsg {

struct TraceOptions {
    /// By default as high as candidates allow and as is useful: images are exact where rays are noisy (above all in
    /// flutter echoes), but carry little energy between scattering walls.
    int imageOrder = 1000;
    std::size_t maxImageCandidates = 60'000;
    /// Sound that is scattered and then reflected specularly up to this many times (0 to 3) is connected with the most
    /// important images of the listener. Other specular sound must hit the ball.
    int connectedOrder = 3;
    std::uint64_t rays = 20'000;
    /// Number of independent parts of the rays, for the confidence intervals; at least 2.
    int batches = 16;
    /// Length of the echogram. 0: until the energy has fallen by 65 dB: 1 s to a minute, or 10 s if that takes 4,000
    /// reflections.
    double maxSeconds = 0;
    double binsPerSecond = 1000;
    /// The radius of the ball, m. 0: chosen by the size of the room: half a metre in 100 m^3, three metres in 100,000
    /// m^3.
    double receiverRadius = 0;
    std::uint64_t seed = 1;
    Air air;
    /// The number of edges in a row that diffract sound, 0 to 2 (see edge_rows/diffraction_edges.h). Unless 0, sound is
    /// also diffracted by round cylinders and spheres (see round_bodies/diffraction_round_bodies.h).
    int diffractionOrder = 2;
    /// The largest number of escaped rays of each batch and run that TraceResult::exits lists.
    int exits = 0;
    /// The directivity of the source, for rays and for paths to images.
    SourcePattern pattern = {};
    /// Whether results include lateral energy, which LF and IACC need: TraceResult::across.
    bool lateral = false;
    /// Called now and then while rays are traced, on any thread and on several at once. If it returns false, tracing
    /// ends soon, and its output is invalid.
    std::function<bool()> goOn = {};
};

/// Statistics of the pairs of edges round which sound is diffracted.
struct EdgePairCount {
    std::size_t heard = 0;
    std::size_t leftOut = 0;  // pairs beyond the limit; those with the shortest paths were used
};

struct TraceResult {
    std::vector<Arrival> arrivals;         // exact part
    EdgeField edges;                       // the diffracted part of it
    std::vector<EnergyHistogram> batches;  // random part: equally good estimates of it
    std::uint64_t rays = 0;
    /// Number of bands that were traced; the others are copies of bands with the same materials and cost nothing.
    int bandsTraced = 0;
    int imageOrder = 0;        // the last that was complete within maxImageCandidates
    double imageFraction = 0;  // lower bound for the best share of energy that the paths of images keep
    std::size_t imageCandidates = 0;
    EdgePairCount edgePairs;
    double seconds = 0;         // length of the echogram
    double receiverRadius = 0;  // the one used
    double receiverVolume = 0;  // m^3 of the ball that are seen from the listener
    /// More than 0 in bands in which random sound could have arrived. If none did, the figures have no interval.
    Bands tried{};
    /// Shares of the emitted energy: absorbed by surfaces and air; escaped to infinity; still on its way at maxSeconds.
    Bands absorbed{}, escaped{}, truncated{};
    /// Some of the rays that escaped, as many as requested, each chosen with the same probability; a few thousand at
    /// most.
    std::vector<EscapedRay> exits;
    /// The horizontal axis through the ears of a listener who faces the source, to the right, of unit length (x if the
    /// source is straight above or below). EnergyHistogram::lateral refers to it. 0: not requested.
    glm::dvec3 across{0};

    /// Whether no sound arrived at all.
    bool silent() const;
    Echogram echogram() const;
    /// The figures without those that the end of the echogram truncates: T30, T20 and EDT are NaN if more than -45,
    /// -35, -20 dB of a band's energy was still on its way then, and with EDT all other figures.
    MetricsEstimate metrics() const;
};

}  // namespace rtsg
