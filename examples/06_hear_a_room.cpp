// Measures how a room sounds: traces the sound of each source to the listener on the scene's geometry and prints the
// reverberation time T30 and the clarity C80 (ISO 3382) per octave band, with their 95 % confidence intervals.
//
//     06_hear_a_room examples/room.x3dv
#include <cmath>
#include <cstdio>

#include <rtsg/audio/listen.h>
#include <rtsg/documents/loader.h>

int main(int argc, char** argv) {
    rtsg::Scene scene;
    rtsg::Diagnostics diagnostics;
    const bool loaded = argc == 2 && rtsg::loadFile(scene, argv[1], diagnostics);
    for (const rtsg::Diagnostic& d : diagnostics.all()) std::fprintf(stderr, "%s\n", d.format().c_str());
    if (!loaded) return 1;

    rtsg::ListenOptions options;
    options.sound = false;  // no WAV, only figures
    options.metrics = true;
    options.trace.rays = 4000;
    options.trace.air.absorbs = true;
    const rtsg::Result<rtsg::ListenReport> report = rtsg::listen(scene, options);
    if (!report) return std::fprintf(stderr, "%s\n", report.error().format().c_str()), 1;

    bool plausible = !report->sources.empty();
    for (const auto& source : report->sources) {
        const auto& metrics = source.metrics;
        std::printf("%s at %.1f %.1f %.1f m\n    Hz     T30 / s        C80 / dB\n", source.source.c_str(),
                    source.position.x, source.position.y, source.position.z);
        for (std::size_t band = 0; band < rtsg::kBandHz.size(); ++band) {
            std::printf("%6g  %5.2f +- %4.2f  %5.1f +- %3.1f\n", rtsg::kBandHz[band], metrics.value.t30[band],
                        metrics.ci95.t30[band], metrics.value.c80[band], metrics.ci95.c80[band]);
            plausible = plausible && metrics.value.t30[band] > 0.1 && metrics.value.t30[band] < 10;
        }
    }
    return plausible ? 0 : 1;
}
