// Inline: finding, reading and attaching other documents, at load time and while a scene runs.
// Source: ISO/IEC 19775-1 V4.0 9.4.2 (Inline), 9.2.1 (urls), 4.4.6 (import and export).
#include <algorithm>
#include <set>
#include <system_error>

#include <fmt/format.h>

#include <rtsg/core/loader.h>

#include "builder_state.h"

namespace rtsg {

namespace {

std::string percentDecoded(std::string_view text) {
    std::string result;
    const auto digit = [](char c) {
        if (c >= '0' && c <= '9') return c - '0';
        if (c >= 'a' && c <= 'f') return c - 'a' + 10;
        if (c >= 'A' && c <= 'F') return c - 'A' + 10;
        return -1;
    };
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] == '%' && i + 2 < text.size() && digit(text[i + 1]) >= 0 && digit(text[i + 2]) >= 0) {
            result += static_cast<char>(digit(text[i + 1]) * 16 + digit(text[i + 2]));
            i += 2;
        } else {
            result += text[i];
        }
    }
    return result;
}

bool isInline(const Node& node) {
    return node.type().kind == NodeType::Kind::builtin && node.type().name == "Inline";
}

bool wantsContent(const Node& node) {
    return *static_cast<const bool*>(node.storage(node.type().findExact("load")));
}

const Array<String>& urlsOf(const Node& node) {
    return *static_cast<const Array<String>*>(node.storage(node.type().findExact("url")));
}

const Array<NodeId>& contentOf(const Node& node) {
    return *static_cast<const Array<NodeId>*>(node.storage(node.type().body()));
}

}  // namespace

Result<ResolvedUrl> resolveUrl(const std::filesystem::path& base, std::string_view url) {
    const std::string_view whole = url;
    ResolvedUrl result;
    if (const std::size_t hash = url.rfind('#'); hash != std::string_view::npos) {
        result.fragment = percentDecoded(url.substr(hash + 1));
        url = url.substr(0, hash);
    }
    if (const std::size_t colon = url.find(':'); colon != std::string_view::npos && colon > 0) {
        const std::string_view scheme = url.substr(0, colon);
        const bool isScheme = std::ranges::all_of(scheme, [](char c) {
            return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '+' || c == '-' ||
                   c == '.';
        });
        if (scheme == "file") {
            url.remove_prefix(colon + 1);
            if (url.starts_with("//")) url.remove_prefix(2);
            if (url.starts_with("localhost/")) url.remove_prefix(std::string_view("localhost").size());
        } else if (isScheme && !url.substr(colon).starts_with(":\\")) {
            return fail(fmt::format("'{}' is not a local file, and nothing is fetched from a network", whole));
        }
    }
    if (url.empty()) return fail(fmt::format("'{}' names no file", whole));
    const std::filesystem::path path = percentDecoded(url);
    result.path = path.is_absolute() || base.empty() ? path : base / path;
    return result;
}

Result<LoadSession::File*> LoadSession::open(const DocumentSource& from, std::string_view url) {
    const auto resolved = resolveUrl(from.base, url);
    if (!resolved) return std::unexpected(resolved.error());
    std::error_code problem;
    const std::filesystem::path path = std::filesystem::weakly_canonical(resolved->path, problem);
    if (problem || !std::filesystem::is_regular_file(path, problem))
        return fail(fmt::format("'{}' is not there (looked for {})", url, resolved->path.string()));
    auto& file = files_[path];
    if (!file) {
        file = std::make_unique<File>();
        file->source = {path, path.parent_path(), path.string()};
        file->diagnostics.setFile(path.string());
        readDocumentFile(path, file->commands, file->diagnostics);
    }
    if (file->commands.empty()) {
        std::string why = file->diagnostics.all().empty() ? std::string() : ": " + file->diagnostics.all()[0].text;
        return fail(fmt::format("'{}' is no scene{}", url, why));
    }
    return file.get();
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
    const auto documents = std::ranges::count_if(scopes, [](const auto& one) { return one->isDocument; });
    if (documents > options.maximumDepth) {
        diagnostics.error(where, fmt::format("Inline '{}': more than {} documents within each other", urls[0].view(),
                                             options.maximumDepth));
        return false;
    }
    std::string why;
    for (const String& url : urls) {
        auto file = session.open(*scope().source, url);
        if (file && std::ranges::any_of(scopes, [&](const auto& one) {
                return one->isDocument && one->source->path == (*file)->source.path;
            }))
            file = fail(fmt::format("'{}' would contain itself", url.view()));
        if (!file) {
            why += (why.empty() ? "" : "; ") + file.error().text;
            continue;
        }
        reportFile(**file);
        NameScope& document = pushScope(id, session.newEnvironment(), &(*file)->source);
        document.isDocument = true;
        document.prefix = (*file)->source.path.stem().string() + '#';
        push(OpenNode::Kind::body, where);
        replayFile(**file);
        std::vector<NodeId> nodes;
        if (!open[openCount - 1].children.empty()) nodes = std::move(open[openCount - 1].children.front().nodes);
        pop();
        if (auto stored =
                scene.setField(id, scene.node(id).type().body(), Value(Array<NodeId>(std::span<const NodeId>(nodes))));
            !stored)
            error(where, stored.error().text);
        finishScope(document);
        popScope();
        return true;
    }
    diagnostics.error(where, fmt::format("Inline: {}", why));
    return false;
}

// ---- at run time -----------------------------------------------------------------------------------------------

struct InlineLoader::State final : Subscriber {
    State(Scene& target, Diagnostics& sink, BuildOptions buildOptions)
        : scene(target), diagnostics(sink), options(std::move(buildOptions)) {
        if (options.base.empty()) options.base = options.file.parent_path();
        scene.seal();  // what the caller loaded is not news
        attachment = scene.bus().attach(*this);
        changed.clear();
        scene.forEachNode([&](const Node& node) {
            if (!isInline(node) || contentOf(node).empty()) return;
            loaded[node.id().value] = urlsOf(node);
            if (!wantsContent(node)) changed.insert(node.id().value);
        });
    }

    Result<> apply(const Scene& source, const ChangeSet& set) override {
        for (const Change& change : set.changes) {
            if (change.kind != ChangeKind::setField) continue;
            const Node* node = source.find(change.node);
            if (!node || !isInline(*node)) continue;
            const std::string& name = node->type().fields[change.field].name;
            if (name == "load" || name == "url") changed.insert(change.node.value);
        }
        return {};
    }
    std::string subscriberName() const override { return "InlineLoader"; }

    /// Where the document of `scope` came from, found by walking the Inlines around it.
    DocumentSource sourceOf(NodeId scope) const {
        const Node* node = scene.find(scope);
        if (!node) {
            std::error_code ignored;
            std::filesystem::path path;
            if (!options.file.empty()) path = std::filesystem::weakly_canonical(options.file, ignored);
            return {path, options.base, diagnostics.file()};
        }
        DocumentSource outer = sourceOf(node->scope());
        if (!isInline(*node)) return outer;
        for (const String& url : urlsOf(*node)) {
            const auto resolved = resolveUrl(outer.base, url);
            std::error_code problem;
            if (!resolved || !std::filesystem::is_regular_file(resolved->path, problem)) continue;
            const auto path = std::filesystem::weakly_canonical(resolved->path, problem);
            return {path, path.parent_path(), path.string()};
        }
        return outer;
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
        std::set<std::uint32_t> inside{id.value};
        std::vector<NodeId> pending(contentOf(scene.node(id)).begin(), contentOf(scene.node(id)).end());
        std::vector<NodeId> gone;
        while (!pending.empty()) {
            const Node* node = scene.find(pending.back());
            pending.pop_back();
            // What the content merely refers to (a node handed to a PROTO from outside) is not its own.
            if (!node || !inside.contains(node->scope().value) || !inside.insert(node->id().value).second) continue;
            gone.push_back(node->id());
            for (const FieldIndex field : node->type().nodeFields()) {
                if (!node->type().fields[field].readable()) continue;
                if (node->type().fields[field].type == FieldType::SFNode)
                    pending.push_back(*static_cast<const NodeId*>(node->storage(field)));
                else
                    for (const NodeId child : *static_cast<const Array<NodeId>*>(node->storage(field)))
                        pending.push_back(child);
            }
        }
        const NodeType& type = scene.node(id).type();
        (void)scene.setField(id, type.body(), Value(Array<NodeId>()));
        for (const char* name : {"imports", "exports", "importRoutes"})
            if (const FieldIndex field = hiddenField(type, name); field != kNoField)
                (void)scene.setField(id, field, Value(Array<String>()));
        for (const NodeId node : gone) (void)scene.destroyNode(node);
    }

    Scene& scene;
    Diagnostics& diagnostics;
    BuildOptions options;
    std::set<std::uint32_t> changed;
    std::unordered_map<std::uint32_t, Array<String>> loaded;  // the urls that the content came from
    Attachment attachment;
};

InlineLoader::InlineLoader(Scene& scene, Diagnostics& diagnostics, BuildOptions options)
    : state_(std::make_unique<State>(scene, diagnostics, std::move(options))) {}
InlineLoader::~InlineLoader() = default;

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
        if (wanted == (current != s.loaded.end()) && (!wanted || isCurrent)) continue;
        if (current != s.loaded.end()) {
            s.unload(id);
            s.loaded.erase(value);
        }
        ++count;
        if (!wanted) continue;
        if (s.load(id)) s.loaded[value] = urlsOf(s.scene.node(id));
        // Imports from here on outwards: documents around may export the names on.
        for (NodeId scope = s.scene.node(id).scope();; scope = s.scene.node(scope).scope()) {
            connectImports(s.scene, scope, nullptr);
            if (!scope) break;
        }
    }
    return count;
}

}  // namespace rtsg
