// OutputOptions: the pictures, the sound and the files that are made of a scene while it runs.
//
// Pictures are numbered if the file's name has a place for a number (%04d), or are one file of several (.mp4, .gif);
// otherwise one is made at the end. Threading: values.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/core/output_file.h>
#include <rtsg/core/resource.h>
#include <rtsg/renderers/image.h>
#include <rtsg/session/given_sounds.h>
#include <rtsg/session/notices.h>

namespace rtsg {

/// `capture` is an MCAP file, `page` the page of a test, `testResult` JUnit XML, `ticks` the table of a touch, `table`
/// one of fields by time, `map` a picture or a table of a RoomMap.
enum class OutputKind : std::uint8_t {
    picture,
    sound,
    response,
    scene,
    log,
    capture,
    report,
    map,
    page,
    testResult,
    ticks,
    table
};

struct OutputName {
    std::string option, file;  // "--save", say; an empty file was not asked for
    OutputKind kind = OutputKind::picture;
};

/// False for empty names, "-", and irregular files, which cannot be overwritten.
bool isOutputFile(const std::string& name);
/// Errors (kUsageCode): an output is one of the used files, or of those that urls of the scene open.
Result<> checkUnused(const std::vector<std::filesystem::path>& used, const std::vector<OutputName>& outputs);
Result<> checkUnused(const Scene& scene, const Resources& resources, const std::vector<OutputName>& outputs);

/// Pictures by their numbers, both of them included.
struct PictureRange {
    std::uint64_t first = 0, last = 0;
    std::uint64_t count() const { return last - first + 1; }
};

struct OutputOptions {
    /// Files, empty for what is not wanted: pictures, a WAV or the film of `render` or "device", a log, a document.
    std::string render, listen, record, save;
    std::string device;   // for "device"; empty: the default one
    std::string tiles;    // tcp://HOST:PORT of the program that joins tiles which are drawn here
    std::string session;  // of the log, for Provenance; empty: the scene's first state tells it
    /// What two sounds of one session must have in common to be the same, as "name=value" by commas; for Provenance.
    std::string soundSettings;
    /// Only these of the pictures that a whole run would make, counted from `start`.
    std::optional<PictureRange> only;
    double start = 0;  // on the scene's clock
    double runUp = 0;  // seconds before the first picture's time from which on its sound has reflections
    double picturesPerSecond = 5;
    /// Scene time to make pictures and sound of.
    double seconds = std::numeric_limits<double>::infinity();
    Existing existing = Existing::keep;  // of `save`
    bool live = false;                   // of the newest state, states merged, instead of every one
    bool denoise = false;                // live pictures of few samples are filtered
    bool takesEvents = false;            // the scene runs here, so its nodes may be told what is heard
    bool endsByInterruption = false;     // no end was stated, so an interruption is the normal end
    ImageOptions image;
    ToneMap toneMap;
    TessellationError tessellation;
    ListenOptions hearing;
    std::vector<GivenSound> given;
    SessionContext context;

    bool animated() const;
    /// True if the sound goes into the film of `render`.
    bool soundInFilm() const;
    /// True if sound is played and not written.
    bool onDevice() const { return listen == "device"; }
    bool isLive() const { return live || onDevice(); }
    /// The sound of `only`, in samples since `start`: with reflections from `reflected` on, written from `begin` on, up
    /// to `end`.
    struct SoundStretch {
        std::int64_t reflected = 0, begin = 0, end = 0;
    };
    SoundStretch stretch() const;
    bool any() const {
        return !render.empty() || !listen.empty() || !record.empty() || !save.empty() || !tiles.empty();
    }
    std::vector<OutputName> names() const;
    /// The requested files, separated by commas.
    std::string written() const;
    /// True if interrupted before the stated end. Then files of the whole time, or of its end, are incomplete.
    bool isCutShort() const { return !endsByInterruption && context.interrupted(); }
    /// An error that names the files that are not written, if there are any.
    Result<> leftUnwritten() const;
};

}  // namespace rtsg
