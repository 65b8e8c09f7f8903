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
    /// OutputOptions::soundSettings.
    std::string text() const;
    /// The files of which the sound is made, apart from the scene.
    std::vector<std::string> files() const;
};

/// "100-199". Throws UsageError.
PictureRange parsePictureRange(const std::string& text);

/// The outputs of a verb, as they are typed: --render, --listen, --save and what goes with them.
struct OutputArguments : OutputOptions {
    ResourceArguments resources;
    bool force = false;
    PictureArguments picture;
    SoundArguments sound;

    /// `run` has its own --fps, which is that of its pictures. Only `mirror` has --record.
    enum class Options : std::uint8_t { ofRun, ofReplay, ofMirror };
    void addTo(Command& command, Options which);
    /// With what is typed as texts. Throws UsageError.
    OutputOptions options() const;
    /// Checks before any work that everything can be made and nothing would overwrite one of `inputs` (checkFiles(),
    /// which also checks `more`). Throws UsageError.
    Result<> check(const std::vector<std::string>& inputs, std::vector<OutputName> more = {}) const;
};

}  // namespace rtsg::app
