// What is made of a scene that something else drives: pictures, sound, a log, a document.
#include "outputs.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <rtsg/core/scene_exporter.h>
#include <rtsg/core/writer.h>

namespace rtsg::app {

void PictureArguments::addTo(Command& command) {
    command.addOption("--size", size, "pixels, such as 1280x720")->preset();
    command.addOption("--viewpoint", viewpoint, "DEF name or description of a viewpoint; else the bound one");
    command
        .addOption("--integrator", integrator,
                   "whitted: lights, mirrors, glass; path: light between surfaces too; raster is not built in")
        ->preset()
        ->oneOf({"whitted", "path", "raster"});
    command.addOption("--spp", samples, "samples a pixel; with --error at most, 16384 unless given")
        ->preset()
        ->range(1, 1 << 20);
    command
        .addOption("--error", error,
                   "sample until pixels' relative standard error is this, such as 0.05; .exr gets intervals")
        ->range(1e-6, 1e3);
    command.addOption("--depth", depth, "mirrorings and refractions along a ray at most; its weight ends it before")
        ->preset()
        ->range(0, 250);
    command
        .addOption("--shadows", shadows,
                   "auto: as the lights' fields say if any says TRUE, else all; authored; all: whatever they say; none")
        ->preset()
        ->oneOf({"auto", "authored", "all", "none"});
    command
        .addOption("--color-space", colorSpace,
                   "auto: PhysicalMaterial and path in linear light, all else as display values; linear; display")
        ->preset()
        ->oneOf({"auto", "linear", "display"});
    command.addFlag("--caps", caps, "fill closed bodies where ClipPlanes cut them");
    command.addOption("--tessellation", tessellation,
                      "how far curved geometry may lie from its surface: .5px of the picture (finer where it is near), "
                      "or .01m; else 1/400 of its radius");
    command
        .addOption(
            "--shutter", shutter,
            "share of the time since the picture before in which the shutter is open, up to this one: what moves, "
            "and the eye, is blurred")
        ->range(1e-6, 1.0);
    command.addOption("--seed", seed, "of the sampling")->preset();
    command.addOption("--threads", threads, "0: as many as cores")->preset();
    command.addOption("--exposure", exposure, "factor on radiance; .exr stays as it is")->preset()->positive();
}

ImageOptions PictureArguments::parse() const {
    ImageOptions options;
    const auto cross = size.find('x');
    const auto number = [&](std::string_view text, int& value) {
        const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
        return problem == std::errc() && end == text.data() + text.size() && value > 0 && value <= 65536;
    };
    if (cross == std::string::npos || !number(std::string_view(size).substr(0, cross), options.settings.width) ||
        !number(std::string_view(size).substr(cross + 1), options.settings.height))
        throw UsageError("--size", "expected WIDTHxHEIGHT in pixels, each from 1 to 65536, such as 1280x720");
    if (integrator == "raster")
        throw UsageError("--integrator", integrator + " is not built in; there are: whitted, path");
    options.settings.integrator = integrator == "path" ? Integrator::path : Integrator::whitted;
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
    auto* b = command.addFlag("--binaural", binaural, "for headphones");
    auto* s = command.addFlag("--stereo", stereo, "for loudspeakers (the default)");
    auto* a = command.addOption("--ambisonic", ambisonic, "AmbiX (ACN, SN3D) of this order")->range(1, 7);
    b->excludes(s)->excludes(a);
    s->excludes(a);
    command.addOption("--sofa", sofa, "of --binaural: the head, as a SOFA file; else a sphere");
    given.addTo(command);
    command.addOption("--rays", rays, "rays a source; else what is usual for the purpose")
        ->range(std::uint64_t{1}, std::uint64_t{1} << 40);
    command.addOption("--temperature", air.celsius, "of the air, degrees Celsius; else the scene's, else 20")
        ->range(-50.0, 60.0);
    command.addOption("--humidity", air.relativeHumidity, "of the air, percent; else the scene's, else 50")
        ->range(0.0, 100.0);
    command.addOption("--speed-of-sound", air.speedOfSound, "m/s; else by the temperature, else 343")
        ->range(10.0, 10'000.0);
    command.addFlag("--no-air", noAir, "air absorbs nothing");
    command
        .addOption("--length", length, "seconds of reverberation that are traced; else what is usual for the purpose")
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
    options.render.document = document;
    options.render.air = air;
    if (noAir) options.render.air.absorbs = false;
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
    options.render.ask(rays, error);
    return options;
}

void OutputArguments::addTo(Command& command, Options which) {
    command.addOption("--render", render,
                      "picture of the last state; with %04d in the name, .mp4 or .gif, one every 1/--fps s");
    if (which != Options::ofRun)
        command.addOption("--fps", picturesPerSecond, "pictures a second of scene time")->preset()->range(1e-3, 1e3);
    command.addOption("--listen", listen,
                      "WAV of what the listener hears; the .mp4 of --render: into the film; device: play it now (then "
                      "pictures are --live)");
    command.addOption("--device", device, "of --listen device; else the default one");
    command.addFlag("--live", live,
                    which == Options::ofMirror
                        ? "make pictures and sound of the newest state, states merged, instead of every one"
                        : "run in real time; pictures and sound of the newest state, states merged");
    command.addFlag("--denoise", denoise,
                    "of --live pictures by --integrator path: filters what few samples leave of noise; a preview");
    if (which == Options::ofMirror) command.addOption("--record", record, "log of every state");
    command.addOption("--save", save, "the last state as a scene file");
    addForce(command, force);
    resources.addTo(command);
    picture.addTo(command);
    sound.addTo(command);
}

std::vector<std::string> SoundArguments::files() const {
    std::vector<std::string> names = given.files();
    if (!sofa.empty()) names.push_back(sofa);
    return names;
}

bool OutputArguments::soundInFilm() const {
    return MovieWriter::isName(listen) && !render.empty() && sameFile(listen, render);
}

bool OutputArguments::animated() const {
    return PictureFiles(render, picturesPerSecond).takesSeveral();
}

Result<> OutputArguments::check(const std::vector<std::string>& inputs, std::vector<OutputName> more) const {
    PictureArguments::checkSize(render, picture.parse());
    sound.parse();
    if (picture.tessellationError().pixels > 0 && !listen.empty())
        throw UsageError("--tessellation",
                         "with sound it is in metres: what a picture shows is not to change what is heard");
    sound.given.check(inputs);
    if (denoise && (!isLive() || render.empty() || picture.integrator != "path" || picture.error > 0))
        throw UsageError("--denoise", "is of --live pictures by --integrator path, without --error");
    if (denoise && picture.shutter > 0)
        throw UsageError("--denoise", "goes by sharp layers, and --shutter blurs: there is one of the two");
    if (picture.shutter > 0 && !animated())
        throw UsageError("--shutter",
                         "needs pictures in a row, into %04d, a .mp4 or .gif: it is open between two of them");
    if (onDevice() && sound.ambisonic > 0) throw UsageError("--ambisonic", "is of files: a device plays two channels");
    if (MovieWriter::isName(listen) && !soundInFilm())
        throw UsageError("--listen", listen + ": sound goes into the film of --render, or into a .wav of its own");
    if (soundInFilm() && sound.ambisonic > 0)
        throw UsageError("--ambisonic", "is of .wav files: a film has two channels");
    if (!device.empty() && !onDevice()) throw UsageError("--device", "is of --listen device");
    std::ranges::move(names(), std::back_inserter(more));
    std::vector<std::string> all = inputs;
    std::ranges::move(sound.files(), std::back_inserter(all));
    return checkFiles(all, more, force);
}

std::vector<OutputName> OutputArguments::names() const {
    return {{"--render", render, OutputKind::picture},
            {"--listen", onDevice() || soundInFilm() ? std::string() : listen, OutputKind::sound},
            {"--record", record, OutputKind::log},
            {"--save", save, OutputKind::scene}};
}

Result<> OutputArguments::leftUnwritten() const {
    const PictureFiles pictures(render, picturesPerSecond);
    std::string files;
    for (const OutputName& output : names()) {
        const bool numbered = output.kind == OutputKind::picture && pictures.takesSeveral() && !pictures.together();
        if (output.file.empty() || output.kind == OutputKind::log || numbered) continue;
        files += (files.empty() ? "" : ", ") + output.file;
    }
    if (files.empty()) return {};
    return fail("interrupted before its end: not written", {}, files);
}

Result<> saveScene(const Scene& scene, const std::string& file, Existing existing) {
    Diagnostics diagnostics(file);
    auto writer = DocumentFileWriter::create(file, diagnostics, existing);
    if (!writer) return std::unexpected(writer.error());
    Encoding encoding = Encoding::classicVrml;
    bool gzip = false;
    encodingFromName(file, encoding, gzip);
    SceneExporter(scene, diagnostics).write((*writer)->handler(), encoding);
    print(diagnostics);
    if (auto ok = (*writer)->close(); !ok) return ok;
    if (diagnostics.errors() > 0) return fail("not all of the scene could be written", {}, file);
    return {};
}

SharedWorld::Options worldOptions(const Resources& resources) {
    SharedWorld::Options options;
    options.flattening.maxOccurrences = resources.policy().maximumInstances;
    return options;
}

Result<> WorldOnDemand::cut(const TessellationError& error) {
    if (world_ && error.any()) return fail("--tessellation: something else needed the scene's geometry first");
    options_.flattening.error = error;
    return {};
}

std::optional<Flattener::Cuts> WorldOnDemand::cuts() const {
    if (!world_ || !options_.flattening.error.any()) return std::nullopt;
    return world_->flattener().cuts();
}

std::string tessellationJson(const Flattener::Cuts& cuts) {
    return fmt::format(R"(,"tessellation":{{"geometries":{},"triangles":{},"levels":[{}],"too_coarse":{},"made":{}}})",
                       cuts.geometries, cuts.triangles, fmt::join(cuts.ofLevel, ","), cuts.tooCoarse, cuts.made);
}

SharedWorld& WorldOnDemand::get() {
    if (!world_) world_ = std::make_unique<SharedWorld>(scene_, options_);
    return *world_;
}

namespace {

template <class T>
std::string jsonArray(const std::vector<T>& values) {
    return fmt::format("[{}]", fmt::join(values, ","));
}

std::string deviceJson(const LiveReport& report) {
    return fmt::format(
        R"({{"name":{},"seconds":{:.3f},"blocks":{},"underruns":{},"latency_ms":{:.1f},"busy":{:.3f},"responses":{},)"
        R"("clipped_samples":{}}})",
        jsonString(report.device), report.seconds, report.blocks, report.underruns, 1e3 * report.latencySeconds,
        report.busy, report.heard.responses, report.clipped);
}

}  // namespace

void OutputReport::forget(bool pictures) {
    soundSeconds = 0;
    if (!pictures) return;
    pictureStates.clear();
    pictureTimes.clear();
    soundStates.clear();
}

std::string OutputReport::json() const {
    std::string text = fmt::format(
        R"(,"pictures":{},"kept":{:.4g},"sound_seconds":{:.3f},"picture_states":{},"picture_times":{},"sound_states":{},"behind_s":{:.3f},"overlapped":{},)"
        R"("missing":{},"flattenings":{},"worlds":{},"commits":{})",
        pictureStates.size(), meanKept(), soundSeconds, jsonArray(pictureStates), jsonArray(pictureTimes),
        jsonArray(soundStates), mostBehind, overlapped, missing.empty() ? "null" : jsonString(missing),
        world.flatteners, world.rayWorlds, world.commits);
    if (cuts) text += tessellationJson(*cuts);
    if (live)
        text += fmt::format(
            R"(,"live":{{"states":{},"states_pictured":{},"states_heard":{},"pictures_skipped":{},"device":{}}})",
            live->states, live->statesPictured, live->statesHeard, live->picturesSkipped,
            live->device ? deviceJson(*live->device) : "null");
    return text;
}

std::string keptText(double share) {
    return share > 0 ? fmt::format(", {:.0f} % of the pixels kept", 100 * share) : "";
}

std::string OutputReport::text() const {
    if (!live)
        return fmt::format("{} pictures{}, {:.3f} s of sound, at most {:.2f} s behind", pictureStates.size(),
                           keptText(meanKept()), soundSeconds, mostBehind);
    std::string text = fmt::format("{} pictures ({} skipped{}), {:.3f} s of sound, of {} of {} states",
                                   pictureStates.size(), live->picturesSkipped, keptText(meanKept()), soundSeconds,
                                   std::max(live->statesPictured, live->statesHeard), live->states);
    if (live->device)
        text += fmt::format("; {:.3f} s played on {}, {} underruns", live->device->seconds, live->device->device,
                            live->device->underruns);
    return text;
}

void tellGain(const ListenReport& report) {
    if (report.gain < 1)
        fmt::print(stderr, "note: the sound exceeded -1 dBFS: all of it is {:.1f} dB softer\n",
                   -20 * std::log10(static_cast<double>(report.gain)));
}

Result<double> writeSound(SoundRenderer& sound, const OutputArguments& arguments, PictureFiles& pictures) {
    ListenReport report = sound.finish();
    const double most = std::round(arguments.seconds * report.sound.sampleRate);
    if (most < static_cast<double>(report.sound.frames()))  // frames and blocks end a little later
        report.sound.samples.resize(static_cast<std::size_t>(most) * static_cast<std::size_t>(report.sound.channels));
    print(report.diagnostics);
    tellGain(report);
    const SoundBuffer& heard = report.sound;
    const Result<> written = arguments.soundInFilm()
                                 ? pictures.addSound(heard.samples, heard.sampleRate, heard.channels)
                                 : writeWav(arguments.listen, heard);
    if (!written) return std::unexpected(written.error());
    return heard.seconds();
}

PictureFiles pictureFiles(const OutputArguments& arguments) {
    return {arguments.render, arguments.picturesPerSecond, arguments.picture.toneMap(),
            arguments.soundInFilm() ? MovieWriter::Sound::awaited : MovieWriter::Sound::none};
}

std::string missingError(double error, double unreached) {
    if (!(unreached > 0)) return {};
    return fmt::format("the error {:g} in {:.2g} % of the pixels, which ran out of samples; --spp allows more", error,
                       100 * unreached);
}

std::string missingSound(double made, double wanted, bool first) {
    if (!(made < wanted - 1e-4)) return {};
    return fmt::format("{}{:.4g} of {:.4g} s of sound", first ? "" : ", ", wanted - made, wanted);
}

Result<> allOf(std::initializer_list<std::function<Result<>()>> steps) {
    Result<> first;
    for (const auto& step : steps) {
        const Result<> done = step();
        if (done) continue;
        if (first)
            first = done;
        else
            printError(done.error());
    }
    return first;
}

Result<std::unique_ptr<Outputs>> Outputs::attach(WorldOnDemand& world, const OutputArguments& arguments,
                                                 const Resources& resources) {
    keepResources(world.scene(), resources, arguments.names());
    if (auto ok = world.cut(arguments.picture.tessellationError()); !ok) return std::unexpected(ok.error());
    std::unique_ptr<Outputs> outputs(new Outputs(world, arguments));
    outputs->elapsed_ = ElapsedTime(world.scene().now());
    outputs->resources_ = resources;
    // A picture of the end needs nothing of what was before: its geometry is made then.
    if (arguments.animated())
        if (auto ok = outputs->attachLight(); !ok) return std::unexpected(ok.error());
    if (!arguments.listen.empty()) {
        ListenOptions options = arguments.sound.parse();
        options.render.resources = resources;
        options.render.given =
            arguments.sound.given.open(world.scene(), false, arguments.seconds, options.render.sampleRate);
        outputs->sound_ = std::make_unique<SoundRenderer>(world.get(), options);
        if (!outputs->sound_->attached()) return fail(outputs->sound_->failure());
    }
    return outputs;
}

Result<> Outputs::attachLight() {
    ImageOptions image = arguments_.picture.parse();
    image.settings.progress = [this](double) { return !abandoned_ && (afterInterruption_ || !interrupted()); };
    light_ = std::make_unique<LightRenderer>(world_.get(), LightRenderer::Options(resources_, image));
    if (!light_->attached()) return fail(light_->failure());
    return {};
}

Outputs::~Outputs() {
    abandoned_ = true;
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    changed_.notify_all();
    if (worker_.joinable()) worker_.join();
}

bool Outputs::pictureIsDue(double t) const {
    constexpr double kRounding = 1e-6;  // times since 1970 are exact to a quarter of that
    return light_ && arguments_.animated() && nextPicture() <= t + kRounding &&
           nextPicture() < arguments_.seconds - kRounding && !interrupted();
}

Result<> Outputs::make(const Job& job) {
    if (sound_)
        if (auto ok = sound_->renderFrame(*job.state); !ok) return ok;
    while (job.picture && (!arguments_.animated() || pictureIsDue(job.until))) {
        if (auto ok = light_->renderFrame(*job.state); !ok) return ok;
        if (light_->stats().cancelled) return arguments_.animated() ? Result<>() : notWritten(arguments_.render);
        report_.pictureTimes.push_back(arguments_.animated() ? nextPicture() : job.until);
        report_.pictureStates.push_back(light_->presented());
        report_.kept += light_->stats().kept;
        report_.unreached = std::max(report_.unreached, light_->stats().unreached);
        report_.soundStates.push_back(sound_ ? sound_->presented() : 0);
        if (auto ok = files_.add(std::exchange(light_->frame(), Picture())); !ok) return ok;
        if (!arguments_.animated()) return {};
    }
    return {};
}

void Outputs::work() {
    std::unique_lock lock(mutex_);
    for (;;) {
        changed_.wait(lock, [this] { return stop_ || job_; });
        if (stop_) return;
        lock.unlock();
        Result<> made;
        try {
            made = make(*job_);
        } catch (const std::exception& e) {
            made = fail(fmt::format("pictures and sound ended: {}", e.what()));
        }
        if (result_) result_ = made;
        if (!result_) failed_ = true;
        lock.lock();
        job_.reset();
        changed_.notify_all();
    }
}

/// Until nothing is in the making: what the worker has is ours then. The first failure.
Result<> Outputs::ready() {
    std::unique_lock lock(mutex_);
    if (job_) ++report_.overlapped;
    changed_.wait(lock, [this] { return !job_; });
    return result_;
}

Result<> Outputs::next(bool picture, double until) {
    auto state = picture ? light_->prepare() : world_.get().present();
    if (!state) {
        result_ = std::unexpected(state.error());
        failed_ = true;
        return result_;
    }
    if (!worker_.joinable()) worker_ = std::thread([this] { work(); });
    const std::lock_guard lock(mutex_);
    job_ = Job{std::move(*state), picture, until};
    changed_.notify_all();
    return {};
}

Result<> Outputs::frame() {
    if (!light_ && !sound_) return {};
    if (auto ok = ready(); !ok) return ok;
    const double t = elapsed();
    const bool picture = pictureIsDue(t);
    if (!picture && !sound_) return {};
    return next(picture, t);
}

Result<> Outputs::finish() {
    Result<> made = ready();  // what was interrupted is not waited for
    if (arguments_.isCutShort()) return allOf({[&] { return made; }, [&] { return leaveUnwritten(); }});
    afterInterruption_ = interrupted();  // what ended the run does not end what is made of its end
    return allOf({[&] { return made; }, [&] { return lastPicture(); },
                  [&]() -> Result<> {
                      if (!sound_) return {};
                      const Result<double> seconds = writeSound(*sound_, arguments_, files_);
                      report_.soundSeconds = seconds.value_or(0);
                      return seconds ? Result<>() : std::unexpected(seconds.error());
                  },
                  [&]() -> Result<> {
                      if (!light_) return {};
                      const Result<> written = files_.finish();
                      print(light_->diagnostics());
                      return written;
                  },
                  [&]() -> Result<> {
                      if (world_.built()) print(world_.built()->diagnostics());
                      if (arguments_.save.empty()) return {};
                      return saveScene(scene_, arguments_.save, existing(arguments_.force));
                  }});
}

Result<> Outputs::leaveUnwritten() {
    report_.forget(files_.together());
    if (light_) print(light_->diagnostics());
    if (world_.built()) print(world_.built()->diagnostics());
    return arguments_.leftUnwritten();
}

Result<> Outputs::lastPicture() {
    if (arguments_.render.empty() || arguments_.animated() || !result_) return {};
    if (!light_)
        if (auto ok = attachLight(); !ok) return ok;
    if (auto ok = next(true, elapsed()); !ok) return ok;
    return ready();
}

OutputReport Outputs::report() const {
    OutputReport report = report_;
    if (world_.built()) report.world = world_.built()->counts();
    report.cuts = world_.cuts();
    report.missing = missingError(arguments_.picture.error, report.unreached);
    if (!std::isfinite(arguments_.seconds)) return report;
    const double pictures = std::ceil(arguments_.seconds * arguments_.picturesPerSecond - 1e-6);
    const auto made = static_cast<double>(report.pictureStates.size());
    if (light_ && arguments_.animated() && made < pictures)
        report.missing +=
            fmt::format("{}{} of {} pictures", report.missing.empty() ? "" : ", ", pictures - made, pictures);
    if (sound_) report.missing += missingSound(report.soundSeconds, arguments_.seconds, report.missing.empty());
    return report;
}

}  // namespace rtsg::app
