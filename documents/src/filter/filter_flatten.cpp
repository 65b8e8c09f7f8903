// Builds a scene of a document, and passes on the nodes that replace prototypes' instances, or Inlines.
#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <string>
#include <tuple>
#include <unordered_map>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/placement.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/scene_builder.h>
#include <rtsg/documents/scene_exporter.h>

#include "build/inline_lights.h"
#include "filter_parts.h"
#include "import/import.h"

namespace rtsg::detail {

namespace {

BuildOptions buildOptions(const FilterContext& context, bool loadInlines) {
    BuildOptions options;
    options.file = context.file;
    options.resources = context.resources ? *context.resources : Resources::ofFile(context.file);
    options.loadInlines = loadInlines;
    return options;
}

/// Adds the version of X3D, which the scene does not keep.
class WithVersion final : public Filter {
  public:
    WithVersion(DocumentHandler& next, std::string version) : Filter(next), version_(std::move(version)) {}
    void beginDocument(const DocumentHeader& header) override {
        DocumentHeader own = header;
        // A later version has all that an earlier one has; VRML97's nodes are X3D's.
        if (version_.starts_with('3') || version_.starts_with('4')) own.version = version_;
        Filter::beginDocument(own);
    }

  private:
    const std::string version_;
};

Scene& knowing(Scene& scene, const std::shared_ptr<const Dialect>& dialect) {
    if (dialect) registerDocuments(scene, dialect);
    return scene;
}

struct SceneOfDocument {
    Scene scene;
    SceneBuilder builder;
    SceneOfDocument(const FilterContext& context, bool loadInlines)
        : builder(knowing(scene, context.dialect), context.diagnostics, buildOptions(context, loadInlines)) {}
};

/// 7.2.2: nothing in an Inline is bound by itself. Warns of each kind of bindable node whose first one now comes from a
/// former Inline. `places` are those of the document's own Inlines, in their order.
void reportOfBinding(const Scene& scene, const std::vector<SourceLocation>& locations, Diagnostics& diagnostics) {
    struct First {
        const Node* node = nullptr;
        SourceLocation where;  // of the node, or of the document's Inline that it comes from
    };
    constexpr std::array<std::string_view, 4> kinds = {"X3DViewpointNode", "X3DBackgroundNode", "NavigationInfo",
                                                       "Fog"};
    std::array<First, kinds.size()> firsts;
    std::unordered_map<std::uint32_t, SourceLocation> inlines;
    scene.forEachNode([&](const Node& node) {
        if (node.is(x3d::Inline::type) && !node.scope() && inlines.size() < locations.size())
            inlines.emplace(node.id().value, locations[inlines.size()]);
    });
    scene.forEachNode([&](const Node& node) {
        const auto kind = std::ranges::find_if(kinds, [&](std::string_view one) { return node.type().isA(one); });
        if (kind == kinds.end() || node.type().kind != NodeType::Kind::builtin) return;
        SourceLocation where = scene.locationOf(node.id()).where;
        const Node* outermost = &node;
        while (outermost->scope()) outermost = &scene.node(outermost->scope());
        if (isInlined(scene, node)) {
            const auto found = inlines.find(outermost->id().value);
            if (found == inlines.end()) return;
            where = found->second;
        } else if (outermost != &node) {
            where = scene.locationOf(outermost->id()).where;
        }
        First& first = firsts[static_cast<std::size_t>(kind - kinds.begin())];
        const auto order = [](const SourceLocation& at) { return std::tuple(at.line, at.column); };
        if (!first.node || order(where) < order(first.where)) first = {&node, where};
    });
    for (const First& first : firsts)
        if (first.node && isInlined(scene, *first.node))
            diagnostics.warning(first.where,
                                fmt::format("the {} of the Inline is bound by itself now, as the first one "
                                            "outside of Inlines is",
                                            first.node->type().name));
}

class Flatten final : private SceneOfDocument, public Filter {
  public:
    Flatten(DocumentHandler& next, const FilterContext& context, const ExportOptions& options)
        : SceneOfDocument(context, options.expandInlines),
          Filter(builder),
          next_(next),
          diagnostics_(context.diagnostics),
          options_(options) {}

    void beginDocument(const DocumentHeader& header) override {
        version_ = header.version;
        Filter::beginDocument(header);
    }
    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override {
        if (type == "Inline" && protos_ == 0) inlines_.push_back(where);
        areFiles_.push_back(type == "Inline" || type == "InlineGeometry");
        Filter::beginNode(type, def, field, where);
    }
    void endNode(SourceLocation where) override {
        if (!areFiles_.empty()) areFiles_.pop_back();
        Filter::endNode(where);
    }
    void setField(std::string_view name, Value value, SourceLocation where) override {
        const bool isOfFile = !areFiles_.empty() && areFiles_.back();
        if (options_.expandGeometries && isOfFile && name == "load") return;  // all are loaded
        Filter::setField(name, std::move(value), where);
    }
    void beginProto(std::string_view name, SourceLocation where) override {
        ++protos_;
        Filter::beginProto(name, where);
    }
    void endProto(SourceLocation where) override {
        --protos_;
        Filter::endProto(where);
    }
    void endDocument() override {
        Filter::endDocument();
        builder.finish();
        if (options_.expandInlines) {
            reportOfBinding(scene, inlines_, diagnostics_);
            keepInlineLights(scene, inlines_, diagnostics_);
        }
        WithVersion last(next_, version_);
        ExportOptions options = options_;
        options.listsVisible = version_.starts_with('3');
        SceneExporter(scene, diagnostics_, options).write(last);
    }

  private:
    DocumentHandler& next_;
    Diagnostics& diagnostics_;
    const ExportOptions options_;
    std::string version_;
    std::vector<SourceLocation> inlines_;  // of the document itself, in its order
    std::vector<bool> areFiles_;           // of the open nodes
    std::size_t protos_ = 0;
};

/// The file of a package's url, as it is named from beside the document; the url itself if there is no such package.
std::string packageUrl(const FilterContext& context, std::string_view url) {
    if (!context.resources) return std::string(url);
    for (const auto& [name, folder] : context.resources->policy().packages)
        if (const std::string start = "package://" + name + '/'; url.starts_with(start)) {
            const auto beside = std::filesystem::path(context.file).parent_path();
            std::error_code problem;
            const auto file = std::filesystem::relative(folder / url.substr(start.size()),
                                                        beside.empty() ? std::filesystem::path(".") : beside, problem);
            return problem || file.empty() ? std::string(url) : file.generic_string();
        }
    return std::string(url);
}

}  // namespace

FilterPtr makeFlattenProtos(DocumentHandler& next, const FilterContext& context) {
    return std::make_unique<Flatten>(next, context, ExportOptions{.expandPrototypes = true});
}

FilterPtr makeFlattenInlines(DocumentHandler& next, const FilterContext& context) {
    return std::make_unique<Flatten>(next, context, ExportOptions{.expandInlines = true});
}

FilterPtr makeEmbed(DocumentHandler& next, const FilterContext& context) {
    return std::make_unique<Flatten>(
        next, context,
        ExportOptions{.expandInlines = true, .expandGeometries = true, .packageUrl = [context](std::string_view url) {
                          return packageUrl(context, url);
                      }});
}

}  // namespace rtsg::detail

namespace rtsg {

bool isRobotFile(const std::filesystem::path& file) {
    constexpr std::size_t kHead = 4096;
    std::error_code problem;
    const std::uintmax_t size = std::filesystem::file_size(file, problem);
    if (problem) return file.extension() == ".urdf" || file.extension() == ".sdf";
    std::string head(kHead, '\0');
    std::ifstream in(file, std::ios::binary);
    in.read(head.data(), static_cast<std::streamsize>(head.size()));
    head.resize(static_cast<std::size_t>(in.gcount()));
    const detail::FileKind kind = detail::fileKind(head, size);
    return kind == detail::FileKind::urdf || kind == detail::FileKind::sdf;
}

}  // namespace rtsg
