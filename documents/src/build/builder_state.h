// The inside of SceneBuilder. Shared by scene_builder*.cpp, proto_instance.cpp and inline.cpp only.
//
// A stack of scopes (document, Inline, PROTO instance: each with its own DEF names) over a stack of open nodes.
// A PROTO body and an Inline are replayed into the same builder with a scope of their own on top.
#pragma once

#include <map>
#include <set>
#include <tuple>
#include <unordered_set>

#include <rtsg/documents/dialect.h>
#include <rtsg/documents/scene_builder.h>

#include "commands/document_head.h"
#include "commands/time_limit.h"
#include "proto.h"

namespace rtsg {

/// Stands for the Script being read, which exists only once its fields are known.
constexpr NodeId kSelf{0xFFFFFFFF};
/// Stands for the DEF of a node of unknown type: there is no node, and USE and ROUTE need not report it again.
constexpr NodeId kOfUnknownType{0xFFFFFFFE};
/// How deep PROTO instances, and declarations, may stand in each other's bodies.
constexpr std::size_t kMaximumProtoDepth = 64;
/// How many fields a prototype, Script or shader may declare.
constexpr std::size_t kMaxFields = 4000;

/// Files read during one load: each is parsed once however often it is inlined or used as a library.
class LoadSession {
  public:
    struct File {
        explicit File(CommandList::Limits limits) : commands(limits) {}
        DocumentSource source;
        CommandList commands;
        Diagnostics diagnostics;
        bool reported = false;
        Environment* prototypes = nullptr;  // its PROTOs, once asked for
    };

    /// The file behind `url`, seen from the folder `from`, as far as `nodesLeft` nodes and `time` go. Fails for a
    /// file that the policy refuses, that is missing, or that has no usable content.
    Result<File*> open(const Resources& resources, const std::filesystem::path& from, std::string_view url,
                       std::uint64_t nodesLeft, const detail::TimeLimit& time,
                       const std::shared_ptr<const Dialect>& dialect);
    /// The library that our urns of materials name.
    File& portableMaterials();
    Environment* newEnvironment(const Environment* outer = nullptr, std::size_t visible = 0) {
        return &environments_.emplace_back(outer, visible);
    }
    const DocumentSource* keep(DocumentSource source) { return &sources_.emplace_back(std::move(source)); }

  private:
    /// The files by their place and by the folder from which their own urls start, which may differ because of a link.
    std::map<std::pair<std::string, std::filesystem::path>, std::unique_ptr<File>> files_;
    std::deque<Environment> environments_;
    std::deque<DocumentSource> sources_;
};

/// The value of `loadedUrl` for a document that `url` led to: the address that answered, from which its own urls start,
/// or the url without its fragment.
std::string loadedUrlOf(const std::filesystem::path& opened, std::string_view url);

struct ChildList {
    FieldIndex field = kNoField;
    std::vector<NodeId> nodes;
};

struct IsRequest {
    std::string nodeField, protoField;
    SourceLocation where;
};

struct OpenNode {
    enum class Kind : std::uint8_t { node, instance, script, body, unknown };

    Kind kind = Kind::node;
    NodeId id;  // none while a Script is open
    TypeIndex typeIndex;
    const NodeType* type = nullptr;  // of a Script: the built-in part
    ProtoDeclaration* proto = nullptr;
    FieldIndex parentField = kNoField;  // in the node below; kNoField: kept, but in none of its fields
    std::string def;
    SourceLocation where;
    std::vector<ChildList> children;
    std::vector<bool> given;  // by field
    std::vector<IsRequest> connections;
    // A Script's (or shader's) own fields, and the values that wait for it to exist; of a CADLayer, for its children.
    std::vector<FieldDef> own;
    std::vector<std::pair<FieldIndex, Value>> values;
    // Where the fields stand in `children` and `own` if there are many, as far as they have been looked for.
    std::vector<std::size_t> listed;
    std::size_t lists = 0;
    mutable NameMap<std::size_t> ownByName;
    mutable std::size_t ownNamed = 0;

    std::vector<NodeId>& list(FieldIndex field);
    bool isGiven(FieldIndex field) const { return field < given.size() && given[field]; }
    void markGiven(FieldIndex field);
    /// Calls for when the fields of `children` are others, and when `own` is used up.
    void forgetLists();
    void forgetOwn();
    FieldIndex find(std::string_view name) const;
    /// The place in `own`, or behind its end.
    std::size_t findOwn(std::string_view name) const;
    const FieldDef& field(FieldIndex index) const;
    /// "Transform T", for diagnostics.
    std::string describe() const;
};

struct PendingRoute {
    NodeId from, to;  // resolved already if the name was known where the ROUTE stands
    std::string fromNode, fromField, toNode, toField;
    SourceLocation where;
};

struct ImportStatement {
    std::string inlineDef, exported, local;
    SourceLocation where;
};

struct ExportStatement {
    std::string local, exported;
    SourceLocation where;
};

struct NameScope {
    NodeId owner;
    NameMap<NodeId> names;
    Environment* environment = nullptr;
    const DocumentSource* source = nullptr;
    ProtoDeclaration* proto = nullptr;  // whose body is being replayed, for IS
    const NodeType* instanceType = nullptr;
    bool isDocument = false;  // a document of its own (the main one, an Inline's)
    bool declarationsOnly = false;
    bool quiet = false;  // a body whose diagnostics have been given
    std::string prefix;  // of the names of types declared here: "Outer#" in the body of Outer
    std::size_t openBase = 0;
    std::vector<PendingRoute> routes;
    std::vector<ImportStatement> imports;
    std::unordered_set<std::string> importedNames;  // the local ones
    std::vector<ExportStatement> exports;
    std::vector<std::pair<NodeId, SourceLocation>> inlines, fontLibraries;
    std::string previousFile;  // of the diagnostics, to go back to
};

struct SceneBuilder::State {
    State(SceneBuilder& builder, Scene& target, Diagnostics& sink, BuildOptions buildOptions);
    /// Counts a node that is about to be made. False, and reported once, if it is one too many or too late.
    bool hasRoomFor(const NameScope& scope, SourceLocation where);
    /// Counts a command; now and then it looks at the clock, and at the memory of the process.
    void noteWork(SourceLocation where);
    void lookAtLimits(SourceLocation where);
    /// Nodes that Inlines and PROTO bodies may still have.
    std::uint64_t nodesLeft() const;

    SceneBuilder& handler;
    Scene& scene;
    Diagnostics& diagnostics;
    BuildOptions options;
    std::shared_ptr<const Dialect> dialect;  // of the scene; null: none
    LoadSession session;

    std::vector<OpenNode> open;  // reused: only the first `openCount` are live
    std::size_t openCount = 0;
    std::vector<std::unique_ptr<NameScope>> scopes;
    std::vector<NodeId> roots;
    std::unordered_set<std::uint32_t> named;  // nodes that got their names here; only of a detached piece
    std::size_t skipDepth = 0;                // > 0 inside a refused node
    std::size_t skipProtoDepth = 0;           // > 0 inside a PROTO declaration that is known already
    std::size_t documentDepth = 0;
    std::size_t externDepth = 0;      // of EXTERNPROTOs that lead to each other
    std::uint64_t expandedNodes = 0;  // in PROTO bodies and Inlines
    const detail::TimeLimit time;
    std::uint64_t commands = 0;
    SourceLocation lastWhere;  // of the last command
    bool isOver = false;       // the time that the policy lets, or the process's memory: no further node is made
    bool finished = false;
    bool linksFonts = false;                                                     // a FontLibrary has come
    std::set<std::pair<const DocumentSource*, std::string_view>> withoutEffect;  // types that were named, by file
    std::set<std::tuple<const DocumentSource*, std::uint32_t, std::uint32_t, std::string>>
        oddValues;             // that were told: of bodies, once
    bool hasLayerSet = false;  // one was built
    bool isTrial = false;      // instancing into a scratch scene, for diagnostics only

    // The PROTO declaration being recorded, and the parts that are open in it, outermost first: the interface of a
    // PROTO (i), its body (b) or a node (n). Commands that would not nest are left out, so that a recording can always
    // be replayed.
    std::unique_ptr<ProtoDeclaration> recording;
    std::string recordingOpen;
    CommandList* recordingDefault = nullptr;
    CommandList discarded;

    NameMap<std::pair<TypeIndex, const NodeType*>> builtin;  // by name, filled on demand
    std::unordered_map<std::string, TypeIndex> scriptTypes;  // by interface
    DocumentHead head;

    NameScope& scope() { return *scopes.back(); }
    OpenNode* top() { return openCount > scope().openBase ? &open[openCount - 1] : nullptr; }
    void error(SourceLocation where, std::string text);
    void warning(SourceLocation where, std::string text);

    // scene_builder.cpp
    OpenNode& push(OpenNode::Kind kind, SourceLocation where);
    void pop();
    void rememberLocation(const OpenNode& node);
    std::pair<TypeIndex, const NodeType*> findBuiltin(std::string_view name);
    FieldIndex fieldFor(OpenNode& parent, std::string_view field, const NodeType* child, std::string_view childName,
                        SourceLocation where);
    const NodeType* effectiveType(NodeId node) const;
    void openUnknown(std::string_view type, std::string_view def, SourceLocation where);
    void nameNode(const OpenNode& node);
    /// In a detached piece a name that the scene has already stays where it is.
    void giveName(NodeId id, const std::string& name, SourceLocation where);
    void attach(OpenNode& parent, FieldIndex field, NodeId child);
    void hideChildren(OpenNode& node);
    void storeChildren(OpenNode& node);
    void endScript(OpenNode& node);
    /// Names a type that holds its fields and does nothing, once a file.
    void reportOfNoEffect(NodeId id, SourceLocation where);
    /// Names values that mean nothing where they stand.
    void reportOfOddValues(NodeId id, SourceLocation where);
    /// Rotation axes become unit vectors (5.3.18); readers have warned of them, as of values out of range.
    static void normalise(Value& value);
    void store(OpenNode& node, FieldIndex field, Value value, SourceLocation where);
    NameScope& pushScope(NodeId owner, Environment* environment, const DocumentSource* source);
    void popScope();
    void closeOpenNodes();
    // scene_builder_routes.cpp
    /// Routes, exports, Inlines and imports: all that can only be settled once every name is known.
    void finishScope(NameScope& in);
    void resolveRoutes(NameScope& in);
    void storeImports(NameScope& in);

    // proto_instance.cpp
    bool isRecording() const { return recording != nullptr; }
    CommandList& recorder() { return recordingOpen.front() == 'b' ? recording->body : *recordingDefault; }
    /// Chooses the default value that a node at the outermost level of the interface belongs to.
    void chooseDefault(std::string_view field, SourceLocation where);
    void declare(std::unique_ptr<ProtoDeclaration> declaration);
    bool defineProtoType(ProtoDeclaration& declaration, const std::string& prefix);
    void resolveExternal(ProtoDeclaration& declaration);
    void connectInterface(OpenNode& node);
    void connect(OpenNode& node, const IsRequest& request);
    void expand(OpenNode& instance);
    void checkUnusedProtos();
    Environment* libraryOf(LoadSession::File& file);

    // inline.cpp
    bool loadInline(NodeId node, SourceLocation where);
    /// The Inlines that a GeoLOD keeps for its urls.
    void addTiles(NodeId geoLod, SourceLocation where);
    void fillInline(NodeId node, LoadSession::File& file, std::string_view url, SourceLocation where);
    void reportFile(LoadSession::File& file);
    /// Replays the file's commands into the scope and open node on top, and leaves no loose ends.
    void replayFile(const LoadSession::File& file);
};

/// The node that `name` means inside `scope`: a DEF, or an imported node if its Inline is loaded.
NodeId resolveLocalName(const Scene& scene, NodeId scope, std::string_view name, int depth = 0);
/// Which limit has been reached.
std::string tooManyNodes(std::uint64_t maximum);
std::string whyFull(const CommandList& commands, const ResourcePolicy& policy);
/// The declaration as ClassicVRML text.
std::string declarationText(const ProtoDeclaration& proto);
/// A document of all PROTOs and EXTERNPROTOs that the scene's own document declares; empty if there are none.
std::string declarationsOf(const Scene& scene);
/// The field types from outside that types of the scene have, for FieldTypesInScope: declarations name them.
std::vector<std::shared_ptr<const CustomType>> fieldTypesOf(const Scene& scene);
/// Adds the ROUTEs to imported names, as far as their Inlines are loaded now. Returns how many ends are missing.
std::size_t connectImports(Scene& scene, NodeId scope, Diagnostics* diagnostics);

}  // namespace rtsg
