// Tries every url of a scene's nodes.
#include <rtsg/core/web_address.h>
#include <rtsg/documents/resource_check.h>

#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

namespace rtsg {

namespace {

/// Links that somebody may follow are not part of the scene; documents that were to be loaded are the loader's.
bool isChecked(const Node& node) {
    // Nobody reads the files that a RenderedTexture is written to.
    if (node.is(x3d::Anchor::type) || node.is(x3d::RenderedTexture::type)) return false;
    if (node.is(x3d::InlineGeometry::type)) return !node.get(x3d::InlineGeometry::load);
    return !node.is(x3d::Inline::type) || !node.get(x3d::Inline::load);
}

/// Why none of the urls can be opened; empty if one can.
std::string problemOf(const Scene& scene, const Node& node, FieldIndex field, const Resources& resources) {
    std::string problem;
    for (const String& url : *static_cast<const Array<String>*>(node.storage(field))) {
        if (programInUrl(url.view())) return {};
        const auto resource = resources.open(scene, node, field, url.view());
        if (resource) return {};
        problem += (problem.empty() ? "" : "; ") + resource.error().text;
        if (node.type().isA("X3DScriptNode")) problem += hintForProgram(url.view());
    }
    return problem;
}

/// Whether the field names the stream of a sound source; this may be a file.
bool isStream(const NodeType& type, const FieldDef& field) {
    return field.name == "streamIdentifier" && type.isA("X3DSoundSourceNode");
}

bool namesFiles(std::string_view field) {
    return field == "url" || field.ends_with("Url");
}

/// Calls `visit(node, field)` for every field that names files.
void forEachUrlField(const Scene& scene, const auto& visit) {
    scene.forEachNode([&](const Node& node) {
        const NodeType& type = node.type();
        if (type.kind != NodeType::Kind::builtin && !type.isA("X3DScriptNode")) return;
        for (FieldIndex i = 0; i < type.fields.size(); ++i) {
            const FieldDef& field = type.fields[i];
            if (field.type == FieldType::MFString && (namesFiles(field.name) || isStream(type, field))) visit(node, i);
        }
    });
}

}  // namespace

namespace {

std::string keyOf(std::string_view field, const Array<String>& urls) {
    std::string key(field);
    for (const String& url : urls) key += '\n' + std::string(url.view());
    return key;
}

}  // namespace

void UrlLocations::setField(std::string_view name, Value value, SourceLocation where) {
    if (namesFiles(name) && value.holds<Array<String>>())
        locations_[keyOf(name, value.as<Array<String>>())].push_back(where);
    Filter::setField(name, std::move(value), where);
}

SourceLocation UrlLocations::next(std::string_view field, const Array<String>& urls) {
    const auto found = locations_.find(keyOf(field, urls));
    if (found == locations_.end()) return {};
    const SourceLocation where = found->second.front();
    if (found->second.size() > 1) found->second.pop_front();
    return where;
}

void checkResources(const Scene& scene, const Resources& resources, Diagnostics& diagnostics, UrlLocations* locations) {
    forEachUrlField(scene, [&](const Node& node, FieldIndex i) {
        // A stream need be no file: who listens says what cannot be read.
        if (!isChecked(node) || isStream(node.type(), node.type().fields[i])) return;
        const std::string problem = problemOf(scene, node, i, resources);
        if (problem.empty()) return;
        const std::string name(scene.name(node.id()));
        const auto& urls = *static_cast<const Array<String>*>(node.storage(i));
        const SourceLocation where = locations ? locations->next(node.type().fields[i].name, urls) : SourceLocation();
        diagnostics.warning(where, fmt::format("{}{}.{}: {}", node.type().name, name.empty() ? "" : " " + name,
                                               node.type().fields[i].name, problem));
    });
}

std::vector<std::filesystem::path> resourceFiles(const Scene& scene, const Resources& resources) {
    std::vector<std::filesystem::path> files;
    const Resources local = resources.withoutNetwork();
    forEachUrlField(scene, [&](const Node& node, FieldIndex i) {
        for (const String& url : *static_cast<const Array<String>*>(node.storage(i))) {
            if (programInUrl(url.view())) continue;
            const auto resource = local.open(scene, node, i, url.view());
            if (resource && !resource->path().empty()) files.push_back(resource->path());
        }
    });
    return files;
}

void DocumentFiles::note(std::string_view url) {
    if (programInUrl(url)) return;
    const auto resource = resources_.open(resources_.folder(), url);
    if (resource && !resource->path().empty()) files_.push_back(resource->path());
}

void DocumentFiles::note(std::string_view field, const Value& value) {
    if (!namesFiles(field) || !value.holds<Array<String>>()) return;
    for (const String& url : value.as<Array<String>>()) note(url.view());
}

void DocumentFiles::setField(std::string_view name, Value value, SourceLocation where) {
    note(name, value);
    Filter::setField(name, std::move(value), where);
}

void DocumentFiles::declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) {
    if (value) note(field.name, *value);
    Filter::declareField(field, std::move(value), where);
}

void DocumentFiles::externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                                const std::vector<std::string>& url, SourceLocation where) {
    for (const std::string& one : url) note(one);
    Filter::externProto(name, fields, url, where);
}

}  // namespace rtsg
