// Reports of outputs, as JSON and as a line of text.
#include <rtsg/session/output_report.h>

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <rtsg/core/field_text.h>

namespace rtsg {

namespace {

template <class T>
std::string jsonArray(const std::vector<T>& values) {
    return fmt::format("[{}]", fmt::join(values, ","));
}

std::string deviceJson(const LiveReport& report) {
    return fmt::format(R"({{"name":{},{}}})", jsonString(report.device), liveFigures(report));
}

}  // namespace

std::string liveFigures(const LiveReport& report) {
    return fmt::format(
        R"("seconds":{:.3f},"blocks":{},"underruns":{},"latency_ms":{:.1f},"busy":{:.3f},"responses":{},)"
        R"("without_reflections":{},"reflections_after_s":{:.3f},"clipped_samples":{})",
        report.seconds, report.blocks, report.underruns, 1e3 * report.latencySeconds, report.busy,
        report.heard.responses, report.heard.unreflected, report.heard.longestWait, report.clipped);
}

void OutputReport::addMissing(std::string_view what) {
    missing += fmt::format("{}{}", missing.empty() ? "" : ", ", what);
}

void OutputReport::addMissingSound(double created, double wanted) {
    if (created < wanted - 1e-4) addMissing(fmt::format("{:.4g} of {:.4g} s of sound", wanted - created, wanted));
}

void OutputReport::forget(bool pictures) {
    soundSeconds = 0;
    if (!pictures) return;
    pictureStates.clear();
    pictureTimes.clear();
    pictureSamples.clear();
    soundStates.clear();
}

std::string OutputReport::json() const {
    std::string text = fmt::format(
        R"(,"pictures":{},"kept":{:.4g},"sound_seconds":{:.3f},"picture_states":{},"picture_times":{},"picture_samples":{},"sound_states":{},"behind_s":{:.3f},"overlapped":{},)"
        R"("missing":{},"flattenings":{},"worlds":{},"commits":{})",
        pictureStates.size(), meanKept(), soundSeconds, jsonArray(pictureStates), jsonArray(pictureTimes),
        jsonArray(pictureSamples), jsonArray(soundStates), maxBehind, overlapped,
        missing.empty() ? "null" : jsonString(missing), world.flatteners, world.rayWorlds, world.commits);
    if (cuts) text += tessellationJson(*cuts);
    if (live)
        text += fmt::format(
            R"(,"live":{{"states":{},"states_pictured":{},"states_heard":{},"pictures_skipped":{},"device":{}}})",
            live->states, live->statesPictured, live->statesHeard, live->picturesSkipped,
            live->device ? deviceJson(*live->device) : "null");
    return text;
}

std::string keptText(double fraction) {
    return fraction > 0 ? fmt::format(", {:.0f} % of the pixels kept", 100 * fraction) : "";
}

std::string OutputReport::text() const {
    if (!live)
        return fmt::format("{} pictures{}, {:.3f} s of sound, at most {:.2f} s behind", pictureStates.size(),
                           keptText(meanKept()), soundSeconds, maxBehind);
    const std::string samples =
        pictureSamples.empty() ? "" : fmt::format(", the last of {:.6g} samples a pixel", pictureSamples.back());
    std::string text = fmt::format("{} pictures ({} skipped{}{}), {:.3f} s of sound, of {} of {} states",
                                   pictureStates.size(), live->picturesSkipped, keptText(meanKept()), samples,
                                   soundSeconds, std::max(live->statesPictured, live->statesHeard), live->states);
    if (live->device)
        text +=
            fmt::format("; {:.3f} s played on {}, {} underruns, {} sources without reflections", live->device->seconds,
                        live->device->device, live->device->underruns, live->device->heard.unreflected);
    return text;
}

std::string tessellationJson(const Flattener::Cuts& cuts) {
    return fmt::format(R"(,"tessellation":{{"geometries":{},"triangles":{},"levels":[{}],"too_coarse":{},"made":{}}})",
                       cuts.geometries, cuts.triangles, fmt::join(cuts.ofLevel, ","), cuts.tooCoarse, cuts.created);
}

std::string missingError(double asked, double reached, double unreached) {
    if (!(unreached > 0)) return {};
    return fmt::format("the error {:g}: it is {:.2g}, above that in {:.3g} % of the pixels; --spp allows more samples",
                       asked, reached, 100 * unreached);
}

std::vector<Diagnostic> hiddenLightWarnings(const std::string& scene, double hidden, double lost) {
    constexpr double kWorthAWarning = .01;
    std::vector<Diagnostic> warnings;
    const auto warn = [&](double fraction, std::string_view from, std::string_view beyond) {
        if (fraction < kWorthAWarning) return;
        std::string text = fmt::format("{:.0f} % of the light of {} meets clear or mirroring surfaces first: {}",
                                       100 * fraction, from, beyond);
        warnings.push_back({Severity::warning, scene, {}, std::move(text), DiagnosticCode{"picture"}});
    };
    warn(hidden, "shining surfaces", "beyond them paths find it by chance alone, which takes many samples");
    warn(lost, "PointLights and SpotLights", "how they gather or throw it on (caustics) is left out");
    return warnings;
}

}  // namespace rtsg
