// FontReports: reads the fonts of FontLibrary nodes into the scene, and links to each font style the library that has
// one of its families, as edits of hidden fields. So replays and replicas draw the same letters without the files.
//
// A style takes the first of its families that is SERIF, SANS or TYPEWRITER (these stay as they are) or that a
// FontLibrary of its own execution context, with a font, lists; letters of either case are equal. If there are several
// such libraries, the one that was made first counts. Threading: the scene's thread; note() from within a frame,
// answer() between frames. Source: ISO/IEC CD 19775-1 V4.1 15.4 (FontLibrary); where the draft is open, X_ITE is
// followed.
#pragma once

#include <set>

#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>

namespace rtsg {

class FontReports {
  public:
    /// For a scene that runs already: libraries that it has are not read again.
    explicit FontReports(const Scene& scene);
    void note(const Scene& scene, const ChangeSet& set);
    /// Returns the number of edits.
    std::size_t answer(Scene& scene, const Resources& resources, Diagnostics& diagnostics);

  private:
    void noteNode(const Node& node);

    std::set<std::uint32_t> libraries_, styles_, unread_;
    bool linking_ = false;  // families, libraries or fonts are others
};

/// Reads the font of a FontLibrary from the first of its urls that leads to one, or drops it if `load` is FALSE.
/// Returns whether it has another font now. A file that cannot be read is an error at `where`.
bool readFont(Scene& scene, NodeId library, const Resources& resources, Diagnostics& diagnostics, SourceLocation where);
/// Links all styles of the scene to libraries. Returns the number of edits. Linear.
std::size_t linkFontStyles(Scene& scene);

}  // namespace rtsg
