// Binds listening: the sound of a scene, and the figures of its rooms with intervals.
#include <memory>
#include <string>

#include <fmt/format.h>

#include <rtsg/audio/sound_file.h>
#include <rtsg/audio/sound_renderer.h>

#include "errors.h"
#include "module.h"
#include "unlocked.h"
#include "values.h"

namespace py = pybind11;

namespace rtsg::python {

namespace {

/// The result of listen().
struct Sound {
    ListenReport report;
};

py::array samplesOf(const SoundBuffer& sound, py::handle owner) {
    const auto frames = static_cast<py::ssize_t>(sound.frames()), channels = py::ssize_t{sound.channels};
    const std::vector<py::ssize_t> shape{frames, channels};
    if (frames == 0) return py::array_t<float>(shape);
    return py::array_t<float>(shape, sound.samples.data(), owner);
}

py::array bandsOf(const Bands& bands) {
    return py::array_t<double>(static_cast<py::ssize_t>(bands.size()), bands.data());
}

py::dict figuresOf(const RoomMetrics& figures) {
    py::dict all;
    all["EDT_s"] = bandsOf(figures.edt), all["T20_s"] = bandsOf(figures.t20), all["T30_s"] = bandsOf(figures.t30);
    all["C50_db"] = bandsOf(figures.c50), all["C80_db"] = bandsOf(figures.c80), all["D50"] = bandsOf(figures.d50);
    all["Ts_s"] = bandsOf(figures.ts), all["G_db"] = bandsOf(figures.g);
    return all;
}

py::list sourcesOf(const Sound& sound) {
    py::list all;
    for (const ListenReport::Source& source : sound.report.sources) {
        py::dict one = figuresOf(source.metrics.value);
        one["source"] = source.source;
        one["position"] = py::array_t<double>(3, &source.position.x);
        one["bands_hz"] = bandsOf(kBandHz);
        one["ci95"] = figuresOf(source.metrics.ci95);
        one["schroeder_hz"] = source.schroederHz;
        all.append(one);
    }
    return all;
}

void askFor(ListenOptions& options, const std::string& channels, std::uint64_t rays, double error, double quality) {
    using Channels = ImpulseResponseOptions::Channels;
    if (channels == "binaural") {
        options.render.binaural = true;
        options.responses = Channels::binaural;
    } else if (channels.starts_with("ambisonic") && channels.size() == 10 && channels[9] >= '1' && channels[9] <= '7') {
        options.render.ambisonicOrder = channels[9] - '0';
        options.responses = Channels::ambisonic;
    } else if (channels == "stereo") {
        options.responses = Channels::stereo;
    } else if (channels != "mono") {
        throw py::value_error(
            "channels is \"stereo\", \"binaural\", \"mono\" (stereo sound, mono responses) or "
            "\"ambisonic1\" to \"ambisonic7\", not \"" +
            channels + "\"");
    }
    if (rays > 0)
        options.trace.rays = rays;
    else if (error > 0)
        options.trace.rays = ListenOptions::kFirstRays;
    options.error = error;
    if (quality > 0)
        options.render.trace = AcousticOptions::heardTrace(quality);
    else if (rays > 0)
        options.render.trace = AcousticOptions::heardTraceOf(rays);
}

std::shared_ptr<Sound> listenTo(SceneHandle& handle, double seconds, double fps, const std::string& channels,
                                bool metrics, bool responses, std::uint64_t rays, double error, double quality,
                                int sampleRate, std::uint64_t seed) {
    Scene& scene = seconds > 0 ? handle.edited() : handle.between();
    ListenOptions options;
    options.seconds = seconds, options.framesPerSecond = fps;
    options.sound = seconds > 0;
    options.metrics = metrics || responses;
    options.impulseResponses = responses;
    options.render.sampleRate = sampleRate;
    options.render.resources = handle.resources();
    options.render.document = handle.file();
    askFor(options, channels, rays, error, quality);
    options.trace.seed = options.render.trace.seed = seed;
    Interruption interruption;
    bool interrupted = false;
    options.progress = [&](double) { return !(interrupted = interrupted || interruption()); };
    // A frame as frame() runs one; at the present time nothing is run that would not come by itself.
    options.runTo = [&](double t) {
        if (t <= scene.now() && (scene.sequence() > 0 || handle.isReadOnly())) return;
        const py::gil_scoped_acquire lock;
        handle.frame(t);
    };
    auto report = handle.work([&] {
        SoundRenderer sound(handle.world(), options);
        return listen(sound, options);
    });
    handle.raisePending();
    if (interrupted) interruption.raise();
    if (!report) raise(report.error());
    handle.say(report->diagnostics);
    handle.report();
    return std::make_shared<Sound>(Sound{std::move(*report)});
}

}  // namespace

void addSound(py::module_& module) {
    py::class_<Sound, std::shared_ptr<Sound>>(module, "Sound", "What Scene.listen() heard and measured.")
        .def_property_readonly(
            "samples", [](const py::object& self) { return samplesOf(py::cast<Sound&>(self).report.sound, self); },
            "n x channels floats; full scale is 1.")
        .def_property_readonly(
            "sample_rate", [](const Sound& s) { return s.report.sound.sampleRate; }, "Of samples, hertz.")
        .def_property_readonly(
            "sources", sourcesOf,
            "A dict for each source: its name, `position` (metres), and arrays of ten octave bands "
            "(`bands_hz`): EDT_s, T20_s, T30_s, C50_db, C80_db, D50, Ts_s, G_db by ISO 3382-1; under "
            "`ci95` half their 95 % intervals; `schroeder_hz`. What cannot be had is NaN.")
        .def_property_readonly(
            "rays", [](const Sound& s) { return s.report.rays; }, "How many rays the figures are from.")
        .def_property_readonly(
            "escaped", [](const Sound& s) { return s.report.escaped; }, "The share of the energy that left the room.")
        .def_property_readonly(
            "gain", [](const Sound& s) { return s.report.gain; }, "By which the sound was scaled lest it clip; 1: not.")
        .def(
            "impulse_responses",
            [](const Sound& s, int sampleRate, double seconds) {
                if (!(seconds >= 0 && seconds <= 60)) throw py::value_error("seconds is up to 60");
                const SoundBuffer created = unlocked([&] { return s.report.impulseResponses(sampleRate, seconds); });
                return samplesOf(created, {});
            },
            py::arg("sample_rate") = 48000, py::arg("seconds") = 0.,
            "n x channels floats: pressure, 1 at 1 m; the channels of the first source, then those of the second. "
            "`seconds`: their length; 0: until they fade.")
        .def(
            "json", [](const Sound& s) { return s.report.toJson(); }, "What `rtsg listen --json` prints.")
        .def(
            "write", [](const Sound& s, const std::string& file) { take(writeWav(file, s.report.sound)); },
            py::arg("path"), "Writes the samples as WAV.");
    auto scene = py::class_<SceneHandle, std::shared_ptr<SceneHandle>>(module.attr("Scene"));
    scene.def(
        "listen", listenTo, py::arg("seconds") = 5., py::kw_only(), py::arg("fps") = 60.,
        py::arg("channels") = "stereo", py::arg("metrics") = true, py::arg("responses") = false, py::arg("rays") = 0,
        py::arg("error") = 0., py::arg("quality") = 0., py::arg("sample_rate") = 48000, py::arg("seed") = 1,
        "Runs the scene on for so many seconds and listens: a Sound. 0: figures of the present state alone. "
        "`channels`: \"stereo\", \"binaural\", \"mono\", \"ambisonic1\" to \"ambisonic7\". `metrics`: figures of the "
        "room at the start; `responses`: for impulse_responses(). `error`: rays are added until the figures' half "
        "intervals are so many just noticeable differences. `quality`: of what is heard; its error falls as 1 / "
        "quality, "
        "and without any it goes by `rays`, else it is 1. Ctrl-C ends it.");
}

}  // namespace rtsg::python
