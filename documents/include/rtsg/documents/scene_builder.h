// SceneBuilder: turns the commands of a document into nodes, names, routes and prototypes of a Scene.
//
// It checks meaning, after readers have checked form: that fields exist and take this value or node, that DEF names are
// known, that ROUTEs connect fields of one type, that IS pairs are legal. A refused part is reported with its position
// and left out; the rest of the document is kept. Children are gathered and attached once, bottom-up, so the cost is
// linear in the document. The builder does not recurse with the depth of nodes, only with that of prototypes, which is
// limited. Threading: the scene's thread. Source: ISO/IEC 19775-1 V4.0 4.4.3 (DEF/USE), 4.4.4-4.4.6 (PROTO,
// EXTERNPROTO, IMPORT/EXPORT), 4.4.8.2 (ROUTE); table 4.4 (IS); RTSG paper 3.1.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/documents/document_handler.h>
#include <rtsg/documents/media_measures.h>

namespace rtsg {

struct BuildOptions {
    std::filesystem::path file;          // the document's own path, if it has one; prevents Inlines of itself
    std::optional<Resources> resources;  // what urls may open, and limits; the default is Resources::ofFile(file)
    bool loadInlines = true;
    bool detached = false;       // roots() are put into no field; the caller does that
    bool namedByUrl = false;     // the document was named by a url and not by the user: its nodes are limited, as those
                                 // of Inlines are
    bool leavesAwaited = false;  // Inlines that would have to wait for the network stay empty
    NodeId scope;                // the PROTO instance or Inline that the nodes belong to; none: the document itself
    MediaLength mediaLength;     // for InlineLoader: measures files that are neither WAVE nor MP4
};

class SceneBuilder final : public DocumentHandler {
  public:
    /// Appends to what is in `scene`. Both references must outlive the builder.
    SceneBuilder(Scene& scene, Diagnostics& diagnostics, BuildOptions options = {});
    ~SceneBuilder() override;

    /// Completes the document if its endDocument never came. Idempotent.
    void finish();
    /// Root nodes added by this document, in order; complete after finish().
    const std::vector<NodeId>& roots() const;
    /// The document's statements about itself, and its DEF names with their nodes, sorted. Both are complete after
    /// finish().
    const DocumentHead& head() const;
    std::vector<std::pair<std::string, NodeId>> names() const;

    void beginDocument(const DocumentHeader& header) override;
    void endDocument() override;
    void component(std::string_view name, int level, SourceLocation where) override;
    void meta(std::string_view name, std::string_view content, SourceLocation where) override;
    void unit(std::string_view category, std::string_view name, double conversionFactor, SourceLocation where) override;
    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override;
    void endNode(SourceLocation where) override;
    void useNode(std::string_view def, std::string_view field, SourceLocation where) override;
    void setField(std::string_view name, Value value, SourceLocation where) override;
    void declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) override;
    void isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation where) override;
    void beginProto(std::string_view name, SourceLocation where) override;
    void beginProtoBody(SourceLocation where) override;
    void endProto(SourceLocation where) override;
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) override;
    void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode, std::string_view toField,
               SourceLocation where) override;
    void importNode(std::string_view inlineDef, std::string_view exportedName, std::string_view localName,
                    SourceLocation where) override;
    void exportNode(std::string_view localName, std::string_view exportedName, SourceLocation where) override;
    bool isFull() const override;

  private:
    friend class InlineLoader;
    friend Result<NodeId> instantiate(Scene&, TypeIndex, Diagnostics&, NodeId, const BuildOptions&);
    Result<NodeId> instantiate(std::string_view proto, std::string_view declarations, NodeId scope);

    struct State;
    std::unique_ptr<State> state_;
};

/// Creates an instance, with its body, of a PROTO or EXTERNPROTO that `scene` knows, from the declaration kept in the
/// type. So it also works on a replica that never saw the file. The instance has no parent yet.
Result<NodeId> instantiate(Scene& scene, TypeIndex proto, Diagnostics& diagnostics, NodeId scope = {},
                           const BuildOptions& options = {});

/// Loads and unloads Inline and InlineGeometry nodes while a scene runs, and gives LoadSensors, sounds, films and
/// texture projectors the properties of their files. Call update() between frames on the scene that owns the files. A
/// replica needs none: the content reaches it as changes.
class InlineLoader {
  public:
    InlineLoader(Scene& scene, Diagnostics& diagnostics, BuildOptions options = {});
    ~InlineLoader();
    enum class Texts : std::uint8_t {
        all,
        /// Only those whose size somebody uses: a route, a listener or any Script. So fonts are loaded, and the state
        /// depends on them, only where that is needed.
        heard,
    };
    /// From now on Texts send their sizes, which `measure` computes; without it they send none.
    void measureTexts(TextMeasure measure, Texts which = Texts::all);
    /// Checks the Inlines whose `load` or `url` changed since the last call. Returns how many nodes were loaded,
    /// unloaded or given properties.
    std::size_t update();
    /// Starts the fetches of all addresses that nodes name. Returns true as long as some are pending: call it again.
    bool fetchAhead();
    /// Whether something is pending, for example from the network: another update() is due soon.
    bool awaits() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace rtsg
