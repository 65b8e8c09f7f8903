// RoomReport: the figures of a room at several places, their averages, and the curves behind them, as text, JSON or one
// self-contained HTML page. RoomSize: its volume and surfaces. RoomPlan: a cut through it. RoomMap: figures at the
// points of a grid. RoomResponses: impulse responses, as a SOFA file.
//
// Source: ISO 3382-1:2009, clause 8 (spatial averages: the arithmetic mean over all pairs of source and listener) and
// table A.1 (single numbers: the mean of the octaves of 500 and 1000 Hz); ISO 3382-2:2008, annex C, for how much places
// differ. A figure that is NaN somewhere is averaged over the places that have it. Threading: plain values,
// and pure functions over data that may be read on any thread.

// Example:
//     #include <rtsg/audio/room_report.h>
//     rtsg::RoomReport report;  // or SoundRenderer::survey()
//     report.title = "hall";
//     const std::string page = report.toHtml();
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <glm/glm.hpp>

#include <rtsg/audio/acoustic_geometry.h>
#include <rtsg/audio/bands.h>
#include <rtsg/audio/echogram.h>
#include <rtsg/audio/hrtf.h>
#include <rtsg/audio/impulse_response.h>
#include <rtsg/audio/room_metrics.h>
#include <rtsg/audio/room_openings.h>
#include <rtsg/audio/speech_transmission.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/renderers/picture.h>

namespace rtsg {

struct WallsVersion;

/// Volume and surfaces of the room around a place, and what the reverberation times follow from.
struct RoomSize {
    struct Surface {
        std::uint32_t material = 0;  // of the geometry
        double area = 0;             // m^2, both sides of two-sided surfaces
    };
    double volume = std::numeric_limits<double>::quiet_NaN();  // m^3
    double surface = volume;                                   // m^2, openings included
    double openings = 0;                                       // m^2 of openings, through which rays left
    std::vector<Surface> surfaces;                             // the largest first
    AcousticBox box;                                           // of all hits
    /// Some points in the room, spread evenly.
    std::vector<glm::dvec3> positions;

    bool known() const { return volume > 0; }
    /// Mean distance between two reflections, m.
    double meanFreePath() const { return 4 * volume / surface; }
};

/// Measures the room around a point that touches no wall. Nothing is known if more than a quarter of the rays leave:
/// then there is no room. It is measured by rays, so that no closed mesh is needed and only surfaces that sound reaches
/// are counted. Rays that every surface scatters by Lambert's law hit surfaces in proportion to their areas, and points
/// on their paths are spread evenly over the room. The volume is the mean volume seen from such points, divided by the
/// share of pairs of points that see each other. The surface is four times the volume divided by the mean free path.
/// Both are accurate to half a per cent in a single room, and to some per cent in rooms that are coupled by small
/// doors. Source: Kosten, Acustica 10 (1960), on mean free paths; Sabine 1900; Eyring, JASA 1 (1930), 217.
RoomSize measureRoom(const AcousticGeometry& geometry, const glm::dvec3& inside);

/// Equivalent absorption area, m^2, without air; transmission counts as absorption.
Bands absorptionArea(const RoomSize& room, std::span<const AcousticMaterial> materials);
/// Reverberation times, s, air included; NaN if the room is not known or the sound never decays.
Bands sabineTimes(const RoomSize& room, std::span<const AcousticMaterial> materials, const Air& air);
Bands eyringTimes(const RoomSize& room, std::span<const AcousticMaterial> materials, const Air& air);

/// A horizontal cut through a room.
struct RoomPlan {
    using Line = std::array<glm::dvec2, 2>;  // x and z, m
    double height = 0;                       // y of the cut, m
    std::vector<Line> lines;                 // the cut walls
    std::size_t leftOut = 0;                 // number of lines beyond the first 20,000
};

/// Cuts all triangles that sound can hit. Lines outside the box, which has a margin, are dropped.
RoomPlan planOf(const WallsVersion& walls, double height, const AcousticBox& box);

/// Points at one height, `step` apart along x and z; some of them are in the room.
struct FloorGrid {
    double height = 0, step = 1, x = 0, z = 0;  // m; x, z: of the first point
    std::size_t columns = 0, rows = 0;          // along x and z
    std::vector<std::size_t> inside;            // numbers of points, row by row

    glm::dvec3 position(std::size_t point) const {
        const std::size_t column = point % columns, row = point / columns;
        return {x + step * static_cast<double>(column), height, z + step * static_cast<double>(row)};
    }
};

/// The points that sound can reach through the air of the room. Errors: the room is open or not known; more than 10,000
/// points; none at that height.
Result<FloorGrid> gridIn(const AcousticGeometry& geometry, const RoomSize& room, double height, double step);

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

/// The figure that a map shows.
struct MapFigure {
    std::string name;                 // "C80", or "STI"
    std::optional<std::size_t> band;  // none: the mean of 500 and 1000 Hz; none for the STI

    /// Parses "C80", "C80@2000" or "STI". Errors: an unknown figure or octave; the message lists the known ones.
    static Result<MapFigure> parse(std::string_view text);
    /// With octave and unit.
    std::string title() const;
};

/// Figures at the points of a grid, as a table and as a picture.
struct RoomMap {
    FloorGrid grid;
    RoomReport report;  // its pairs are source by source, with the points of the grid in order; without echograms

    /// By point of the grid, row by row: the mean over sources; NaN outside the room and where the figure does not
    /// exist.
    std::vector<double> values(const MapFigure& figure) const;
    /// A line for each source and point: source, x, y, z, then each figure in each octave with the half width of its 95
    /// % interval. NaN becomes an empty cell.
    std::string toCsv() const;
    /// A plan from above (x to the right, z down) with the sources, the figure as colours, and a colour scale.
    Picture picture(const MapFigure& figure) const;
};

/// A box along the axes of the world.
struct RoomBox {
    glm::dvec3 low{0}, high{0};
};

/// Impulse responses of a room from every source to every listener: what SoundRenderer::responses() makes of a
/// survey().
struct RoomResponses {
    struct Pair {
        std::string source, listener;
        glm::dvec3 sourceAt{0}, listenerAt{0};  // m, world
        glm::dvec3 sourceAim{0};                // where it points; 0 if it is omnidirectional
        glm::dmat3 listenerAxes{1.0};           // right, up, back
        ImpulseResponse response;
        double headRadius = kHeadRadius;  // of binaural responses: distance of the ears from the middle
    };
    std::string title, scene;  // `scene`: a name or url of the document with the room
    std::string application, applicationVersion;
    ImpulseResponseOptions::Channels channels = ImpulseResponseOptions::Channels::mono;
    int ambisonicOrder = 1;
    int sampleRate = 48000;
    Air air;
    std::optional<RoomBox> box;  // set if the room is a box
    std::vector<Pair> pairs;
};

/// Writes a SOFA file (AES69-2022, SOFA 2.1), which has a measurement for each pair, in the order of `pairs`. Pressure,
/// binaural and ambisonic responses follow the convention SingleRoomSRIR 1.0. Stereo responses, which no receiver in a
/// room would record, follow GeneralFIR 1.0. The axes of SOFA have z up: (x, y, z) of X3D becomes (x, -z, y). Receivers
/// lie in the listener's frame, which looks along x with y to the left. Data.IR holds the same samples as a WAV of the
/// responses, with pressure 1 at 1 m; Data.Delay is 0. Ambisonic channels are AmbiX (ACN, SN3D), as ReceiverDescription
/// says. RoomType is "shoebox", with corners, if six walls form a box; otherwise "reverberant". The times in a file are
/// those of writing, or SOURCE_DATE_EPOCH. Errors: there are no pairs, or pairs with different channels or sample
/// rates; this build has no netCDF; the file cannot be written. An existing file is replaced only when the new one is
/// complete.
Result<> writeSofa(const std::string& path, const RoomResponses& responses);

}  // namespace rtsg
