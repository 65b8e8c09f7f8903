// Loads a whole document into a scene: finds the encoding, unpacks, reads, builds, then follows its Inlines.
#include <rtsg/documents/loader.h>

#include <memory>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/scene_builder.h>

#include "at_address.h"
#include "builder_state.h"
#include "commands/document_head.h"

namespace rtsg {

namespace {

/// Scripts of a document may open the same files as its urls.
BuildOptions buildOptions(Scene& scene, const LoadOptions& options, const Resources& otherwise) {
    BuildOptions result;
    result.loadInlines = options.loadInlines;
    result.resources = options.resources ? *options.resources : otherwise;
    scene.setScriptResources(std::make_shared<const Resources>(*result.resources));
    return result;
}

}  // namespace

bool loadFile(Scene& scene, const std::filesystem::path& file, Diagnostics& diagnostics, const LoadOptions& options) {
    if (diagnostics.file().empty()) diagnostics.setFile(file == "-" ? "<stdin>" : file.string());
    BuildOptions build = buildOptions(scene, options, Resources::ofFile(file));
    if (file != "-") build.file = file;
    if (const std::string address = startAtAnswer(build); !address.empty()) {
        setHidden(scene, scene.root(), x3d::RtsgScene::loadedUrl.index, Value(String(address)));
        scene.setScriptResources(std::make_shared<const Resources>(*build.resources));
    }
    SceneBuilder builder(scene, diagnostics, build);
    const FieldTypesInScope known(fieldTypesOf(scene));
    const bool complete = readDocumentFile(file, builder, diagnostics,
                                           {.progress = options.progress,
                                            .threads = options.threads,
                                            .clip = options.clip,
                                            .dialect = dialectOf(scene),
                                            .resources = &*build.resources});
    builder.finish();
    return complete || !builder.roots().empty();
}

bool loadText(Scene& scene, std::string_view text, Diagnostics& diagnostics, const std::filesystem::path& base,
              const LoadOptions& options) {
    SceneBuilder builder(scene, diagnostics, buildOptions(scene, options, Resources(base)));
    const FieldTypesInScope known(fieldTypesOf(scene));
    const bool complete = readDocument(
        text, builder, diagnostics,
        {.progress = options.progress, .threads = options.threads, .clip = options.clip, .dialect = dialectOf(scene)});
    builder.finish();
    return complete || !builder.roots().empty();
}

}  // namespace rtsg
