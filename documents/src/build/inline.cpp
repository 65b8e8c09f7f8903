// Inline: finding, reading and attaching other documents, at load time and while a scene runs; InlineGeometry likewise,
// which keeps a geometry of what it has read (inline_geometry.cpp).
// Source: ISO/IEC 19775-1 V4.0 9.4.2 (Inline), 9.2.1 (urls), 4.4.6 (import and export).
#include <algorithm>
#include <map>
#include <set>
#include <system_error>

#include <fmt/format.h>

#include <rtsg/core/web_address.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

#include "builder_state.h"
#include "inline_geometry.h"
#include "media/fetch_ahead.h"
#include "media/font_reports.h"
#include "media/load_reports.h"
#include "media/media_reports.h"
#include "media/size_reports.h"
#include "portable_materials.h"
#include "read/reader_bytes.h"

namespace rtsg {

namespace {

/// Also of a geometry alone.
bool isInline(const Node& node) {
    return node.is(x3d::Inline::type) || node.is(x3d::InlineGeometry::type);
}

bool wantsContent(const Node& node) {
    return *static_cast<const bool*>(node.storage(node.type().findExact("load")));
}

const Array<String>& urlsOf(const Node& node) {
    return *static_cast<const Array<String>*>(node.storage(node.type().findExact("url")));
}

/// A value in seconds of a field that all nodes with urls have.
double secondsOf(const Node& node, std::string_view field) {
    return static_cast<const Time*>(node.storage(node.type().findExact(field)))->seconds;
}

const Array<NodeId>& contentOf(const Node& node) {
    return *static_cast<const Array<NodeId>*>(node.storage(node.type().body()));
}

/// Whether loading its content would wait for the network.
bool awaitsContent(const Scene& scene, const Node& node, const Resources& resources) {
    return awaitsUrls(scene, node, node.type().findExact("url"), resources);
}

}  // namespace

std::string loadedUrlOf(const std::filesystem::path& opened, std::string_view url) {
    return isWebAddress(opened.native()) ? opened.string() : joinUrls({}, url);
}

Result<LoadSession::File*> LoadSession::open(const Resources& resources, const std::filesystem::path& from,
                                             std::string_view url, std::uint64_t nodesLeft,
                                             const detail::TimeLimit& time,
                                             const std::shared_ptr<const Dialect>& dialect) {
    auto resource = resources.open(from, url);
    if (!resource) return std::unexpected(resource.error());
    const auto base = resources.folderBehind(from, loadedUrlOf(resource->path(), url));
    const ResourcePolicy& policy = resources.policy();
    auto& file = files_[{resource->path().empty() ? std::string(url) : resource->path().string(), base}];
    if (!file) {
        file = std::make_unique<File>(CommandList::Limits{nodesLeft, policy.maximumBytes});
        file->source = {resource->path(), base, resource->name()};
        file->diagnostics.setFile(resource->name());
        CommandList& commands = file->commands;
        detail::readResource(*resource, policy.maximumBytes, time, detail::openBeside(resources, base), dialect,
                             commands, file->diagnostics);
        if (commands.isFull()) file->diagnostics.error(commands.fullAt(), whyFull(commands, policy));
    }
    if (!file->commands.empty()) return file.get();
    // No word of a file that is no scene is repeated, since its content is nobody's business.
    const auto& problems = file->diagnostics.all();
    const bool within = !problems.empty() && problems[0].where.line > 0;
    return fail(
        fmt::format("'{}' is no scene: {}", urlForMessage(url),
                    problems.empty() ? "there is nothing in it"
                    : within ? fmt::format("reading fails at {}:{}", problems[0].where.line, problems[0].where.column)
                             : problems[0].text));
}

LoadSession::File& LoadSession::portableMaterials() {
    auto& file = files_[{std::string(detail::kPortableUrn), {}}];
    if (!file) {
        file = std::make_unique<File>(CommandList::Limits{});
        file->source.file = detail::kPortableUrn;
        file->diagnostics.setFile(file->source.file);
        readDocument(detail::kPortableMaterials, file->commands, file->diagnostics);
    }
    return *file;
}

void SceneBuilder::State::reportFile(LoadSession::File& file) {
    if (file.reported) return;
    file.reported = true;
    diagnostics.append(file.diagnostics);
}

void SceneBuilder::State::replayFile(const LoadSession::File& file) {
    const std::size_t depth = documentDepth;
    ++documentDepth;  // its endDocument does not end ours
    file.commands.replay(handler);
    documentDepth = depth;
    if (recording) {
        error(recording->where, fmt::format("PROTO {} is never closed", recording->name));
        recording.reset();
    }
    skipDepth = skipProtoDepth = 0;
    closeOpenNodes();
}

bool SceneBuilder::State::loadInline(NodeId id, SourceLocation where) {
    if (!wantsContent(scene.node(id))) return false;
    const Array<String> urls = urlsOf(scene.node(id));
    if (urls.empty()) return false;
    noteWork(where);
    if (isOver) return false;
    if (options.leavesAwaited && awaitsContent(scene, scene.node(id), *options.resources)) return false;
    const auto documents =
        static_cast<std::uint64_t>(std::ranges::count_if(scopes, [](const auto& one) { return one->isDocument; }));
    if (const std::uint64_t limit = options.resources->policy().maximumDepth; documents > limit) {
        diagnostics.error(where,
                          fmt::format("{} '{}': more than {} documents within each other; --limit depth=N raises this",
                                      scene.node(id).type().name, urlForMessage(urls[0].view()), limit));
        return false;
    }
    std::string why;
    const auto folders = options.resources->foldersOf(scene, scene.node(id), scene.node(id).type().findExact("url"));
    for (const String& url : urls) {
        Result<LoadSession::File*> file = fail({});
        for (std::size_t i = 0; i < folders.size() && !file; ++i) {
            auto one = session.open(*options.resources, folders[i], url, nodesLeft(), time, dialect);
            if (one || i == 0) file = std::move(one);
        }
        if (file && std::ranges::any_of(scopes, [&](const auto& one) {
                return one->isDocument && !one->source->path.empty() && one->source->path == (*file)->source.path;
            }))
            file = fail(fmt::format("'{}' would contain itself", urlForMessage(url)));
        if (file) {
            fillInline(id, **file, url, where);
            return !scene.node(id).is(x3d::InlineGeometry::type) || keepGeometry(scene, id, url, diagnostics, where);
        }
        why += (why.empty() ? "" : "; ") + file.error().text;
    }
    diagnostics.error(where, fmt::format("{}: {}", scene.node(id).type().name, why));
    return false;
}

void SceneBuilder::State::fillInline(NodeId id, LoadSession::File& file, std::string_view url, SourceLocation where) {
    reportFile(file);
    setHidden(scene, id, hiddenField(scene.node(id).type(), "loadedUrl"),
              Value(String(loadedUrlOf(file.source.path, url))));
    NameScope& document = pushScope(id, session.newEnvironment(), &file.source);
    document.isDocument = true;
    document.prefix = file.source.path.stem().string() + '#';
    push(OpenNode::Kind::body, where);
    replayFile(file);
    std::vector<NodeId> nodes;
    if (!open[openCount - 1].children.empty()) nodes = std::move(open[openCount - 1].children.front().nodes);
    pop();
    const FieldIndex body = scene.node(id).type().body();
    if (auto stored = scene.setField(id, body, Value(Array<NodeId>(std::span<const NodeId>(nodes)))); !stored)
        error(where, stored.error().text);
    finishScope(document);
    popScope();
}

// ---- at run time -----------------------------------------------------------------------------------------------

struct InlineLoader::State final : Subscriber {
    State(Scene& target, Diagnostics& sink, BuildOptions buildOptions)
        : scene(target),
          diagnostics(sink),
          options(std::move(buildOptions)),
          reports(target),
          media(target),
          sizes(target),
          fonts(target),
          ahead(target) {
        options.leavesAwaited = true;
        if (!options.resources)
            options.resources = options.file.empty() ? Resources() : Resources::ofFile(options.file);
        scene.seal();  // changes by the caller's load are not news
        attachment = scene.bus().attach(*this);
        changed.clear();
        fonts = FontReports(target);
        scene.forEachNode([&](const Node& node) {
            if (!isInline(node) || contentOf(node).empty()) return;
            loaded[node.id().value] = urlsOf(node);
            watchRefresh(node);
            if (!wantsContent(node)) changed.insert(node.id().value);
        });
    }

    Result<> apply(const Scene& source, const ChangeSet& set) override {
        reports.note(source, set);
        media.note(source, set);
        sizes.note(source, set);
        fonts.note(source, set);
        ahead.note(source, set);
        for (const Change& change : set.changes) {
            if (change.kind != ChangeKind::setField) continue;
            const Node* node = source.find(change.node);
            if (!node || !isInline(*node)) continue;
            const std::string& name = node->type().fields[change.field].name;
            if (name == "load" || name == "url" || name == "solid" || name == "autoRefresh")
                changed.insert(change.node.value);
        }
        return {};
    }
    std::string subscriberName() const override { return "InlineLoader"; }

    /// The source of the document of `scope`, by the urls from which the Inlines around it were loaded.
    DocumentSource sourceOf(NodeId scope) const {
        const Node* node = scene.find(scope);
        while (node && !isInline(*node)) node = scene.find(node->scope());
        std::error_code ignored;
        if (!node) {
            std::filesystem::path path;
            if (isWebAddress(options.file.native()))
                path = options.file;
            else if (!options.file.empty())
                path = std::filesystem::weakly_canonical(options.file, ignored);
            return {path, options.resources->folder(), diagnostics.file()};
        }
        const auto& loadedUrl = *static_cast<const String*>(node->storage(hiddenField(node->type(), "loadedUrl")));
        const auto outer = options.resources->folderOf(scene, node->scope());
        // Content from the network need not be fetched again to find its folder.
        if (isWebAddress(loadedUrl.view()))
            return {loadedUrl.str(), options.resources->folderBehind(outer, loadedUrl), loadedUrl.str()};
        const auto from = options.resources->open(outer, loadedUrl);
        if (!from) return {{}, options.resources->folderBehind(outer, loadedUrl), loadedUrl.str()};
        return {from->path(), options.resources->folderBehind(outer, loadedUrl), from->name()};
    }

    bool load(NodeId id) {
        SceneBuilder builder(scene, diagnostics, options);
        SceneBuilder::State& s = *builder.state_;
        std::vector<NodeId> around;
        for (NodeId scope = scene.node(id).scope(); scope; scope = scene.node(scope).scope()) around.push_back(scope);
        std::ranges::reverse(around);
        for (const NodeId scope : around) {
            NameScope& one = s.pushScope(scope, s.session.newEnvironment(), s.session.keep(sourceOf(scope)));
            one.isDocument = isInline(scene.node(scope));
        }
        const bool done = s.loadInline(id, {});
        while (s.scopes.size() > 1) s.popScope();
        s.finished = true;
        return done;
    }

    void unload(NodeId id) {
        const std::vector<NodeId> gone = ownContent(scene, id, contentOf(scene.node(id)));
        const NodeType& type = scene.node(id).type();
        setHidden(scene, id, type.body(), Value(Array<NodeId>()));
        setHidden(scene, id, hiddenField(type, "loadedUrl"), Value(String()));
        for (const char* name : {"imports", "exports", "importRoutes"})
            if (const FieldIndex field = hiddenField(type, name); field != kNoField)
                setHidden(scene, id, field, Value(Array<String>()));
        for (const NodeId node : gone)
            if (auto ok = scene.destroyNode(node); !ok) diagnostics.error({}, ok.error().text);
    }

    /// Loads or unloads an Inline as its fields ask. Imports are then renewed from there outwards, since documents
    /// around it may export its names on.
    void fill(NodeId id) {
        if (load(id)) loaded[id.value] = urlsOf(scene.node(id));
        for (NodeId scope = scene.node(id).scope();; scope = scene.node(scope).scope()) {
            connectImports(scene, scope, nullptr);
            if (!scope) break;
        }
    }

    // ---- autoRefresh (9.2.1) -----------------------------------------------------------------------------------

    void watchRefresh(const Node& node) {
        if (secondsOf(node, "autoRefresh") > 0)
            refreshing.try_emplace(node.id().value, Refresh{scene.now(), scene.now()});
        else
            refreshing.erase(node.id().value);
    }

    /// Reads again the Inlines that are due; one that cannot be opened any more stays as it is until it can be. Returns
    /// their number.
    std::size_t refresh() {
        std::vector<NodeId> due;
        for (auto at = refreshing.begin(); at != refreshing.end();) {
            auto& [value, times] = *at;
            const Node* node = scene.find(NodeId{value});
            if (!node || scene.now() - times.first > secondsOf(*node, "autoRefreshTimeLimit")) {
                at = refreshing.erase(at);
                continue;
            }
            if (wantsContent(*node) && scene.now() - times.last >= secondsOf(*node, "autoRefresh")) {
                times.last = scene.now();
                if (canBeOpened(*node)) due.push_back(node->id());
            }
            ++at;
        }
        for (const NodeId id : due) {
            if (!scene.find(id)) continue;  // it was in another one
            if (loaded.erase(id.value) > 0) unload(id);
            fill(id);
        }
        return due.size();
    }
    bool canBeOpened(const Node& node) const {
        const FieldIndex field = node.type().findExact("url");
        return std::ranges::any_of(urlsOf(node), [&](const String& url) {
            return options.resources->open(scene, node, field, url).has_value();
        });
    }

    struct Refresh {
        double first = 0, last = 0;  // on the scene's clock
    };

    Scene& scene;
    Diagnostics& diagnostics;
    BuildOptions options;
    std::map<std::uint32_t, Refresh> refreshing;
    std::set<std::uint32_t> changed;
    std::unordered_map<std::uint32_t, Array<String>> loaded;  // the urls that the content came from
    LoadReports reports;
    MediaReports media;
    SizeReports sizes;
    FontReports fonts;
    FetchAhead ahead;
    TextMeasure measure;
    Attachment attachment;
};

InlineLoader::InlineLoader(Scene& scene, Diagnostics& diagnostics, BuildOptions options)
    : state_(std::make_unique<State>(scene, diagnostics, std::move(options))) {
    registerDocuments(scene);
}
InlineLoader::~InlineLoader() = default;

void InlineLoader::measureTexts(TextMeasure measure, Texts which) {
    state_->measure = std::move(measure);
    state_->sizes.askTexts(state_->scene, which == Texts::heard);
}

bool InlineLoader::fetchAhead() {
    state_->ahead.answer(state_->scene, *state_->options.resources);
    return state_->ahead.awaits();
}

bool InlineLoader::awaits() const {
    return !state_->changed.empty() || state_->ahead.awaits();
}

std::size_t InlineLoader::update() {
    State& s = *state_;
    std::size_t count = 0;
    for (const std::uint32_t value : std::exchange(s.changed, {})) {
        const NodeId id{value};
        const Node* node = s.scene.find(id);
        if (!node) {
            s.loaded.erase(value);
            continue;
        }
        const bool wanted = wantsContent(*node) && !urlsOf(*node).empty();
        if (!contentOf(*node).empty()) s.loaded.try_emplace(value, urlsOf(*node));  // a builder has filled it
        const auto current = s.loaded.find(value);
        const bool isCurrent = current != s.loaded.end() && current->second == urlsOf(*node);
        if (wanted == (current != s.loaded.end()) && (!wanted || isCurrent)) {
            if (node->is(x3d::InlineGeometry::type) && applyGeometryHints(s.scene, *node)) ++count;
            if (wanted) s.watchRefresh(*node);
            continue;
        }
        // The old content stays until the new one has come.
        if (wanted && awaitsContent(s.scene, *node, *s.options.resources)) {
            s.changed.insert(value);
            continue;
        }
        if (current != s.loaded.end()) {
            s.unload(id);
            s.loaded.erase(value);
        }
        ++count;
        s.refreshing.erase(value);
        if (!wanted) continue;
        s.fill(id);
        s.watchRefresh(s.scene.node(id));
    }
    count += s.refresh();
    s.ahead.answer(s.scene, *s.options.resources);
    count += s.fonts.answer(s.scene, *s.options.resources, s.diagnostics);
    count += s.sizes.answer(s.scene, *s.options.resources, s.measure);
    count += s.media.answer(s.scene, *s.options.resources, s.options.mediaLength, s.diagnostics);
    return count + s.reports.answer(s.scene, *s.options.resources);
}

}  // namespace rtsg
