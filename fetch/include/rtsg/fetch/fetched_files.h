// FetchedFiles: what came from the network, as nodes of the scene, so that logs, mirrors and whoever runs a log again
// know it, and need no network for what is in the nodes.
//
// A FetchedFile node hangs nowhere. It has the address that was asked for, the one that answered, the SHA-256 of the
// bytes, and the bytes themselves if they are to travel. Whoever fetches publishes; whoever follows takes. Threading:
// the scene's thread.
#pragma once

#include <set>
#include <string>

#include <rtsg/core/bus.h>
#include <rtsg/core/scene.h>
#include <rtsg/fetch/web_fetcher.h>

namespace rtsg {

class FetchedFiles {
  public:
    /// Of a larger file the hash alone is published.
    static constexpr std::size_t kMostBytes = std::size_t{256} << 20;
    /// `withBytes`: they travel, too.
    FetchedFiles(WebFetcher& fetcher, bool withBytes) : fetcher_(fetcher), withBytes_(withBytes) {}
    /// Makes a node of each file that was opened since the last call, unless the scene has one of that address. Call it
    /// between frames. Returns their number.
    std::size_t publish(Scene& scene);

  private:
    WebFetcher& fetcher_;
    const bool withBytes_;
    std::size_t published_ = 0;
};

/// Gives the fetcher what the nodes of a scene say, now and with each set; a node that says nothing sensible is
/// ignored. Attach it before those who open files. The fetcher must outlive it.
class FetchedFilesFollower final : public Subscriber {
  public:
    explicit FetchedFilesFollower(WebFetcher& fetcher) : fetcher_(fetcher) {}
    Result<> apply(const Scene& scene, const ChangeSet& set) override;
    std::string subscriberName() const override { return "fetched files"; }

  private:
    WebFetcher& fetcher_;
};

/// Does what a follower does for the scene as it is.
void keepFetchedFiles(const Scene& scene, WebFetcher& fetcher);

}  // namespace rtsg
