// Serves requests of a running scene: makes instances of prototypes, by reading a declaration again with one instance
// after it; reads pieces and other worlds; writes nodes as text.
#include <rtsg/core/document_services.h>

#include <algorithm>
#include <optional>
#include <ranges>

#include <fmt/format.h>

#include <rtsg/core/navigation.h>
#include <rtsg/core/never_destroyed.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/scene_builder.h>
#include <rtsg/documents/scene_exporter.h>
#include <rtsg/documents/world.h>
#include <rtsg/documents/writer.h>

#include "at_address.h"
#include "builder_state.h"
#include "commands/reader_types.h"

namespace rtsg {

namespace {

/// Those of this library.
class Documents final : public DocumentServices {
  public:
    explicit Documents(std::shared_ptr<const Dialect> added = {}) : dialect(std::move(added)) {}
    const std::shared_ptr<const Dialect> dialect;

    Result<NodeId> makePrototypeInstance(Scene& scene, TypeIndex type, NodeId scope,
                                         const Resources* resources) const override;
    Result<Piece> makePiece(Scene& scene, std::string_view text, NodeId scope,
                            const Resources* resources) const override;
    Result<Piece> makePieceOfUrls(Scene& scene, NodeId script, const std::vector<std::string>& urls,
                                  const Resources* resources) const override;
    Result<> serve(Scene& scene, const DocumentRequest& request, const Resources* resources) const override;
    std::string nodeText(const Scene& scene, NodeId node, TextForm form) const override;
    std::vector<ProfileParts> profiles() const override;
    Result<> declareAs(Scene& scene, TypeIndex type, std::string_view name, const Resources* resources) const override;
    std::string_view nameNow(const NodeType& type, std::string_view before) const override {
        return detail::presentName(type, before);
    }
    NodeId localNode(const Scene& scene, NodeId scope, std::string_view name) const override {
        return resolveLocalName(scene, scope, name);
    }
};

bool mentions(std::string_view text, std::string_view word) {
    const auto isPart = [](char c) { return c > ' ' && !std::string_view("{}[]\"',#.").contains(c); };
    for (auto at = text.find(word); at != text.npos; at = text.find(word, at + 1)) {
        const std::size_t end = at + word.size();
        if ((at == 0 || !isPart(text[at - 1])) && (end == text.size() || !isPart(text[end]))) return true;
    }
    return false;
}

/// The declarations of the prototypes that `wanted` is made of, in the order in which they came.
std::string declarationsFor(const Scene& scene, const NodeType& wanted) {
    std::vector<const NodeType*> kept{&wanted};
    const std::vector<const NodeType*> declared = declaredTypes(scene);
    for (const NodeType* type : declared | std::views::reverse) {
        if (declaredName(*type) == declaredName(wanted)) continue;
        if (std::ranges::any_of(kept,
                                [&](const NodeType* user) { return mentions(user->declaration, declaredName(*type)); }))
            kept.push_back(type);
    }
    std::string text;
    for (std::size_t i = kept.size(); i-- > 1;) text += kept[i]->declaration + '\n';
    return text;
}

/// A prototype's declaration by another name.
std::string renamed(const NodeType& type, std::string_view name) {
    const std::string_view text = type.declaration;
    const std::size_t at = text.find("PROTO ") + std::string_view("PROTO ").size();
    return fmt::format("{}{}{}", text.substr(0, at), name, text.substr(at + declaredName(type).size()));
}

/// A piece that a program reads again and again has the same faults. Reported each time, they would fill the
/// diagnostics.
void appendNew(Diagnostics& to, const Diagnostics& from) {
    for (const Diagnostic& one : from.all()) {
        const bool known = std::ranges::any_of(to.all(), [&](const Diagnostic& d) {
            return d.where.line == one.where.line && d.where.column == one.where.column && d.text == one.text &&
                   d.file == one.file;
        });
        if (!known) to.add(one);
    }
}

BuildOptions detachedOptions(NodeId scope, const Resources* resources) {
    BuildOptions options;
    options.resources = resources ? *resources : Resources();
    options.detached = true;
    options.scope = scope;
    return options;
}

std::optional<std::string> firstError(const Diagnostics& diagnostics) {
    const auto first = std::ranges::find(diagnostics.all(), Severity::error, &Diagnostic::severity);
    return first == diagnostics.all().end() ? std::nullopt : std::optional(first->format());
}

}  // namespace

Result<NodeId> Documents::makePrototypeInstance(Scene& scene, TypeIndex type, NodeId scope,
                                                const Resources* resources) const {
    const NodeType& wanted = scene.type(type);
    if (wanted.declaration.empty())
        return fail(fmt::format("{} is declared inside of another prototype: it can only be made there", wanted.name));
    const std::string text = fmt::format("#X3D V4.0 utf8\n{}{}\n{} {{ }}\n", declarationsFor(scene, wanted),
                                         wanted.declaration, declaredName(wanted));
    Diagnostics diagnostics{wanted.name};
    SceneBuilder builder(scene, diagnostics, detachedOptions(scope, resources));
    const FieldTypesInScope known(fieldTypesOf(scene));
    readDocument(text, builder, diagnostics, {.dialect = dialectOf(scene)});
    builder.finish();
    if (builder.roots().size() == 1 && scene.node(builder.roots()[0]).typeIndex() == type) {
        Diagnostics errors;  // of an EXTERNPROTO that leads nowhere: its instances do nothing
        for (const Diagnostic& d : diagnostics.all())
            if (d.severity == Severity::error) errors.add(d);
        appendNew(scene.diagnostics(), errors);
        return builder.roots()[0];
    }
    for (const NodeId created : builder.roots())
        if (auto gone = scene.destroyNode(created); !gone) return std::unexpected(std::move(gone.error()));
    if (const auto why = firstError(diagnostics)) return fail(fmt::format("{} cannot be made: {}", wanted.name, *why));
    return fail(fmt::format("{} cannot be made from its declaration", wanted.name));
}

Result<> Documents::declareAs(Scene& scene, TypeIndex type, std::string_view name, const Resources* resources) const {
    const NodeType& wanted = scene.type(type);
    if (wanted.declaration.empty())
        return fail(fmt::format("{} is declared inside of another prototype, and known only there", wanted.name));
    if (scene.findType(name)) return fail(fmt::format("there is a node type {} already, which stays", name));
    constexpr std::string_view kEndsNames = " \t\r\n\"#',.[]\\{}\x7f";
    if (name.empty() || name.find_first_of(kEndsNames) != name.npos)
        return fail(fmt::format("'{}' is no name for a prototype", name));
    const std::string text =
        fmt::format("#X3D V4.0 utf8\n{}{}\n", declarationsFor(scene, wanted), renamed(wanted, name));
    Diagnostics diagnostics{std::string(name)};
    SceneBuilder builder(scene, diagnostics, detachedOptions({}, resources));
    const FieldTypesInScope known(fieldTypesOf(scene));
    readDocument(text, builder, diagnostics, {.dialect = dialectOf(scene)});
    builder.finish();
    if (scene.findType(name)) return {};
    return fail(firstError(diagnostics).value_or(fmt::format("{} is no name for a prototype", name)));
}

// ---- pieces --------------------------------------------------------------------------------------------------------

namespace {

/// If nothing usable was read, the first error is the reason for the failure; otherwise all diagnostics go to the
/// scene.
Result<DocumentServices::Piece> pieceOf(Scene& scene, const SceneBuilder& builder, bool complete,
                                        const Diagnostics& diagnostics) {
    if (!complete && builder.roots().empty()) {
        return fail(firstError(diagnostics).value_or("nothing usable is in it"));
    }
    appendNew(scene.diagnostics(), diagnostics);
    return DocumentServices::Piece{builder.roots(), builder.names()};
}

struct OpenedFile {
    std::filesystem::path file;
    std::string fragment;
};
/// The first url that leads to a file which may be read.
Result<OpenedFile> openFirst(const Scene& scene, NodeId script, const std::vector<std::string>& urls,
                             const Resources& resources) {
    std::string why;
    const Node* node = scene.find(script);
    for (const std::string& url : urls) {
        const auto opened = resources.open(resources.folderOf(scene, node ? node->scope() : NodeId{}), url);
        if (opened && !opened->path().empty()) return OpenedFile{opened->path(), opened->fragment()};
        why += (why.empty() ? "" : "; ") + (opened ? "only files can be loaded" : opened.error().text);
    }
    return fail(why.empty() ? "there is no url" : why);
}

}  // namespace

Result<DocumentServices::Piece> Documents::makePiece(Scene& scene, std::string_view text, NodeId scope,
                                                     const Resources* resources) const {
    Diagnostics diagnostics{"text"};
    SceneBuilder builder(scene, diagnostics, detachedOptions(scope, resources));
    const FieldTypesInScope known(fieldTypesOf(scene));
    const bool complete = readDocument(text, builder, diagnostics, {.headerless = true, .dialect = dialectOf(scene)});
    builder.finish();
    return pieceOf(scene, builder, complete, diagnostics);
}

Result<DocumentServices::Piece> Documents::makePieceOfUrls(Scene& scene, NodeId script,
                                                           const std::vector<std::string>& urls,
                                                           const Resources* resources) const {
    if (!resources) return fail("this scene may open no files");
    const auto opened = openFirst(scene, script, urls, *resources);
    if (!opened) return std::unexpected(opened.error());
    Diagnostics diagnostics{opened->file.string()};
    // Its own urls start from its own folder; the permissions stay the same.
    const Resources beside(folderOfDocument(opened->file), resources->policy());
    const Node* node = scene.find(script);
    BuildOptions options = detachedOptions(node ? node->scope() : NodeId{}, &beside);
    options.file = opened->file;
    options.namedByUrl = true;
    SceneBuilder builder(scene, diagnostics, options);
    const bool complete = readDocumentFile(
        opened->file, builder, diagnostics,
        {.maximumBytes = resources->policy().maximumBytes, .dialect = dialectOf(scene), .resources = resources});
    builder.finish();
    return pieceOf(scene, builder, complete, diagnostics);
}

// ---- between frames ------------------------------------------------------------------------------------------------

namespace {

Result<> serveWorld(Scene& scene, const DocumentRequest& request, const Resources* resources) {
    // `#Name` alone is a viewpoint of this world.
    for (const std::string& url : request.urls) {
        if (!url.starts_with('#')) continue;
        const Node* view = scene.find(resolveLocalName(scene, {}, std::string_view(url).substr(1)));
        const FieldIndex bind = view ? view->type().findExact("set_bind") : kNoField;
        if (bind == kNoField) return fail(fmt::format("no viewpoint is named {}", url.substr(1)));
        return scene.sendEvent(view->id(), bind, Value(true));
    }
    if (!resources) return fail("this scene may open no files");
    const auto opened = openFirst(scene, request.script, request.urls, *resources);
    if (!opened) return std::unexpected(opened.error());
    LoadOptions options;
    options.resources = Resources(folderOfDocument(opened->file), resources->policy());
    options.namedByUrl = true;
    Diagnostics diagnostics{opened->file.string()};
    const bool loaded = loadWorld(scene, opened->file, diagnostics, options);
    scene.diagnostics().append(diagnostics);
    if (!loaded) return fail(fmt::format("{} holds no world; this one stays", urlForMessage(opened->file.string())));
    if (opened->fragment.empty()) return {};
    DocumentRequest view = request;
    view.urls = {'#' + opened->fragment};
    return serveWorld(scene, view, resources);
}

}  // namespace

Result<> Documents::serve(Scene& scene, const DocumentRequest& request, const Resources* resources) const {
    switch (request.kind) {
        case DocumentRequest::Kind::piece: {
            auto piece = makePieceOfUrls(scene, request.script, request.urls, resources);
            if (!piece) return std::unexpected(std::move(piece.error()));
            return scene.sendEvent(request.target, request.field,
                                   Value(Array<NodeId>(std::span<const NodeId>(piece->roots))));
        }
        case DocumentRequest::Kind::world:
            return serveWorld(scene, request, resources);
        case DocumentRequest::Kind::replacement:
            return replaceWorld(scene, Fragment{request.nodes, {}, request.names});
    }
    return {};
}

// ---- nodes as text -------------------------------------------------------------------------------------------------

std::string Documents::nodeText(const Scene& scene, NodeId node, TextForm form) const {
    std::string text;
    Diagnostics ignored;
    const Encoding encoding = form == TextForm::xml    ? Encoding::xml
                              : form == TextForm::json ? Encoding::json
                                                       : Encoding::classicVrml;
    const auto writer = makeWriter(encoding, [&](std::string_view piece) { text += piece; }, ignored);
    SceneExporter exporter(scene, ignored);
    if (node == scene.root()) {
        exporter.write(*writer, encoding);
        return text;
    }
    exporter.writeNode(*writer, node, encoding);
    // Without the frame of a file: in ClassicVRML a line with its version and one with its profile, in JSON two objects
    // around the list of nodes.
    const std::string_view start = form == TextForm::xml ? "<Scene" : form == TextForm::json ? "-children" : "PROFILE ";
    std::size_t from = text.find(start);
    if (from != text.npos) from = text.find(form == TextForm::json ? '[' : '\n', from) + 1;
    const std::size_t to = form == TextForm::xml    ? text.find("</Scene")
                           : form == TextForm::json ? text.rfind(']')
                                                    : text.size();
    if (from == text.npos || to == text.npos || from >= to) return {};
    const std::string_view inside = std::string_view(text).substr(from, to - from);
    const std::size_t first = inside.find_first_not_of(" \n"), last = inside.find_last_not_of(" \n");
    return first == inside.npos ? std::string() : std::string(inside.substr(first, last + 1 - first));
}

std::vector<DocumentServices::ProfileParts> Documents::profiles() const {
    std::vector<ProfileParts> all;
    for (const Profile& profile : supportedProfiles()) {
        ProfileParts& one = all.emplace_back(profile.name);
        for (const auto& component : profile.components) one.components.emplace_back(component.name, component.level);
    }
    return all;
}

// --------------------------------------------------------------------------------------------------------------------

void registerDocuments(Scene& scene) {
    static const auto& documents = neverDestroyed([] { return std::make_shared<const Documents>(); });
    if (!dynamic_cast<const Documents*>(&scene.documents())) scene.setDocuments(documents);
}

void registerDocuments(Scene& scene, std::shared_ptr<const Dialect> dialect) {
    scene.setDocuments(std::make_shared<const Documents>(std::move(dialect)));
}

std::shared_ptr<const Dialect> dialectOf(const Scene& scene) {
    const auto* documents = dynamic_cast<const Documents*>(&scene.documents());
    std::shared_ptr<const Dialect> registered = documents ? documents->dialect : nullptr;
    std::shared_ptr<Dialect> more;
    for (std::size_t i = builtinTypes().size(); i < scene.typeCount(); ++i) {
        const NodeType& type = scene.type(TypeIndex{static_cast<std::uint16_t>(i)});
        if (type.kind != NodeType::Kind::user || (registered && registered->findType(type.name))) continue;
        if (!more) more = registered ? std::make_shared<Dialect>(*registered) : std::make_shared<Dialect>();
        (void)more->add(std::shared_ptr<const NodeType>(std::shared_ptr<void>(), &type));  // the scene keeps it
    }
    return more ? more : registered;
}

}  // namespace rtsg
