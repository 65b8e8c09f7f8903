// FetchAhead: has files fetched from the network as soon as nodes name them, so that those who open them later, such as
// renderers on other threads, find them there, and a log has all that a scene names.
//
// Of a list of urls the first one that can be opened counts. Links that somebody may follow are left alone.
// Threading: the scene's thread; note() from within a frame, answer() between frames.
#pragma once

#include <map>
#include <set>

#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>

namespace rtsg {

/// Whether whoever opens the first of a node's urls that can be opened would wait for the network. Starts to fetch it.
bool awaitsUrls(const Scene& scene, const Node& node, FieldIndex field, const Resources& resources);

class FetchAhead {
  public:
    /// Looks at all nodes first, in answer().
    explicit FetchAhead(const Scene& scene);
    void note(const Scene& scene, const ChangeSet& set);
    void answer(const Scene& scene, const Resources& resources);
    /// Whether something is being fetched.
    bool awaits() const { return !asked_.empty(); }

  private:
    void noteNode(const Node& node);

    std::set<std::uint32_t> asked_;
    std::map<const NodeType*, bool> types_;  // whether their nodes name files
};

}  // namespace rtsg
