// Worlds as wholes: reads pieces beside one, replaces one by another, and writes one to a file.
#include <rtsg/documents/world.h>

#include <algorithm>
#include <istream>
#include <iterator>
#include <map>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/command_list.h>
#include <rtsg/documents/scene_builder.h>
#include <rtsg/documents/scene_exporter.h>
#include <rtsg/documents/writer.h>

#include "at_address.h"
#include "builder_state.h"
#include "commands/document_head.h"

namespace rtsg {

namespace {

using Root = x3d::RtsgScene;

constexpr DiagnosticCode kFromWithin{"from-within"};

/// Scripts of a document may open the same files as its urls.
BuildOptions buildOptions(const LoadOptions& options, const Resources& otherwise) {
    BuildOptions result;
    result.loadInlines = options.loadInlines;
    result.resources = options.resources ? *options.resources : otherwise;
    result.namedByUrl = options.namedByUrl;
    return result;
}

std::optional<Fragment> fragmentOf(const SceneBuilder& builder, bool complete) {
    Fragment piece{builder.roots(), builder.head(), builder.names()};
    if (!complete && piece.roots.empty()) return std::nullopt;
    return piece;
}

/// The nodes below `starts`, bodies included, by number.
std::vector<bool> below(const Scene& scene, std::vector<NodeId> starts) {
    std::vector<bool> reached;
    const auto isNew = [&](NodeId id) {
        if (!id || !scene.find(id)) return false;
        if (reached.size() <= id.value) reached.resize(std::size_t{id.value} + 1);
        if (reached[id.value]) return false;
        reached[id.value] = true;
        return true;
    };
    std::erase_if(starts, [&](NodeId id) { return !isNew(id); });
    while (!starts.empty()) {
        const Node& node = scene.node(starts.back());
        starts.pop_back();
        for (const FieldIndex i : node.type().nodeFields()) {
            const FieldDef& def = node.type().fields[i];
            if (!def.readable()) continue;
            if (def.type == FieldType::SFNode) {
                const NodeId child = node.get(Field<NodeId>{i});
                if (isNew(child)) starts.push_back(child);
                continue;
            }
            for (const NodeId child : node.get(Field<Array<NodeId>>{i}))
                if (isNew(child)) starts.push_back(child);
        }
    }
    return reached;
}

/// Leaves the nodes in `kept`, and an empty document. Input of devices goes on. Error: the scene takes no edits here.
Result<> clear(Scene& scene, const std::vector<bool>& kept) {
    const NodeId root = scene.root();
    if (auto ok = scene.set(root, Root::children, Array<NodeId>()); !ok) return ok;
    setHidden(scene, root, Root::profile.index, Value(String()));
    setHidden(scene, root, Root::loadedUrl.index, Value(String()));
    setHidden(scene, root, Root::_emptied.index, Value(std::int32_t{0}));
    for (const FieldIndex field : {Root::components.index, Root::exports.index, Root::importRoutes.index,
                                   Root::imports.index, Root::meta.index, Root::units.index, Root::_requests.index})
        setHidden(scene, root, field, Value(Array<String>()));
    std::vector<NodeId> gone;
    scene.forEachNode([&](const Node& node) {
        const bool stays = node.id() == root || node.is(x3d::FetchedFile::type) || scene.isHeld(node.id()) ||
                           (node.id().value < kept.size() && kept[node.id().value]);
        if (!stays) gone.push_back(node.id());
    });
    for (const NodeId id : gone) (void)scene.destroyNode(id);  // a script's shutdown() may have been before us
    return {};
}

void countWorld(Scene& scene) {
    const std::int32_t before = scene.node(scene.root()).get(Root::_world);
    setHidden(scene, scene.root(), Root::_world.index, Value(before + 1));
}

}  // namespace

// ---- pieces --------------------------------------------------------------------------------------------------------

NodeId Fragment::find(std::string_view name) const {
    const auto found =
        std::ranges::lower_bound(names, name, {}, [](const auto& one) { return std::string_view(one.first); });
    return found == names.end() || found->first != name ? NodeId{} : found->second;
}

std::optional<Fragment> createX3DFromString(Scene& scene, std::string_view text, Diagnostics& diagnostics,
                                            const LoadOptions& options) {
    BuildOptions build = buildOptions(options, Resources());
    build.detached = true;
    SceneBuilder builder(scene, diagnostics, build);
    const FieldTypesInScope known(fieldTypesOf(scene));
    const bool complete = readDocument(
        text, builder, diagnostics,
        {.progress = options.progress, .threads = options.threads, .headerless = true, .dialect = dialectOf(scene)});
    builder.finish();
    return fragmentOf(builder, complete);
}

std::optional<Fragment> createX3DFromStream(Scene& scene, std::istream& stream, Diagnostics& diagnostics,
                                            const LoadOptions& options) {
    const std::string text(std::istreambuf_iterator<char>(stream), {});
    if (stream.bad()) {
        diagnostics.error({}, "the stream ended with an error");
        return std::nullopt;
    }
    return createX3DFromString(scene, text, diagnostics, options);
}

std::optional<Fragment> createX3DFromFile(Scene& scene, const std::filesystem::path& file, Diagnostics& diagnostics,
                                          const LoadOptions& options) {
    if (diagnostics.file().empty()) diagnostics.setFile(file.string());
    BuildOptions build = buildOptions(options, Resources::ofFile(file));
    build.detached = true;
    build.file = file;
    (void)startAtAnswer(build);
    SceneBuilder builder(scene, diagnostics, build);
    const bool complete = readDocumentFile(file, builder, diagnostics,
                                           {.progress = options.progress,
                                            .threads = options.threads,
                                            .clip = options.clip,
                                            .dialect = dialectOf(scene),
                                            .resources = &*build.resources});
    builder.finish();
    return fragmentOf(builder, complete);
}

// ---- worlds --------------------------------------------------------------------------------------------------------

Result<> replaceWorld(Scene& scene, const Fragment& piece) {
    if (scene.isInFrame()) return fail(kFromWithin, "another world can only come between two frames");
    std::vector<NodeId> all = piece.roots;
    for (const auto& [name, id] : piece.names) all.push_back(id);
    for (const NodeId id : all)
        if (!scene.find(id)) return fail(DiagnosticCode("no-such-node"), fmt::format("no node {}", id.value));
    if (auto ok = clear(scene, below(scene, all)); !ok) return ok;
    appendHead(scene, piece.head);
    for (const NodeId id : piece.roots)
        if (auto ok = scene.insertChild(scene.root(), Root::children, id); !ok) return ok;
    for (const auto& [name, id] : piece.names)
        if (auto ok = scene.setName(id, name); !ok) return ok;
    countWorld(scene);
    return {};
}

bool loadWorld(Scene& scene, const std::filesystem::path& file, Diagnostics& diagnostics, const LoadOptions& options) {
    if (scene.isInFrame()) {
        diagnostics.error({}, "another world can only come between two frames", kFromWithin);
        return false;
    }
    if (diagnostics.file().empty()) diagnostics.setFile(file == "-" ? "<stdin>" : file.string());
    BuildOptions build = buildOptions(options, Resources::ofFile(file));
    if (file != "-") build.file = file;
    const std::string address = startAtAnswer(build);
    const ResourcePolicy& policy = build.resources->policy();
    ReadOptions reading{options.progress, options.threads};
    CommandList::Limits limits;
    if (options.namedByUrl) {
        reading.maximumBytes = policy.maximumBytes;
        limits = {policy.maximumNodes, policy.maximumBytes};
    }
    CommandList commands(limits);
    const std::size_t errors = diagnostics.errors();
    reading.clip = options.clip;
    reading.dialect = dialectOf(scene);
    reading.resources = &*build.resources;
    const bool complete = readDocumentFile(file, commands, diagnostics, reading);
    if (commands.isFull()) diagnostics.error(commands.fullAt(), whyFull(commands, policy));
    // A document without nodes is a world, too, but for one that is no document.
    if (commands.firstNodeType().empty() && (!complete || diagnostics.errors() > errors)) return false;
    if (auto ok = clear(scene, {}); !ok) {
        diagnostics.add(std::move(ok.error()));
        return false;
    }
    setHidden(scene, scene.root(), Root::loadedUrl.index, Value(String(address)));
    scene.setScriptResources(std::make_shared<const Resources>(*build.resources), true);
    SceneBuilder builder(scene, diagnostics, build);
    commands.replay(builder);
    builder.finish();
    countWorld(scene);
    return true;
}

Result<> saveWorld(const Scene& scene, const std::filesystem::path& file, Diagnostics& diagnostics, Existing existing) {
    Encoding encoding = Encoding::classicVrml;
    bool gzip = false;
    const auto dialect = dialectOf(scene);
    if (file != "-" && !encodingFromName(file, encoding, gzip) && !checkDocumentName(file, dialect.get()))
        return fail(
            fmt::format("{}: the name says nothing about the encoding (.x3d, .x3dv, .wrl, .json; z or .gz "
                        "behind it for gzip)",
                        file.string()));
    auto writer = DocumentFileWriter::create(file, diagnostics, existing, encoding, dialect);
    if (!writer) return std::unexpected(std::move(writer.error()));
    SceneExporter(scene, diagnostics).write((*writer)->handler(), encoding);
    return (*writer)->close();
}

// ---- what a world says of itself -----------------------------------------------------------------------------------

DocumentInfo documentInfo(const Scene& scene) {
    const Node& root = scene.node(scene.root());
    DocumentInfo result{headOf(scene), {}, {}, {}, {}};
    const Array<String>&imports = root.get(Root::imports), &exports = root.get(Root::exports);
    for (std::size_t i = 0; i + 2 < imports.size(); i += 3)
        result.imports.push_back({imports[i].str(), imports[i + 1].str(), imports[i + 2].str()});
    for (std::size_t i = 0; i + 1 < exports.size(); i += 2)
        result.exports.push_back({exports[i].str(), exports[i + 1].str()});
    for (const NodeType* type : declaredTypes(scene))
        (type->kind == NodeType::Kind::proto ? result.prototypes : result.externPrototypes)
            .emplace_back(declaredName(*type));
    return result;
}

}  // namespace rtsg
