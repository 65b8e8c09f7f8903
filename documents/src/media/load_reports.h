// LoadReports: reports to LoadSensors whether the urls that they watch could be loaded (9.4.3). An Inline has content
// or none, a FontLibrary has a font or none; for any other node, one of its urls can be opened or none can. Readers of
// the file report its errors.
//
// Threading: the scene's thread; note() from within a frame, answer() between frames.
#pragma once

#include <set>

#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>

namespace rtsg {

class LoadReports {
  public:
    /// For a scene that runs already: finds the sensors that wait for an answer.
    explicit LoadReports(const Scene& scene);
    void note(const Scene& scene, const ChangeSet& set);
    /// After Inlines were loaded. Returns the number of edits.
    std::size_t answer(Scene& scene, const Resources& resources);

  private:
    void note(const Scene& scene, const Change& change);

    std::set<std::uint32_t> asked_, changed_;  // sensors that wait; whose children have other urls now
    std::uint32_t firstCreated_ = UINT32_MAX;  // in the set at hand; numbers of nodes grow
};

}  // namespace rtsg
