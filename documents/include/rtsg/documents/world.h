// The world of a scene: the document in it as a whole, pieces of documents that come into it, and another world in its
// place.
//
// Threading: the scene's thread, outside of frames. Never throws for bad input: it is in the diagnostics, with
// positions. Source: ISO/IEC 19775-2 V4.0 (createX3DFromString and its kin, loadURL, replaceWorld, getProfile ...).

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
#include <rtsg/documents/profile.h>

namespace rtsg {

// ---- what a world says of itself -----------------------------------------------------------------------------------

struct DocumentInfo : DocumentHead {
    struct Import {
        std::string inlineName, exportedName, localName;
    };
    struct Export {
        std::string localName, exportedName;
    };
    std::vector<Import> imports;
    std::vector<Export> exports;
    std::vector<std::string> prototypes, externPrototypes;  // that the document itself declares
};
DocumentInfo documentInfo(const Scene& scene);

// ---- imports and exports -------------------------------------------------------------------------------------------
// Of the document itself, or, with `scope`, of what an Inline has loaded. Editing them is an edit like any other.

/// The node that an IMPORT statement makes known under `localName`. There is no node if its Inline is not loaded, or
/// exports no such name.
struct ImportedNode {
    std::string localName;
    NodeId inlineNode;  // none: no node has the name that the statement gives
    std::string exportedName;
    NodeId node;
};
/// The node that an EXPORT statement offers to documents that inline this one. There is no node if none has the name.
struct ExportedNode {
    std::string exportedName, localName;
    NodeId node;
};
/// In the order of the statements.
std::vector<ImportedNode> importedNodes(const Scene& scene, NodeId scope = {});
std::vector<ExportedNode> exportedNodes(const Scene& scene, NodeId scope = {});
/// The node that is imported, or exported, under this name; none if there is none.
NodeId findImported(const Scene& scene, std::string_view localName, NodeId scope = {});
NodeId findExported(const Scene& scene, std::string_view exportedName, NodeId scope = {});
/// Makes a name known in the document to which the Inline belongs, also in the place of an import that had it; without
/// `localName` it is the exported one. The Inline need not be loaded yet. Errors: no Inline, or one without a name; a
/// node there has the name.
Result<> updateImportedNode(Scene& scene, NodeId inlineNode, std::string_view exportedName,
                            std::string_view localName = {});
/// Routes to the node stay. Errors: nothing was imported under this name.
Result<> removeImportedNode(Scene& scene, std::string_view localName, NodeId scope = {});
/// Offers a node of the document, or one that it imports, also in the place of another one. Errors: a node without a
/// name there.
Result<> updateExportedNode(Scene& scene, std::string_view exportedName, NodeId node, NodeId scope = {});
/// Errors: nothing is exported under this name.
Result<> removeExportedNode(Scene& scene, std::string_view exportedName, NodeId scope = {});

// ---- pieces --------------------------------------------------------------------------------------------------------

/// Nodes that were read, with their routes, and hang nowhere yet: that is for the caller to do.
struct Fragment {
    std::vector<NodeId> roots;  // in the order of the document
    DocumentHead head;
    std::vector<std::pair<std::string, NodeId>> names;  // sorted

    /// The node that has this name in the piece; none if there is none. In the scene it has the name too, unless a node
    /// there had it before.
    NodeId find(std::string_view name) const;
};
/// Without an encoding's header the text is ClassicVRML. IMPORT and EXPORT statements are left out, and reported.
/// Nothing if the text has nothing usable.
std::optional<Fragment> createX3DFromString(Scene& scene, std::string_view text, Diagnostics& diagnostics,
                                            const LoadOptions& options = {});
std::optional<Fragment> createX3DFromStream(Scene& scene, std::istream& stream, Diagnostics& diagnostics,
                                            const LoadOptions& options = {});
std::optional<Fragment> createX3DFromFile(Scene& scene, const std::filesystem::path& file, Diagnostics& diagnostics,
                                          const LoadOptions& options = {});

// ---- worlds --------------------------------------------------------------------------------------------------------

/// Everything but what is below the piece, and what Scene::hold() holds, is destroyed; the piece's nodes are the root's
/// children, and have their names. Subscribers and replicas get it as one set; Listeners::onWorld hears of it. Types
/// of PROTOs stay known. Errors: from within a frame; nodes that are not there.
Result<> replaceWorld(Scene& scene, const Fragment& piece);
/// Reads a file, then replaces the world by it. If the file has nothing usable, returns false, and the world stays.
bool loadWorld(Scene& scene, const std::filesystem::path& file, Diagnostics& diagnostics,
               const LoadOptions& options = {});
/// The scene as a document, in the encoding that the file's name says. Errors: a name that says none; what the system
/// says.
Result<> saveWorld(const Scene& scene, const std::filesystem::path& file, Diagnostics& diagnostics,
                   Existing existing = Existing::keep);

}  // namespace rtsg
