// What a scene needs before it runs: its file, and the files that its urls name.
//
// Threading: the scene's thread.
#pragma once

#include <memory>
#include <string>

#include <rtsg/core/bus.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/fetch/fetched_files.h>
#include <rtsg/session/notices.h>

namespace rtsg {

/// Loads a scene of any kind ("-" is standard input), with scripts and plug-ins, and reports its diagnostics. Returns
/// false if nothing in it was usable. A scene with errors is used as far as it can be read. `clip`: as in ReadOptions.
bool loadScene(Scene& scene, const std::string& file, Diagnostics& diagnostics, const Resources& resources,
               const SessionContext& context = {}, const std::string& clip = {});

/// Sets the time of an empty scene, for nodes that are loaded later.
void setClock(Scene& scene, double secondsSince1970);

/// Failures of the scene's subscribers are among its diagnostics only, and not printed when they happen.
void reportFailuresAtTheEnd(Scene& scene);

/// The fetcher of the resources; null if they have none.
WebFetcher* webFetcher(const Resources& resources);

/// Lets a scene that others made know what they fetched, so that its urls need no network (fetched_files.h). Make it
/// before anybody opens files of the scene, which must outlive it.
class FollowedFetches {
  public:
    FollowedFetches() = default;
    FollowedFetches(Scene& scene, const Resources& resources);

  private:
    std::unique_ptr<FetchedFilesFollower> follower_;
    Attachment attachment_;
};

/// Attaches the plug-ins' subscribers to a scene, for as long as the result is kept, and reports those that fail.
Extensions::Attached attachSubscribers(Scene& scene, const SessionContext& context);

}  // namespace rtsg
