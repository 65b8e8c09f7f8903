// Options of outputs: declared, read, and checked before any work.
#include "output_arguments.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include <rtsg/audio/material_table.h>

namespace rtsg::app {

PictureSize PictureSize::parse(std::string_view text) {
    PictureSize size;
    const auto cross = text.find('x');
    const auto number = [](std::string_view digits, int& value) {
        const auto [end, problem] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
        return problem == std::errc() && end == digits.data() + digits.size() && value > 0 && value <= 65536;
    };
    if (cross == text.npos || !number(text.substr(0, cross), size.width) ||
        !number(text.substr(cross + 1), size.height))
        throw UsageError("--size", "expected WIDTHxHEIGHT in pixels, each from 1 to 65536, such as 1280x720");
    return size;
}

PictureRange parsePictureRange(const std::string& text) {
    constexpr std::uint64_t kMax = INT32_MAX - 1;  // numbers in names
    const std::size_t dash = std::min(text.find('-'), text.size());
    const auto number = [](std::string_view digits, std::uint64_t& value) {
        const auto [end, problem] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
        return problem == std::errc() && end == digits.data() + digits.size() && value <= kMax;
    };
    PictureRange range;
    const std::string_view all = text;
    if (!number(all.substr(0, dash), range.first) || !number(all.substr(std::min(dash + 1, text.size())), range.last) ||
        range.last < range.first)
        throw UsageError("--frames", text + ": expected two numbers of pictures, such as 100-199");
    return range;
}

namespace {

constexpr int kMaxTiles = 4096;  // a side of the largest picture has no more blocks of 16 pixels

/// Numbers between `marks`; false unless all of them are there.
bool parseNumbers(std::string_view text, std::string_view marks, std::initializer_list<int*> values) {
    std::size_t mark = 0;
    for (int* value : values) {
        const std::size_t end = mark < marks.size() ? text.find(marks[mark]) : text.size();
        if (end == text.npos) return false;
        const auto [stop, problem] = std::from_chars(text.data(), text.data() + end, *value);
        if (problem != std::errc() || stop != text.data() + end || *value < 0 || *value > kMaxTiles) return false;
        text.remove_prefix(std::min(end + 1, text.size()));
        ++mark;
    }
    return true;
}

}  // namespace

PictureTile parseTile(const std::string& text) {
    PictureTile tile;
    if (!parseNumbers(text, ",/,", {&tile.x, &tile.y, &tile.columns, &tile.rows}) || tile.x >= tile.columns ||
        tile.y >= tile.rows)
        throw UsageError("--tile", text + ": expected X,Y/COLUMNS,ROWS, such as 0,0/4,2 for the top left of eight");
    return tile;
}

PictureTile parseTileGrid(const std::string& text) {
    PictureTile grid;
    if (!parseNumbers(text, ",", {&grid.columns, &grid.rows}) || grid.columns < 1 || grid.rows < 1)
        throw UsageError("--tiles", text + ": expected COLUMNS,ROWS, such as 4,2");
    return grid;
}

void PictureArguments::addTileTo(Command& command) {
    const Command::Section section(command, "By many jobs");
    command.addOption("--tile", tile,
                      "X,Y/COLUMNS,ROWS: only this tile of the picture, with the bits that it has there, into "
                      "NAME.tile-X-Y-of-COLUMNS-ROWS (.png, .exr); rtsg assemble joins them");
}

std::string PictureArguments::fileOf(const std::string& file) const {
    if (tile.empty() || file.empty()) return file;
    if (auto ok = checkTileName(file); !ok) throw UsageError("--tile", ok.error().format());
    return parseTile(tile).of(file).string();
}

void PictureArguments::addTo(Command& command) {
    const Command::Section section(command, "Pictures");
    command.addOption("--size", size, "pixels, such as 1280x720")->preset();
    command.addOption("--viewpoint", viewpoint, "DEF name or description of a viewpoint; default: the bound one");
    command
        .addOption(
            "--integrator", integrator,
            "whitted: lights, mirrors, glass; path: light between surfaces too; raster: by OGRE, in rtsg render and "
            "view, without shadows and mirrors; hybrid: as whitted, but OGRE finds visible surfaces, in rtsg render")
        ->preset()
        ->oneOf({"whitted", "path", "raster", "hybrid"});
    command.addOption("--spp", samples, "samples a pixel; with --error the most, 16384 by default")
        ->preset()
        ->range(1, 1 << 20);
    command
        .addOption("--error", error,
                   "sample until pixels' relative standard error is this, such as 0.05; .exr gets intervals")
        ->range(1e-6, 1e3);
    command
        .addOption("--depth", depth, "most mirrorings and refractions along a ray; rays of little weight end earlier")
        ->preset()
        ->range(0, 250);
    command
        .addOption("--shadows", shadows,
                   "auto: as authored if any light's field is TRUE, else all; authored: by the lights' fields; all, "
                   "none: ignore the fields")
        ->preset()
        ->oneOf({"auto", "authored", "all", "none"});
    command
        .addOption("--color-space", colorSpace,
                   "auto: PhysicalMaterial and path in linear light, all else as display values; linear; display")
        ->preset()
        ->oneOf({"auto", "linear", "display"});
    command.addFlag("--caps", caps, "fill closed bodies where ClipPlanes cut them");
    command.addOption("--tessellation", tessellation,
                      "largest error of curved geometry: .5px of the picture (finer where it is near), or .01m; "
                      "default: 1/400 of its radius");
    command
        .addOption("--shutter", shutter,
                   "share of the time since the last picture in which the shutter is open: moving things, and a moving "
                   "eye, are blurred")
        ->range(1e-6, 1.0);
    command.addOption("--seed", seed, "of the sampling")->preset();
    command.addOption("--threads", threads, "0: as many as cores")->preset();
    command.addOption("--exposure", exposure, "factor on radiance; not for .exr")->preset()->positive();
}

ImageOptions PictureArguments::parse(bool mayRaster) const {
    ImageOptions options;
    const PictureSize pixels = PictureSize::parse(size);
    options.settings.width = pixels.width, options.settings.height = pixels.height;
    if (!tile.empty()) {
        options.settings.region = parseTile(tile).in(pixels.width, pixels.height);
        if (options.settings.region.empty())
            throw UsageError("--tile",
                             fmt::format("{}: a picture of {} has too few blocks of 16 x 16 pixels", tile, size));
    }
    if (integrator == "raster" || integrator == "hybrid") checkRaster(mayRaster);
    options.settings.integrator = integrator == "path"     ? Integrator::path
                                  : integrator == "raster" ? Integrator::raster
                                                           : Integrator::whitted;
    options.settings.colorSpace = colorSpace == "linear"    ? ColorSpace::linear
                                  : colorSpace == "display" ? ColorSpace::display
                                                            : ColorSpace::automatic;
    if (integrator == "path" && colorSpace == "display")
        throw UsageError("--color-space", "path computes in linear light; there are: auto, linear");
    options.settings.samplesPerPixel = samples;
    options.settings.error = static_cast<float>(error);
    if (error > 0 && samples == PictureArguments().samples) options.settings.samplesPerPixel = 16384;
    if (shutter > 0 && options.settings.samplesPerPixel == 1)
        throw UsageError("--shutter", "needs more than one sample a pixel: --spp");
    options.settings.shutter = static_cast<float>(shutter);
    options.settings.maxDepth = depth;
    options.settings.caps = caps;
    options.settings.threads = threads;
    options.settings.seed = seed;
    options.settings.shadows = shadows == "none"       ? Shadows::none
                               : shadows == "authored" ? Shadows::authored
                               : shadows == "all"      ? Shadows::all
                                                       : Shadows::automatic;
    options.viewpoint = viewpoint;
    return options;
}

void PictureArguments::checkRaster(bool mayRaster) const {
    const bool traces = integrator == "hybrid";
    if (!mayRaster)
        throw UsageError("--integrator", fmt::format("{} is for rtsg render{}; here there are: whitted, path",
                                                     integrator, traces ? "" : " and view"));
    const PictureArguments usual;
    const auto refuse = [this](bool asked, const char* option) {
        if (asked) throw UsageError(option, fmt::format("is not supported by --integrator {}", integrator));
    };
    refuse(!traces && shadows != usual.shadows && shadows != "none", "--shadows");
    refuse(!traces && depth != usual.depth && depth != 0, "--depth");
    refuse(!traces && colorSpace != usual.colorSpace, "--color-space");
    refuse(error > 0, "--error");
    refuse(shutter > 0, "--shutter");
    refuse(caps, "--caps");
    refuse(!tile.empty(), "--tile");
}

void PictureArguments::checkSize(const std::string& file, const ImageOptions& options) {
    if (file.empty()) return;
    if (auto ok = checkPictureSize(file, options.fileWidth(), options.fileHeight()); !ok)
        throw UsageError("--size", fmt::format("{}: {}", file, ok.error().text));
}

TessellationError PictureArguments::tessellationError() const {
    if (tessellation.empty()) return {};
    const std::string_view text = tessellation;
    float value = 0;
    const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
    const std::string_view unit = text.substr(static_cast<std::size_t>(end - text.data()));
    if (problem != std::errc() || !(value > 0) || !std::isfinite(value) || (unit != "px" && unit != "m"))
        throw UsageError("--tessellation", "expected pixels or metres above 0, such as .5px or .01m");
    return unit == "px" ? TessellationError{.pixels = value} : TessellationError{.metres = value};
}

void SoundArguments::addTo(Command& command) {
    const Command::Section section(command, "Sound");
    auto* b = command.addFlag("--binaural", binaural, "for headphones");
    auto* s = command.addFlag("--stereo", stereo, "for loudspeakers (the default)");
    auto* a = command.addOption("--ambisonic", ambisonic, "AmbiX (ACN, SN3D) of this order")->range(1, 7);
    b->excludes(s)->excludes(a);
    s->excludes(a);
    command.addOption("--sofa", sofa, "with --binaural: the head, as a SOFA file; without it, a sphere");
    given.addTo(command);
    command.addOption("--materials", materials,
                      "table of absorption in octaves by material names; overrides the scene");
    command.addOption("--rays", rays, "rays for each source; the default depends on the purpose")
        ->range(std::uint64_t{1}, std::uint64_t{1} << 40);
    command
        .addOption("--quality", quality,
                   "quality of played sound: 2 nearly halves its error for up to 1.7 times the time; below 1 saves a "
                   "tenth at most "
                   "(default 1)")
        ->range(0.25, 16.0);
    command.addOption("--diffraction", diffraction, "how many edges in a row sound bends round; 0: none")
        ->preset()
        ->range(0, 2);
    command.addOption("--temperature", air.celsius, "of the air, degrees Celsius; else the scene's, else 20")
        ->range(-50.0, 60.0);
    command.addOption("--humidity", air.relativeHumidity, "of the air, percent; else the scene's, else 50")
        ->range(0.0, 100.0);
    command.addOption("--speed-of-sound", air.speedOfSound, "m/s; default: from the temperature, else 343")
        ->range(10.0, 10'000.0);
    command.addFlag("--no-air", noAir, "no absorption by the air");
    command.addOption("--length", length, "seconds of reverberation to trace; the default depends on the purpose")
        ->range(0.01, 600.0);
}

ListenOptions SoundArguments::parse() const {
    using Channels = ImpulseResponseOptions::Channels;
    ListenOptions options;
    options.render.binaural = binaural;
    options.render.ambisonicOrder = ambisonic;
    if (!sofa.empty()) {
        if (!binaural) throw UsageError("--sofa is of --binaural");
        auto head = Hrtf::load(sofa, options.render.sampleRate);
        if (!head) throw InputError("--sofa", head.error().text);
        options.render.hrtf = std::move(*head);
    }
    if (!materials.empty()) {
        auto table = MaterialTable::read(materials);
        if (!table) throw InputError("--materials", table.error().format());
        options.render.materials = std::make_shared<const MaterialTable>(std::move(*table));
    }
    options.render.document = document;
    options.render.air = air;
    if (noAir) options.render.air.absorbs = false;
    if (quality > 0)
        options.render.trace = AcousticOptions::heardTrace(quality);
    else if (rays > 0)
        options.render.trace = AcousticOptions::heardTraceOf(rays);
    options.trace.diffractionOrder = options.render.trace.diffractionOrder = diffraction;
    if (length > 0) options.trace.maxSeconds = options.render.trace.maxSeconds = length;
    options.responses = ambisonic > 0 ? Channels::ambisonic
                        : binaural    ? Channels::binaural
                        : stereo      ? Channels::stereo
                                      : Channels::mono;
    if (rays > 0)
        options.trace.rays = rays;
    else if (error > 0)
        options.trace.rays = ListenOptions::kFirstRays;
    options.error = error;
    return options;
}

void OutputArguments::addTo(Command& command, Options which) {
    takesEvents = which == Options::ofRun;
    context = programContext();
    const Command::Section section(command, "What is made");
    command.addOption("--render", render,
                      "picture of the last state; with %04d in the name, .mp4 or .gif, one every 1/--fps s");
    if (which != Options::ofRun)
        command.addOption("--fps", picturesPerSecond, "pictures a second of scene time")->preset()->range(1e-3, 1e3);
    command.addOption("--listen", listen,
                      "WAV of the sound at the listener; the .mp4 of --render: into the film; device: play it (then "
                      "pictures are --live)");
    command.addOption("--device", device, "for --listen device; without it, the default device");
    command.addFlag("--live", live,
                    which == Options::ofMirror
                        ? "make pictures and sound of the newest state, states merged, instead of every one"
                        : "run in real time; pictures and sound of the newest state, states merged");
    command.addFlag("--denoise", denoise,
                    "for --live pictures by --integrator path: filters the noise of few samples; a preview");
    if (which == Options::ofMirror) command.addOption("--record", record, "log of every state");
    if (which == Options::ofMirror)
        command.addOption("--tiles", tiles,
                          "draw tiles of its pictures for rtsg assemble --live at this address (tcp://HOST:PORT)");
    command.addOption("--save", save, "the last state as a scene file, also .rtsgb");
    addForce(command, force);
    resources.addTo(command);
    picture.addTo(command);
    sound.addTo(command);
}

std::string SoundArguments::text() const {
    std::string files;
    for (const std::string& file : this->files()) files += (files.empty() ? "" : " ") + file;
    const auto chosen = [](const auto& value) { return value ? fmt::format("{}", *value) : std::string(); };
    return fmt::format(
        "binaural={},ambisonic={},rays={},quality={},diffraction={},length={},temperature={},humidity={},"
        "speed-of-sound={},air={},files={}",
        binaural, ambisonic, rays, quality, diffraction, length, chosen(air.celsius), chosen(air.relativeHumidity),
        chosen(air.speedOfSound), !noAir, files);
}

std::vector<std::string> SoundArguments::files() const {
    std::vector<std::string> names = given.files();
    if (!sofa.empty()) names.push_back(sofa);
    if (!materials.empty()) names.push_back(materials);
    return names;
}

OutputOptions OutputArguments::options() const {
    OutputOptions options = *this;
    options.existing = rtsg::app::existing(force);
    options.image = picture.parse();
    options.toneMap = picture.toneMap();
    options.tessellation = picture.tessellationError();
    if (!listen.empty()) {
        options.hearing = sound.parse();
        options.given = sound.given.sources();
        options.soundSettings = sound.text();
    }
    return options;
}

Result<> OutputArguments::check(const std::vector<std::string>& inputs, std::vector<OutputName> more) const {
    PictureArguments::checkSize(render, picture.parse());
    sound.parse();
    if (picture.tessellationError().pixels > 0 && !listen.empty())
        throw UsageError("--tessellation",
                         "with sound it is in metres: what a picture shows is not to change what is heard");
    sound.given.check(inputs);
    if (denoise && (!isLive() || render.empty() || picture.integrator != "path" || picture.error > 0))
        throw UsageError("--denoise", "is for --live pictures by --integrator path, without --error");
    if (!tiles.empty() && (!render.empty() || !listen.empty() || !save.empty() || isLive()))
        throw UsageError("--tiles", "goes not together with other outputs than --record");
    if (!tiles.empty() && (picture.shutter > 0 || !picture.tessellation.empty()))
        throw UsageError("--tiles", "cannot be combined with --shutter and --tessellation");
    if (denoise && !picture.tile.empty())
        throw UsageError("--denoise", "cannot be combined with --tile, since it uses pixels beyond a tile's edge");
    if (denoise && picture.shutter > 0)
        throw UsageError("--denoise", "cannot be combined with --shutter, since it needs sharp layers");
    if (picture.shutter > 0 && !animated())
        throw UsageError("--shutter",
                         "needs pictures in a row, into %04d, a .mp4 or .gif: it is open between two of them");
    if (onDevice() && sound.ambisonic > 0) throw UsageError("--ambisonic", "is for files: a device plays two channels");
    if (MovieWriter::isName(listen) && !soundInFilm())
        throw UsageError("--listen", listen + ": sound goes into the film of --render, or into a .wav of its own");
    if (soundInFilm() && sound.ambisonic > 0)
        throw UsageError("--ambisonic", "is for .wav files: a film has two channels");
    if (!device.empty() && !onDevice()) throw UsageError("--device", "is of --listen device");
    std::ranges::move(names(), std::back_inserter(more));
    std::vector<std::string> all = inputs;
    std::ranges::move(sound.files(), std::back_inserter(all));
    return checkFiles(all, more, force);
}

}  // namespace rtsg::app
