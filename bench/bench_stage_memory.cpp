// Bench "stage", memory: light and sound on one world beside either alone.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>

#include <fmt/format.h>
#include <unistd.h>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/light_renderer.h>

#include "bench_stage.h"
#include "scenes/scenes.h"

namespace rtsg::bench {

namespace {

/// Resident bytes that light, sound or both add to a scene that is loaded: world, tables, one picture, a second of
/// sound.
double bytesOf(const std::filesystem::path& file, bool withLight, bool withSound, bool quick) {
    Scene scene;
    Diagnostics diagnostics(file.string());
    if (!loadFile(scene, file, diagnostics)) return 0;
    scene.newFrame(0);
    const double before = residentBytes();
    SharedWorld world(scene);
    std::unique_ptr<LightRenderer> light;
    std::unique_ptr<SoundRenderer> sound;
    if (withLight) {
        LightRenderer::Options options{Resources(file.parent_path())};
        if (quick) options.image.settings.width = 64, options.image.settings.height = 36;
        light = std::make_unique<LightRenderer>(world, options);
        if (!light->renderFrame()) return 0;
    }
    if (withSound) {
        ListenOptions options;
        options.metrics = false;
        options.render.ambisonicOrder = 1;  // no sound library needed
        sound = std::make_unique<SoundRenderer>(world, options);
        scene.newFrame(1);
        if (!sound->renderFrame()) return 0;
    }
    return residentBytes() - before;
}

}  // namespace

void stageMemory(const Report& report, bool quick) {
    const auto folder = std::filesystem::temp_directory_path() / fmt::format("rtsg-bench-stage-{}", getpid());
    std::filesystem::create_directories(folder);
    const char* const name = quick ? "Kitchen" : "Campus";
    const double scale = quick ? .05 : .5;
    const auto triangles = writeBenchScene(name, scale, false, folder);
    const auto file = folder / fmt::format("{}.x3dv", name);
    if (triangles) {
        // Sounds are none of these scenes' own.
        std::ofstream(file, std::ios::app) << "\nSound { source OscillatorSource { frequency 440 } }\n";
        (void)bytesOf(file, true, true, quick);  // what the libraries take once
        const double light = bytesOf(file, true, false, quick), sound = bytesOf(file, false, true, quick),
                     both = bytesOf(file, true, true, quick);
        report({"stage", fmt::format("{}, {} triangles", name, *triangles), "memory of light and sound together", "MB",
                both / 1e6, "each with a world of its own", (light + sound) / 1e6, "the larger alone",
                std::max(light, sound) / 1e6});
    }
    std::error_code ignored;
    std::filesystem::remove_all(folder, ignored);
}

}  // namespace rtsg::bench
