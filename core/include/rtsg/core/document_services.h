// DocumentServices: the functions of document readers and writers that a running scene needs: instances of prototypes,
// nodes from text and files, another world, and nodes as text.
//
// The scene does not know how documents are read. Code that loads a document passes an implementation to
// Scene::setDocuments(); this base class answers that nobody reads documents here. Threading: the scene's thread.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>

namespace rtsg {

/// A request of a script that is served between two frames (Browser.loadURL and the like); requests are served in
/// order.
struct DocumentRequest {
    enum class Kind : std::uint8_t {
        piece,       // reads the first of `urls` that can be read; its nodes go to `target.field` as an event
        world,       // reads the first of `urls` that can be read as the next world
        replacement  // makes `nodes` the next world
    };
    Kind kind = Kind::piece;
    NodeId script;
    std::vector<std::string> urls;
    std::vector<NodeId> nodes;
    std::vector<std::pair<std::string, NodeId>> names;  // names for these nodes and for nodes below them
    NodeId target;
    FieldIndex field = kNoField;
};

class DocumentServices {
  public:
    virtual ~DocumentServices() = default;

    /// Makes an instance with its body, which hangs in no field yet. `type` is a PROTO or EXTERNPROTO that a document
    /// declares. `resources` says what its urls may open; null: nothing. Errors: those in the text of the declaration.
    virtual Result<NodeId> makePrototypeInstance(Scene& scene, TypeIndex type, NodeId scope,
                                                 const Resources* resources) const;

    /// Declares a prototype under a name that no node type has yet. `type` is a PROTO or EXTERNPROTO that a document
    /// declares; the new one has its fields, and its body or urls. Errors: the name is taken; it is no name.
    virtual Result<> declareAs(Scene& scene, TypeIndex type, std::string_view name, const Resources* resources) const;

    /// Nodes that hang in no field yet, and the names that some of them have.
    struct Piece {
        std::vector<NodeId> roots;
        std::vector<std::pair<std::string, NodeId>> names;
    };
    /// Makes nodes of a text. Error: the text has no usable node; the error is its first fault, with its place. If some
    /// nodes are usable, faults go to the scene's diagnostics.
    virtual Result<Piece> makePiece(Scene& scene, std::string_view text, NodeId scope,
                                    const Resources* resources) const;
    /// Makes nodes of the first url that can be read, relative to the document of `script`.
    virtual Result<Piece> makePieceOfUrls(Scene& scene, NodeId script, const std::vector<std::string>& urls,
                                          const Resources* resources) const;
    /// Serves a request. Errors: as above; no url can be read.
    virtual Result<> serve(Scene& scene, const DocumentRequest& request, const Resources* resources) const;

    enum class TextForm : std::uint8_t { classic, xml, json };
    /// The node and all nodes below it, without a file's header and Scene element; of the scene's root the whole
    /// document.
    virtual std::string nodeText(const Scene& scene, NodeId node, TextForm form) const;
    struct ProfileParts {
        std::string name;
        std::vector<std::pair<std::string, int>> components;  // with their levels
    };
    virtual std::vector<ProfileParts> profiles() const;
    /// The present name of a field that had the name `before` in VRML97 or in X3D before 4.0; empty if none had.
    virtual std::string_view nameNow(const NodeType& type, std::string_view before) const;
    /// The node that a DEF name or an IMPORT statement names in `scope`.
    virtual NodeId localNode(const Scene& scene, NodeId scope, std::string_view name) const;
};

}  // namespace rtsg
