// Options for the outputs of a scene (pictures, sound, a log, a document) and for their files.
// Threading: the main thread.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/renderers/image.h>
#include <rtsg/renderers/picture_tiles.h>

#include "cli.h"
#include "files.h"
#include "given_sounds.h"

namespace rtsg::app {

/// "1280x720". Throws UsageError.
struct PictureSize {
    int width = 0, height = 0;
    static PictureSize parse(std::string_view text);
};

/// "1,0/4,2", and the grid alone, "4,2". Throw UsageError.
PictureTile parseTile(const std::string& text);
PictureTile parseTileGrid(const std::string& text);

/// --size, --spp and so on, shared by all verbs that make pictures.
struct PictureArguments {
    std::string size = "1280x720", viewpoint, integrator = "whitted", shadows = "auto", colorSpace = "auto",
                tessellation, tile;
    int samples = 4, depth = 250;
    unsigned threads = 0;
    std::uint64_t seed = 1;
    double error = 0, exposure = 1, shutter = 0;
    bool caps = false;

    void addTo(Command& command);
    /// --tile, of verbs that write files of tiles.
    void addTileTo(Command& command);
    /// The file of the tile, or `file` without --tile. Throws UsageError for a kind of file that has no tiles.
    std::string fileOf(const std::string& file) const;
    /// Throws UsageError for what is wrong, and for --integrator raster unless `mayRaster`, or with what that cannot
    /// do.
    ImageOptions parse(bool mayRaster = false) const;
    /// The value of --tessellation. Throws UsageError.
    TessellationError tessellationError() const;
    /// Throws UsageError if such a picture does not fit the file's format.
    static void checkSize(const std::string& file, const ImageOptions& options);
    ToneMap toneMap() const { return {static_cast<float>(exposure)}; }

  private:
    void checkRaster(bool mayRaster) const;
};

/// --binaural, --stereo, --rays and so on.
struct SoundArguments {
    bool binaural = false, stereo = false;
    int ambisonic = 0;
    std::uint64_t rays = 0;
    double quality = 0;  // 0: by the rays, if they are given
    int diffraction = TraceOptions().diffractionOrder;
    double error = 0, length = 0;
    AirChoice air;
    bool noAir = false;
    std::string sofa, materials;
    GivenSoundArguments given;
    std::string document;  // the scene's file, if any; set by the verb

    void addTo(Command& command);
    /// Parses everything except given sounds: see GivenSoundArguments::open().
    ListenOptions parse() const;
    /// The files of which the sound is made, apart from the scene.
    std::vector<std::string> files() const;
};

/// "100-199": pictures by their numbers, both of them included.
struct PictureRange {
    std::uint64_t first = 0, last = 0;
    /// Throws UsageError.
    static PictureRange parse(const std::string& text);
    std::uint64_t count() const { return last - first + 1; }
};

struct OutputArguments {
    std::string render, listen, record, save, device;
    std::string tiles;  // tcp://HOST:PORT of the program that joins tiles which are drawn here
    /// --frames of replay: only these of the pictures that a whole run would make, counted from `start`. Set by the
    /// verb.
    std::optional<PictureRange> only;
    double start = 0;  // on the scene's clock
    double runUp = 0;  // seconds before the first picture's time from which on its sound has reflections
    ResourceArguments resources;
    double picturesPerSecond = 5;
    /// Scene time to make pictures and sound of; set by the verb.
    double seconds = std::numeric_limits<double>::infinity();
    bool force = false, live = false, denoise = false;
    bool takesEvents = false;  // the scene runs here, so its nodes may be told what is heard; set by addTo()
    /// No end was stated, so an interruption is the normal end. Set by the verb.
    bool endsByInterruption = false;
    PictureArguments picture;
    SoundArguments sound;

    /// `run` has its own --fps, which is that of its pictures. Only `mirror` has --record.
    enum class Options : std::uint8_t { ofRun, ofReplay, ofMirror };
    void addTo(Command& command, Options which);
    bool animated() const;
    /// True if --listen names the film of --render.
    bool soundInFilm() const;
    /// True if sound is played and not written.
    bool onDevice() const { return listen == "device"; }
    bool isLive() const { return live || onDevice(); }
    /// The sound of `only`, in samples since `start`: with reflections from `reflected` on, written from `begin` on, up
    /// to `end`.
    struct SoundStretch {
        std::int64_t reflected = 0, begin = 0, end = 0;
    };
    SoundStretch stretch(const ListenOptions& options) const;
    bool any() const {
        return !render.empty() || !listen.empty() || !record.empty() || !save.empty() || !tiles.empty();
    }
    std::vector<OutputName> names() const;
    /// The requested files, separated by commas.
    std::string written() const;
    /// True if interrupted before the stated end. Then files of the whole time, or of its end, are incomplete.
    bool isCutShort() const { return !endsByInterruption && interrupted(); }
    /// An error that names the files that are not written, if there are any.
    Result<> leftUnwritten() const;
    /// Checks before any work that everything can be made and nothing would overwrite one of `inputs` (checkFiles(),
    /// which also checks `more`). Throws UsageError.
    Result<> check(const std::vector<std::string>& inputs, std::vector<OutputName> more = {}) const;
};

}  // namespace rtsg::app
