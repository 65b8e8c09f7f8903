// EditedDocument: keeps a scene in step with its document while somebody edits the document.
//
// The difference between the old and the new document becomes edits of the scene; the scene itself is not compared. So
// the scene keeps what it has changed since, wherever the document is unchanged, and the bus carries only what was
// edited. Nodes keep their numbers where they are the same: by DEF, then by position in the parent. Types of edited
// PROTOs stay known to the scene beside the new ones. Invariant: if the scene has not changed since, the result is the
// scene that the edited file would give. Threading: the scene's thread, between frames. Memory: one more copy of the
// document.

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
    /// Precondition: `scene` holds a loaded document and has run no frame since. It must outlive this.
    explicit EditedDocument(Scene& scene);
    ~EditedDocument();

    /// An empty scene that knows the custom types of this one, for reading the edited document.
    std::unique_ptr<Scene> emptyScene() const;
    /// Edits the scene, without sealing: the edits lead from the document of the last call to `edited`, which holds the
    /// present document and has run no frame. Edits that the scene refuses, because it has changed meanwhile, are
    /// reported in `diagnostics` and left out. Error, after which nothing has changed: the call comes from within a
    /// frame.
    Result<> follow(std::unique_ptr<Scene> edited, Diagnostics& diagnostics);
    /// Reads the file, and calls follow(). Returns false, and leaves the scene as it was, if there is an error in the
    /// file or in one that it inlines; `diagnostics` has it with its position.
    bool followFile(const std::filesystem::path& file, Diagnostics& diagnostics, const LoadOptions& options = {});

    /// The files of Inlines and EXTERNPROTOs of the document, each once, sorted.
    std::vector<std::filesystem::path> filesWithin(const Resources& resources) const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
