// Reads a scene's file into an empty scene, and follows what its makers fetched.
#include <rtsg/session/load_scene.h>

#include <rtsg/core/web_address.h>
#include <rtsg/documents/loader.h>
#include <rtsg/scripts/run_scripts.h>
#include <rtsg/sync/scene_file.h>

namespace rtsg {

namespace {

/// A scene file has a whole state, which only an empty scene takes. If the scene's clock was set, it is set again.
Result<> readState(Scene& scene, const std::string& file) {
    const double clock = scene.now();
    if (scene.sequence() > 0)
        if (auto ok = scene.reset(); !ok) return ok;
    if (auto ok = readSceneFile(scene, file); !ok) return ok;
    if (clock > scene.now()) scene.newFrame(clock);
    return {};
}

}  // namespace

bool loadScene(Scene& scene, const std::string& file, Diagnostics& diagnostics, const Resources& resources,
               const SessionContext& context, const std::string& clip) {
    runScripts(scene);
    context.extensions().registerWith(scene);
    if (file != "-" && !isWebAddress(file) && isSceneFile(file)) {
        if (!clip.empty()) diagnostics.error({}, "it has no clip " + clip + ": only glTF files have clips");
        if (const auto read = readState(scene, file); !read) diagnostics.add(read.error());
        context.report(diagnostics);
        return diagnostics.errors() == 0;
    }
    LoadOptions options;
    options.resources = resources;
    options.progress = context.progress("reading " + file);
    options.clip = clip;
    const bool ok = loadFile(scene, file, diagnostics, options);
    if (options.progress) options.progress(1, 1);
    context.report(diagnostics);
    if (!ok && diagnostics.errors() == 0) context.report({Severity::error, {}, {}, "nothing usable in " + file});
    context.damaged(file, diagnostics.errors());
    return ok;
}

void setClock(Scene& scene, double secondsSince1970) {
    if (secondsSince1970 > 0) scene.newFrame(secondsSince1970);
}

void reportFailuresAtTheEnd(Scene& scene) {
    scene.bus().setReporter({});
}

WebFetcher* webFetcher(const Resources& resources) {
    return dynamic_cast<WebFetcher*>(resources.policy().fetcher.get());
}

FollowedFetches::FollowedFetches(Scene& scene, const Resources& resources) {
    WebFetcher* fetcher = webFetcher(resources);
    if (!fetcher) return;
    follower_ = std::make_unique<FetchedFilesFollower>(*fetcher);
    attachment_ = scene.bus().attach(*follower_);
}

Extensions::Attached attachSubscribers(Scene& scene, const SessionContext& context) {
    Extensions::Attached attached;
    if (const Result<> done = context.extensions().attachSubscribers(scene, attached); !done) {
        context.report(done.error());
        context.leftOut();
    }
    return attached;
}

}  // namespace rtsg
