// SizeReports: tells texture projectors the shape of their pictures, and Texts how large their lines are, as edits of
// hidden fields, from which their behaviours send aspectRatio, textBounds, origin and lineBounds. So replays and
// replicas need neither the files nor the fonts.
//
// Threading: the scene's thread; note() from within a frame, answer() between frames. Source: ISO/IEC 19775-1 V4.0
// 15.4.2 (Text), 42.3.1 (X3DTextureProjectorNode).
#pragma once

#include <set>

#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/documents/media_measures.h>

namespace rtsg {

class SizeReports {
  public:
    /// For a scene that runs already: finds the nodes that nobody has looked at yet.
    explicit SizeReports(const Scene& scene);
    void note(const Scene& scene, const ChangeSet& set);
    /// All Texts are to be looked at: somebody has come who knows fonts. `heardAlone`: but those of whose sizes nobody
    /// may hear wait until somebody does.
    void askTexts(const Scene& scene, bool heardAlone);
    /// `measure` may be empty: then nobody knows fonts. Returns the number of edits.
    std::size_t answer(Scene& scene, const Resources& resources, const TextMeasure& measure);

  private:
    void noteAbove(const Scene& scene, NodeId part);
    void wakeHeard(const Scene& scene);
    bool mayBeHeard(const Scene& scene, NodeId text) const;

    std::set<std::uint32_t> projectors_, texts_;
    bool heardAlone_ = false;
    bool anyScript_ = false;          // there has been a Script, which may read any field
    std::set<std::uint32_t> silent_;  // Texts of which nobody may hear, and which may be others than was told
    std::uint64_t hearingEdits_ = 0;  // of the scene, when these were last looked at
};

}  // namespace rtsg
