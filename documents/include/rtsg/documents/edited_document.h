// EditedDocument: a scene follows the document that it was loaded from while somebody edits that.
//
// What was edited becomes edits of the scene: the difference between the document before and now, not between the
// document and the scene. So what the scene has done meanwhile stays where the document says what it said before, and
// everybody on the bus gets no more than what was edited. Nodes keep their numbers as far as they are the same: by DEF,
// then by place in the parent. Types of PROTOs that were edited stay known to the scene beside the new ones.
// Invariant: of a scene in which nothing has happened, what follows is the document that the edited file would make.
// Threading: the scene's thread, between frames. Memory: one more copy of the document.

// Example:
//     #include <rtsg/documents/edited_document.h>
//     #include <rtsg/documents/loader.h>
//     rtsg::Scene scene;
//     rtsg::Diagnostics diagnostics{"hall.x3dv"};
//     if (!rtsg::loadFile(scene, "hall.x3dv", diagnostics)) return;
//     rtsg::EditedDocument document(scene);  // before the first frame
//     scene.newFrame(0);
//     if (document.followFile("hall.x3dv", diagnostics)) scene.seal();  // one ChangeSet with what was edited
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/documents/loader.h>

namespace rtsg {

class EditedDocument {
  public:
    /// Precondition: `scene` holds what was loaded, and has run no frame since. It must outlive this.
    explicit EditedDocument(Scene& scene);
    ~EditedDocument();

    /// An empty scene that knows the types of users that this one knows, to read the edited document into.
    std::unique_ptr<Scene> emptyScene() const;
    /// The scene's edits, not sealed: what leads from the document that was followed last to `edited`, which holds the
    /// document as it is now and has run no frame. What the scene refuses, because it has changed meanwhile, is named
    /// in `diagnostics` and left out. Error, and nothing is done: from within a frame.
    Result<> follow(std::unique_ptr<Scene> edited, Diagnostics& diagnostics);
    /// Reads the file, and follows it. False, and the scene stays as it was: an error is in the file, or in one that it
    /// inlines; `diagnostics` has it with its place.
    bool followFile(const std::filesystem::path& file, Diagnostics& diagnostics, const LoadOptions& options = {});

    /// The files from which Inlines and EXTERNPROTOs of the document were read, each once, sorted.
    std::vector<std::filesystem::path> filesWithin(const Resources& resources) const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
