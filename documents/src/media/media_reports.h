// MediaReports: tells sound sources and films how long what their urls lead to plays, as an edit of their _duration.
//
// Threading: the scene's thread; note() from within a frame, answer() between frames. Source: ISO/IEC 19775-1 V4.0
// 16.4.2, 18.4.2 (duration_changed).
#pragma once

#include <set>

#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/documents/media_measures.h>

namespace rtsg {

class MediaReports {
  public:
    /// For a scene that runs already: finds the nodes whose files nobody has looked at yet.
    explicit MediaReports(const Scene& scene);
    void note(const Scene& scene, const ChangeSet& set);
    /// `others` is asked for files whose header nobody here reads; it may be empty. Nodes with urls and no length are
    /// reported. Returns the number of edits.
    std::size_t answer(Scene& scene, const Resources& resources, const MediaLength& others, Diagnostics& diagnostics);

  private:
    std::set<std::uint32_t> asked_;
};

}  // namespace rtsg
