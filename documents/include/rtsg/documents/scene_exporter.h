// SceneExporter: sends a scene as the commands of a document to a writer, a filter or another SceneBuilder.
//
// A scene that came from a document gives the same document: DEF and USE, PROTO declarations and instances (never their
// expanded bodies), Inlines (never their content), ROUTEs, IMPORT and EXPORT, head. It needs only the scene's state, so
// a replica saves the same document as the origin. Nodes that are shared or routed but nameless get names of the form
// _1. Cost is linear in the document; nesting is limited by memory only. Threading: the scene's thread. Source: RTSG
// paper 3.1; ISO/IEC 19775-1 V4.0 4.4.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include <rtsg/core/scene.h>
#include <rtsg/documents/document_handler.h>

namespace rtsg {

/// What is replaced by the nodes that it consists of. A name that would then occur twice gets a number at its end.
struct ExportOptions {
    /// An instance of a PROTO or EXTERNPROTO becomes the first node of its body. The other nodes of the body, which are
    /// not rendered, go into a Switch at the end; routes to and from the instance go to the nodes behind its IS
    /// connections.
    bool expandPrototypes = false;
    /// An Inline becomes a Group with its content, if it is loaded.
    bool expandInlines = false;
    /// An InlineGeometry becomes the geometry that it has loaded; those that load one file alike share it.
    bool expandGeometries = false;
    /// Gives the url of a package (`package://`) that an expanded Inline names; null: it stays as it is.
    std::function<std::string(std::string_view)> packageUrl{};
    /// CADLayer.visible is written as a list with a value for each child, as in X3D 3.1 to 3.3.
    bool listsVisible = false;
};

class SceneExporter {
  public:
    /// `diagnostics` receives what a document cannot express, such as a reference into a PROTO's body.
    SceneExporter(const Scene& scene, Diagnostics& diagnostics, ExportOptions options = {});
    ~SceneExporter();

    /// Sends beginDocument ... endDocument. `encoding` goes into the header.
    void write(DocumentHandler& handler, Encoding encoding = Encoding::classicVrml);
    /// Sends one node with all nodes below it: no head, no declarations, no routes.
    void writeNode(DocumentHandler& handler, NodeId node, Encoding encoding = Encoding::classicVrml);

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
