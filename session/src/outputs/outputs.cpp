// Makes pictures, sound, a log or a document of a scene that something else runs.
#include "outputs/outputs.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>

#include <fmt/format.h>

#include <rtsg/audio/sound_file.h>
#include <rtsg/documents/scene_exporter.h>
#include <rtsg/documents/writer.h>
#include <rtsg/renderers/image.h>
#include <rtsg/sync/scene_file.h>

namespace rtsg {

Result<> saveScene(const Scene& scene, const std::string& file, Existing existing, const SessionContext& context) {
    if (std::filesystem::path(file).extension() == ".rtsgb") return writeSceneFile(scene, file, existing);
    Diagnostics diagnostics(file);
    Encoding encoding = Encoding::classicVrml;
    auto writer = DocumentFileWriter::create(file, diagnostics, existing, encoding, dialectOf(scene));
    if (!writer) return std::unexpected(writer.error());
    bool gzip = false;
    encodingFromName(file, encoding, gzip);
    SceneExporter(scene, diagnostics).write((*writer)->handler(), encoding);
    context.report(diagnostics);
    if (auto ok = (*writer)->close(); !ok) return ok;
    if (diagnostics.errors() > 0) return fail("not all of the scene could be written", {}, file);
    return {};
}

void reportGain(const ListenReport& report, const SessionContext& context) {
    if (report.gain < 1)
        context.note(fmt::format("note: the sound exceeded -1 dBFS: all of it is {:.1f} dB softer",
                                 -20 * std::log10(static_cast<double>(report.gain))));
}

namespace {

/// Writes the stretch as it is heard, since only all stretches together tell how loud the sound is.
Result<double> writeStretch(ListenReport report, const OutputOptions& arguments, const std::string& comment) {
    const auto stretch = arguments.stretch();
    SoundBuffer& sound = report.sound;
    const auto frames = std::min(static_cast<std::int64_t>(sound.frames()), stretch.end - stretch.begin);
    sound.samples.resize(static_cast<std::size_t>(frames * sound.channels));
    arguments.context.report(report.diagnostics);
    if (frames == 0) return 0;
    if (auto ok = writeWavWithComment(arguments.listen, sound, WavFormat::float32, comment); !ok)
        return std::unexpected(ok.error());
    return static_cast<double>(stretch.begin + frames) / sound.sampleRate;
}

Result<double> writeSound(SoundRenderer& sound, const OutputOptions& arguments, PictureFiles& pictures,
                          const std::string& comment) {
    ListenReport report = sound.finish();
    if (arguments.only) return writeStretch(std::move(report), arguments, comment);
    const double maximum = std::round(arguments.seconds * report.sound.sampleRate);
    if (maximum < static_cast<double>(report.sound.frames()))  // frames and blocks end a little later
        report.sound.samples.resize(static_cast<std::size_t>(maximum) *
                                    static_cast<std::size_t>(report.sound.channels));
    arguments.context.report(report.diagnostics);
    reportGain(report, arguments.context);
    const SoundBuffer& heard = report.sound;
    const Result<> written = arguments.soundInFilm()
                                 ? pictures.addSound(heard.samples, heard.sampleRate, heard.channels)
                                 : writeWav(arguments.listen, heard);
    if (!written) return std::unexpected(written.error());
    return heard.seconds();
}

PictureFiles pictureFiles(const OutputOptions& arguments) {
    return {arguments.render, arguments.picturesPerSecond, arguments.toneMap,
            arguments.soundInFilm() ? MovieWriter::Sound::awaited : MovieWriter::Sound::none};
}

}  // namespace

Result<> allOf(const SessionContext& context, std::initializer_list<std::function<Result<>()>> steps) {
    Result<> first;
    for (const auto& step : steps) {
        const Result<> done = step();
        if (done) continue;
        if (first)
            first = done;
        else
            context.report(done.error());
    }
    return first;
}

bool leadsIn(const OutputOptions& arguments) {
    return arguments.only && arguments.only->first > 0 && arguments.image.settings.shutter > 0;
}

WorldOutputs::WorldOutputs(WorldOnDemand& world, const OutputOptions& arguments)
    : source_(world), scene_(world.scene()), arguments_(arguments), files_(pictureFiles(arguments_)) {}

Result<> WorldOutputs::check(WorldOnDemand& world, const OutputOptions& arguments, const Resources& resources) {
    if (auto ok = checkUnused(world.scene(), resources, arguments.names()); !ok) return ok;
    return world.cut(arguments.tessellation);
}

Result<bool> WorldOutputs::attachLight(const Resources& resources, ImageOptions image) {
    image.settings.progress = [this](double) {
        return !abandoned_ && (afterInterruption_ || !arguments_.context.interrupted());
    };
    light_ = std::make_unique<LightRenderer>(source_.get(), LightRenderer::Options(resources, image));
    const bool here = arguments_.context.extensions().registerWith(*light_);
    if (!light_->attached()) return fail(light_->failure());
    return here;
}

Result<bool> WorldOutputs::attachSound(const ListenOptions& options) {
    sound_ = std::make_unique<SoundRenderer>(source_.get(), options);
    const bool here = arguments_.context.extensions().registerWith(*sound_);
    if (!sound_->attached()) return fail(sound_->failure());
    return here;
}

Result<ListenOptions> WorldOutputs::hearing(const Resources& resources, bool live) const {
    ListenOptions options = arguments_.hearing;
    options.render.resources = resources;
    auto given = openGivenSounds(arguments_.given, scene_, live, arguments_.seconds, options.render.sampleRate,
                                 arguments_.context);
    if (!given) return std::unexpected(given.error());
    options.render.given = std::move(*given);
    return options;
}

Result<> WorldOutputs::finishSound(const std::string& comment) {
    if (!sound_) return {};
    const Result<double> seconds = writeSound(*sound_, arguments_, files_, comment);
    report_.soundSeconds = seconds.value_or(0);
    return seconds ? Result<>() : std::unexpected(seconds.error());
}

Result<> WorldOutputs::finishPictures(std::uint64_t held) {
    if (!light_) return {};
    const Result<> written = files_.finish(held);
    arguments_.context.report(light_->diagnostics());
    return written;
}

Result<> WorldOutputs::finishScene() {
    if (source_.built()) arguments_.context.report(source_.built()->diagnostics());
    if (arguments_.save.empty()) return {};
    return saveScene(scene_, arguments_.save, arguments_.existing, arguments_.context);
}

Result<> WorldOutputs::leaveUnwritten() {
    report_.forget(files_.together());
    if (light_) arguments_.context.report(light_->diagnostics());
    if (source_.built()) arguments_.context.report(source_.built()->diagnostics());
    return arguments_.leftUnwritten();
}

Result<std::unique_ptr<Outputs>> Outputs::attach(WorldOnDemand& world, const OutputOptions& arguments,
                                                 const Resources& resources) {
    if (auto ok = check(world, arguments, resources); !ok) return std::unexpected(ok.error());
    std::unique_ptr<Outputs> outputs(new Outputs(world, arguments));
    if (arguments.session.empty()) outputs->arguments_.session = world.scene().hash().hex();
    outputs->elapsed_ = ElapsedTime(arguments.only ? arguments.start : world.scene().now());
    if (arguments.only) outputs->number_ = arguments.only->first - (leadsIn(arguments) ? 1 : 0);
    outputs->resources_ = resources;
    // A single picture at the end needs no earlier geometry, so that is only made then.
    if (arguments.animated()) {
        if (auto ok = outputs->attachLight(resources, arguments.image); !ok) return std::unexpected(ok.error());
        world.get().onRestart([o = outputs.get()] { o->keepWhatIs(); });
    }
    if (arguments.listen.empty()) return outputs;
    auto options = outputs->hearing(resources, false);
    if (!options) return std::unexpected(options.error());
    if (arguments.only) {
        const auto stretch = arguments.stretch();
        const auto at = [&](std::int64_t sample) {
            return arguments.start + static_cast<double>(sample) / options->render.sampleRate;
        };
        options->from = at(stretch.begin), options->render.reflectedFrom = at(stretch.reflected);
        options->limited = false;
    }
    if (auto ok = outputs->attachSound(*options); !ok) return std::unexpected(ok.error());
    return outputs;
}

Outputs::~Outputs() {
    if (light_) source_.get().onRestart({});
    abandoned_ = true;
}

bool Outputs::pictureIsDue(double t) const {
    return light_ && arguments_.animated() && nextPicture() <= t + kRounding &&
           nextPicture() < arguments_.seconds - kRounding && !arguments_.context.interrupted();
}

Result<> Outputs::make(const Job& job) {
    if (sound_)
        if (auto ok = sound_->renderFrame(*job.state); !ok) return ok;
    while (job.picture && (!arguments_.animated() || pictureIsDue(job.until))) {
        if (auto ok = light_->renderFrame(*job.state); !ok) return ok;
        if (light_->stats().cancelled) return arguments_.animated() ? Result<>() : notWritten(arguments_.render);
        Picture picture = std::exchange(light_->frame(), Picture());
        if (isWanted()) {
            if (auto ok = write(std::move(picture), job.name); !ok) return ok;
            report_.pictureTimes.push_back(arguments_.animated() ? nextPicture() : job.until);
            report_.pictureStates.push_back(light_->presented());
            report_.kept += light_->stats().kept;
            report_.pictureSamples.push_back(light_->stats().samples);
            report_.unreached = std::max(report_.unreached, light_->stats().unreached);
            report_.error = std::max(report_.error, light_->stats().error);
            report_.soundStates.push_back(sound_ ? sound_->presented() : 0);
        }
        ++number_;
        if (!arguments_.animated()) return {};
    }
    return {};
}

Provenance Outputs::provenance(std::string options, std::string state) const {
    return Provenance::ofHere(arguments_.session,
                              fmt::format("{},fps={}", std::move(options), arguments_.picturesPerSecond),
                              std::move(state));
}

Result<> Outputs::write(Picture picture, const std::string& state) {
    const bool inRow = arguments_.animated() && !files_.together();
    if (inRow || !arguments_.image.settings.region.empty())
        std::ranges::move(
            provenance(pictureSettings(arguments_.image, arguments_.toneMap, arguments_.tessellation), state).notes(),
            std::back_inserter(picture.notes));
    if (!arguments_.only) return files_.add(std::move(picture));
    const std::filesystem::path pattern = arguments_.render;
    const auto name = numberedName(pattern.filename().string(), static_cast<int>(number_));
    return writePicture(picture, pattern.parent_path() / *name, arguments_.toneMap);
}

/// Waits until nothing is being made, so that the worker's data may be used. Returns the first failure.
Result<> Outputs::ready() {
    const bool overlaps = !worker_.idle();
    worker_.finish();
    report_.overlapped += overlaps;
    if (result_) result_ = worker_.failure("pictures and sound ended");
    if (!result_) failed_ = true;
    return result_;
}

Result<> Outputs::next(bool picture, double until) {
    auto state = picture ? light_->prepare() : source_.get().present();
    if (!state) {
        result_ = std::unexpected(state.error());
        failed_ = true;
        return result_;
    }
    begin(Job{std::move(*state), nameOfState(), picture, until});
    return {};
}

void Outputs::begin(Job job) {
    worker_.start([this, job = std::move(job)] {
        const Result<> created = make(job);
        if (result_) result_ = created;
        if (!result_) failed_ = true;
    });
}

/// A scene that starts over may do so much later, as its server was out of reach. Pictures of the time between show the
/// last known state.
void Outputs::keepWhatIs() {
    if (!light_ || !ready()) return;
    if (auto state = light_->prepare()) before_ = std::move(*state), nameBefore_ = nameOfState();
}

/// Makes the pictures of the time up to `t` in which nothing came.
Result<> Outputs::pictureWhatWasBefore(double t) {
    const auto state = std::exchange(before_, nullptr);
    const double until = t - 2 * kRounding;  // a picture due at `t` itself shows the new state
    if (!state || !pictureIsDue(until)) return {};
    begin(Job{state, nameBefore_, true, until});
    return ready();
}

Result<> Outputs::frame() {
    if (!light_ && !sound_) return {};
    if (auto ok = ready(); !ok) return ok;
    const double t = elapsed();
    if (auto ok = pictureWhatWasBefore(t); !ok) return ok;
    const bool picture = pictureIsDue(t);
    if (!picture && !sound_) return {};
    return next(picture, t);
}

Result<> Outputs::finish() {
    Result<> created = ready();  // does not wait for an interrupted picture
    if (arguments_.isCutShort())
        return allOf(arguments_.context, {[&] { return created; }, [&] { return leaveUnwritten(); }});
    finishDespiteInterruption();
    return allOf(arguments_.context, {[&] { return created; }, [&] { return lastPicture(); },
                                      [&] {
                                          const std::string how =
                                              fmt::format("{},run-up={}", arguments_.soundSettings, arguments_.runUp);
                                          return finishSound(provenance(how, nameOfState()).comment());
                                      },
                                      [&] { return finishPictures(); }, [&] { return finishScene(); }});
}

Result<> Outputs::lastPicture() {
    if (arguments_.render.empty() || arguments_.animated() || !result_) return {};
    if (!light_)
        if (auto ok = attachLight(resources_, arguments_.image); !ok) return std::unexpected(ok.error());
    if (auto ok = next(true, elapsed()); !ok) return ok;
    return ready();
}

/// ": 236-240", if files have the numbers of --frames: those from `next` on.
std::string Outputs::numbersFrom(double next) const {
    if (!arguments_.only) return {};
    const auto last = static_cast<double>(arguments_.only->last);
    return next < last ? fmt::format(": {}-{}", next, last) : fmt::format(": {}", last);
}

OutputReport Outputs::report() const {
    OutputReport report = report_;
    if (source_.built()) report.world = source_.built()->counts();
    report.cuts = source_.cuts();
    report.missing = missingError(static_cast<double>(arguments_.image.settings.error), report.error, report.unreached);
    if (!std::isfinite(arguments_.seconds)) return report;
    const double before = arguments_.only ? static_cast<double>(arguments_.only->first) : 0;
    const double pictures = std::ceil(arguments_.seconds * arguments_.picturesPerSecond - 1e-6) - before;
    const auto created = static_cast<double>(report.pictureStates.size());
    if (light_ && arguments_.animated() && created < pictures)
        report.addMissing(
            fmt::format("{} of {} pictures{}", pictures - created, pictures, numbersFrom(before + created)));
    // The sound of the last picture's time ends with the log.
    const double sound = arguments_.only ? static_cast<double>(arguments_.only->last) / arguments_.picturesPerSecond
                                         : arguments_.seconds;
    if (sound_) report.addMissingSound(report.soundSeconds, sound);
    return report;
}

}  // namespace rtsg
