// DocumentServices: what a running scene asks of those who read and write documents, such as instances of prototypes,
// pieces from text and files, another world, and nodes as text.
//
// The scene does not know how documents are read: who does is told to it by Scene::setDocuments(), which whatever loads
// a document calls. This class alone answers that nobody reads documents here. Threading: the scene's thread.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>

namespace rtsg {

/// Something that a script asks to be done between two frames (Browser.loadURL and the like); requests are served in
/// order.
struct DocumentRequest {
    enum class Kind : std::uint8_t {
        piece,       // from the first of `urls` that can be read; its nodes go to `target.field` as an event
        world,       // the same as the next world
        replacement  // `nodes` as the next world
    };
    Kind kind = Kind::piece;
    NodeId script;
    std::vector<std::string> urls;
    std::vector<NodeId> nodes;
    std::vector<std::pair<std::string, NodeId>> names;  // that they, and nodes below them, get
    NodeId target;
    FieldIndex field = kNoField;
};

class DocumentServices {
  public:
    virtual ~DocumentServices() = default;

    /// An instance with its body, in no field of any node. `type`: a PROTO or EXTERNPROTO that a document declares.
    /// `resources`: what urls in it may open; null: nothing. Errors: what the declaration's text says against it.
    virtual Result<NodeId> makePrototypeInstance(Scene& scene, TypeIndex type, NodeId scope,
                                                 const Resources* resources) const;

    /// Declares a prototype under a name that no node type has yet. `type`: a PROTO or EXTERNPROTO that a document
    /// declares; the new one has its fields, and its body or urls. Errors: there is such a type; it is no name.
    virtual Result<> declareAs(Scene& scene, TypeIndex type, std::string_view name, const Resources* resources) const;

    /// Nodes that hang nowhere yet, and those of them that have names.
    struct Piece {
        std::vector<NodeId> roots;
        std::vector<std::pair<std::string, NodeId>> names;
    };
    /// Error: nothing usable is in it; the text is that of the first fault, with its place. If something usable is
    /// left, faults go to the scene's diagnostics.
    virtual Result<Piece> makePiece(Scene& scene, std::string_view text, NodeId scope,
                                    const Resources* resources) const;
    /// From the first url that can be read, seen from the document of `script`.
    virtual Result<Piece> makePieceOfUrls(Scene& scene, NodeId script, const std::vector<std::string>& urls,
                                          const Resources* resources) const;
    /// Does what was asked for. Errors: as above; an url that leads nowhere.
    virtual Result<> serve(Scene& scene, const DocumentRequest& request, const Resources* resources) const;

    /// The node with all below it as ClassicVRML, or as XML, without what encloses it in a file.
    virtual std::string nodeText(const Scene& scene, NodeId node, bool xml) const;
    struct ProfileParts {
        std::string name;
        std::vector<std::pair<std::string, int>> components;  // with their levels
    };
    virtual std::vector<ProfileParts> profiles() const;
    /// What the field is called that had this name in VRML97 or in an X3D before 4.0; empty if none had.
    virtual std::string_view nameNow(const NodeType& type, std::string_view before) const;
    /// The node that a DEF or an IMPORT statement makes known under this name inside `scope`.
    virtual NodeId localNode(const Scene& scene, NodeId scope, std::string_view name) const;
};

}  // namespace rtsg
