// FetchedFiles: files from the network, as nodes of the scene, so that logs, mirrors and reruns know them, and need no
// network for files whose bytes are in the nodes.
//
// A FetchedFile node is in no field. It has the requested address, the one that answered, the SHA-256 of the bytes, and
// optionally the bytes. The process that fetches publishes; followers take. Threading: the scene's thread.
#pragma once

#include <set>
#include <string>

#include <rtsg/core/bus.h>
#include <rtsg/core/scene.h>
#include <rtsg/fetch/web_fetcher.h>

namespace rtsg {

class FetchedFiles {
  public:
    /// For larger files only the hash is published.
    static constexpr std::size_t kMaxBytes = std::size_t{256} << 20;
    /// `withBytes`: the nodes have the bytes, too.
    FetchedFiles(WebFetcher& fetcher, bool withBytes) : fetcher_(fetcher), withBytes_(withBytes) {}
    /// Makes a node for each file that was opened since the last call, unless the scene has a node of that address.
    /// Call it between frames. Returns their number.
    std::size_t publish(Scene& scene);

  private:
    WebFetcher& fetcher_;
    const bool withBytes_;
    std::size_t published_ = 0;
};

/// Gives the fetcher the files in the nodes of a scene, now and with each set; an invalid node is ignored. Attach it
/// before subscribers that open files. The fetcher must outlive it.
class FetchedFilesFollower final : public Subscriber {
  public:
    explicit FetchedFilesFollower(WebFetcher& fetcher) : fetcher_(fetcher) {}
    Result<> apply(const Scene& scene, const ChangeSet& set) override;
    std::string subscriberName() const override { return "fetched files"; }

  private:
    WebFetcher& fetcher_;
};

/// Does the same once, for the present state of the scene.
void keepFetchedFiles(const Scene& scene, WebFetcher& fetcher);

}  // namespace rtsg
