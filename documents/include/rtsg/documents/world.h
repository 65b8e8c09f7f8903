// The world of a scene: functions for its whole document, for pieces of documents that are added, and for another world
// that replaces it.
//
// Threading: the scene's thread, outside of frames. Bad input never throws; the diagnostics have it, with positions.
// Source: ISO/IEC 19775-2 V4.0 (createX3DFromString and related services, loadURL, replaceWorld, getProfile ...).

// Example:
//     #include <rtsg/documents/world.h>
//     #include <rtsg/core/x3d.h>
//     rtsg::Scene scene;
//     rtsg::Diagnostics diagnostics{"a piece"};
//     const auto piece = rtsg::createX3DFromString(scene, "DEF LAMP PointLight { }", diagnostics);
//     if (!piece) return;
//     for (const rtsg::NodeId node : piece->roots)
//         (void)scene.insertChild(scene.root(), rtsg::x3d::RtsgScene::children, node);
//     (void)rtsg::sendFieldText(scene, "LAMP.on", "FALSE");
//     scene.newFrame(0);
//     std::cout << *rtsg::fieldText(scene, "LAMP.on") << '\n';  // FALSE
#pragma once

#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <rtsg/core/field_path.h>
#include <rtsg/core/output_file.h>
#include <rtsg/core/scene.h>
#include <rtsg/documents/document_handler.h>
#include <rtsg/documents/loader.h>

namespace rtsg {

// ---- statements about a world --------------------------------------------------------------------------------------

struct DocumentInfo : DocumentHead {
    struct Import {
        std::string inlineName, exportedName, localName;
    };
    struct Export {
        std::string localName, exportedName;
    };
    std::vector<Import> imports;
    std::vector<Export> exports;
    std::vector<std::string> prototypes, externPrototypes;  // declared by the document itself
};
DocumentInfo documentInfo(const Scene& scene);

// ---- imports and exports -------------------------------------------------------------------------------------------
// These functions are for the document itself, or, with `scope`, for the content of an Inline. Their edits are ordinary
// edits of the scene.

/// An IMPORT statement. `node` is none if the Inline is not loaded, or exports no such name.
struct ImportedNode {
    std::string localName;
    NodeId inlineNode;  // none: no node has the name in the statement
    std::string exportedName;
    NodeId node;
};
/// An EXPORT statement, for documents that inline this one. `node` is none if no node has the name.
struct ExportedNode {
    std::string exportedName, localName;
    NodeId node;
};
/// Listed in the order of the statements.
std::vector<ImportedNode> importedNodes(const Scene& scene, NodeId scope = {});
std::vector<ExportedNode> exportedNodes(const Scene& scene, NodeId scope = {});
/// The node that is imported, or exported, under this name; none if there is none.
NodeId findImported(const Scene& scene, std::string_view localName, NodeId scope = {});
NodeId findExported(const Scene& scene, std::string_view exportedName, NodeId scope = {});
/// Imports a node into the document to which the Inline belongs, and replaces an import of the same name; without
/// `localName` the exported name is used. The Inline need not be loaded yet. Errors: the node is no Inline, or has no
/// name; a node in the document has the local name.
Result<> updateImportedNode(Scene& scene, NodeId inlineNode, std::string_view exportedName,
                            std::string_view localName = {});
/// Routes to the node stay. Errors: nothing is imported under this name.
Result<> removeImportedNode(Scene& scene, std::string_view localName, NodeId scope = {});
/// Exports a node of the document, or one that it imports, and replaces an export of the same name. Errors: the node
/// has no name in the document.
Result<> updateExportedNode(Scene& scene, std::string_view exportedName, NodeId node, NodeId scope = {});
/// Errors: nothing is exported under this name.
Result<> removeExportedNode(Scene& scene, std::string_view exportedName, NodeId scope = {});

// ---- pieces --------------------------------------------------------------------------------------------------------

/// Nodes that were read, with their routes; the caller puts them into a field.
struct Fragment {
    std::vector<NodeId> roots;  // in the order of the document
    DocumentHead head;
    std::vector<std::pair<std::string, NodeId>> names;  // sorted

    /// The node that has this name in the piece; none if there is none. The scene has the name too, unless one of its
    /// nodes had it before.
    NodeId find(std::string_view name) const;
};
/// Reads a text, a stream or a file; without an encoding's header, a text is ClassicVRML. IMPORT and EXPORT statements
/// are left out, and reported. Returns nothing if there is nothing usable.
std::optional<Fragment> createX3DFromString(Scene& scene, std::string_view text, Diagnostics& diagnostics,
                                            const LoadOptions& options = {});
std::optional<Fragment> createX3DFromStream(Scene& scene, std::istream& stream, Diagnostics& diagnostics,
                                            const LoadOptions& options = {});
std::optional<Fragment> createX3DFromFile(Scene& scene, const std::filesystem::path& file, Diagnostics& diagnostics,
                                          const LoadOptions& options = {});

// ---- worlds --------------------------------------------------------------------------------------------------------

/// Destroys all nodes except those of the piece and those kept by Scene::hold(), and makes the piece's roots the
/// children of the scene's root, with their names. Subscribers and replicas get it as one set; Listeners::onWorld hears
/// of it. Types of PROTOs stay known. Errors: a call from within a frame; nodes that do not exist.
Result<> replaceWorld(Scene& scene, const Fragment& piece);
/// Reads a file, then replaces the world by it. If the file has nothing usable, it returns false and the world stays.
bool loadWorld(Scene& scene, const std::filesystem::path& file, Diagnostics& diagnostics,
               const LoadOptions& options = {});
/// Writes the scene as a document, in the encoding of the file's name. Errors: a name without an encoding; errors of
/// the system.
Result<> saveWorld(const Scene& scene, const std::filesystem::path& file, Diagnostics& diagnostics,
                   Existing existing = Existing::keep);

}  // namespace rtsg
