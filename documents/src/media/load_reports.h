// LoadReports: tells LoadSensors what became of the urls that they watch (9.4.3): an Inline has content or has none, a
// FontLibrary a font; of anything else one of its urls can be opened, or none can. What the file then holds is for
// those to say who read it.
//
// Threading: the scene's thread; note() from within a frame, answer() between frames.
#pragma once

#include <set>

#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>

namespace rtsg {

class LoadReports {
  public:
    /// Of a scene that runs already: sensors that wait for an answer.
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
