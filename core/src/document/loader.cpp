#include <rtsg/core/loader.h>

#include <rtsg/core/scene_builder.h>

namespace rtsg {

namespace {

BuildOptions buildOptions(const LoadOptions& options) {
    BuildOptions result;
    result.loadInlines = options.loadInlines;
    result.maximumDepth = options.maximumDepth;
    return result;
}

}  // namespace

bool loadFile(Scene& scene, const std::filesystem::path& file, Diagnostics& diagnostics, const LoadOptions& options) {
    if (diagnostics.file().empty()) diagnostics.setFile(file == "-" ? "<stdin>" : file.string());
    BuildOptions build = buildOptions(options);
    if (file != "-") {
        build.file = file;
        scene.setScriptBase(file.parent_path());
    }
    SceneBuilder builder(scene, diagnostics, build);
    const bool complete = readDocumentFile(file, builder, diagnostics, options.progress);
    builder.finish();
    return complete || !builder.roots().empty();
}

bool loadText(Scene& scene, std::string_view text, Diagnostics& diagnostics, const std::filesystem::path& base,
              const LoadOptions& options) {
    BuildOptions build = buildOptions(options);
    build.base = base;
    SceneBuilder builder(scene, diagnostics, build);
    const bool complete = readDocument(text, builder, diagnostics, options.progress);
    builder.finish();
    return complete || !builder.roots().empty();
}

}  // namespace rtsg
