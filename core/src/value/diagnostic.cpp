// Prints and collects reports, and finds the code of those that name none: that of their source file.
#include <rtsg/core/check.h>
#include <rtsg/core/diagnostic.h>

#include <cstdio>
#include <cstdlib>

namespace rtsg {

namespace {

/// Reports that name no code have that of the first row whose text is part of their source file's path.
struct FileCode {
    std::string_view path;
    DiagnosticCode code;
};
constexpr FileCode kFileCodes[] = {
    {"/core/src/text/field_text", DiagnosticCode("value-text")},
    {"/core/src/text/custom_text", DiagnosticCode("value-text")},
    {"/core/src/value/custom_field", DiagnosticCode("field-type")},
    {"/core/src/value/spec_table", DiagnosticCode("field-type")},
    {"/core/src/value/output_file", DiagnosticCode("output")},
    {"/core/src/value/read_descriptor", DiagnosticCode("file")},
    {"/core/src/value/memory", DiagnosticCode("memory")},
    {"/core/src/sandbox/", DiagnosticCode("sandbox")},
    {"/core/src/value/module", DiagnosticCode("module")},
    {"/core/src/value/geo_system", DiagnosticCode("geography")},
    {"/core/src/value/dis_pdu", DiagnosticCode("pdu")},
    {"/core/src/value/dead_reckoning", DiagnosticCode("geography")},
    {"/documents/src/read/text_feed", DiagnosticCode("build")},
    {"/documents/src/read/", DiagnosticCode("parse")},
    {"/documents/src/import/", DiagnosticCode("parse")},
    {"/documents/src/models/", DiagnosticCode("parse")},
    {"/documents/src/gltf/", DiagnosticCode("parse")},
    {"/documents/src/build/imported_nodes", DiagnosticCode("edit")},
    {"/documents/src/build/proto", DiagnosticCode("proto")},
    {"/documents/src/build/inline", DiagnosticCode("inline")},
    {"/documents/src/build/scene_exporter", DiagnosticCode("write")},
    {"/documents/src/build/scene_builder_routes", DiagnosticCode("route")},
    {"/documents/src/write/", DiagnosticCode("write")},
    {"/documents/src/", DiagnosticCode("build")},
    {"/scripts/src/", DiagnosticCode("script")},
    {"/core/src/animation/", DiagnosticCode("behaviour")},
    {"/core/src/behaviour/", DiagnosticCode("behaviour")},
    {"/core/src/sensors/", DiagnosticCode("behaviour")},
    {"/core/src/input/field_path", DiagnosticCode("build")},
    {"/core/src/state/apply", DiagnosticCode("change-set")},
    {"/core/src/cascade/input", DiagnosticCode("frame-input")},
    {"/core/src/cascade/run", DiagnosticCode("cascade")},
    {"/core/src/scene/bus", DiagnosticCode("subscriber-failed")},
    {"/core/src/scene/resource", DiagnosticCode("url")},
    {"/core/src/scene/web_address", DiagnosticCode("url")},
    {"/fetch/src/", DiagnosticCode("url")},
    {"/core/src/cascade/", DiagnosticCode("edit")},
    {"/core/src/input/", DiagnosticCode("edit")},
    {"/core/src/scene/", DiagnosticCode("edit")},
    {"/core/src/state/", DiagnosticCode("edit")},
    {"/core/src/storage/", DiagnosticCode("edit")},
    {"/renderers/geometry/src/flatten/", DiagnosticCode("instances")},
    {"/renderers/geometry/src/mesh/", DiagnosticCode("geometry")},
    {"/renderers/geometry/src/shapes/", DiagnosticCode("geometry")},
    {"/renderers/geometry/src/tessellate/", DiagnosticCode("geometry")},
    {"/renderers/world/src/world/picking", DiagnosticCode("pick")},
    {"/renderers/geometry/src/", DiagnosticCode("picture")},
    {"/renderers/world/src/", DiagnosticCode("picture")},
    {"/renderers/images/src/", DiagnosticCode("picture")},
    {"/renderers/light/src/", DiagnosticCode("picture")},
    {"/ogre/src/", DiagnosticCode("picture")},
    {"/nats/src/store/", DiagnosticCode("log")},
    {"/nats/src/", DiagnosticCode("mirror")},
    {"/audio/src/", DiagnosticCode("sound")},
    {"/sync/src/codec/", DiagnosticCode("record")},
    {"/sync/src/log/mcap", DiagnosticCode("mcap")},
    {"/sync/src/log/replay", DiagnosticCode("replay")},
    {"/sync/src/log/", DiagnosticCode("log")},
    {"/sync/src/history/", DiagnosticCode("log")},
    {"/sync/src/columns/", DiagnosticCode("record")},
    {"/sync/src/transport/keys", DiagnosticCode("keys")},
    {"/sync/src/transport/", DiagnosticCode("mirror")},
    {"/sync/src/edits/upstream", DiagnosticCode("request-refused")},
    {"/sync/src/edits/", DiagnosticCode("mirror")},
    {"/sync/src/parts/", DiagnosticCode("mirror")},
    {"/sync/src/client/", DiagnosticCode("mirror")},
    {"/sync/src/server/", DiagnosticCode("mirror")},
    {"/sync/src/sockets/", DiagnosticCode("mirror")},
    {"/feeds/src/", DiagnosticCode("feed")},
    {"/physics/src/", DiagnosticCode("physics")},
    {"/haptics/src/", DiagnosticCode("touch")},
    {"/window/src/", DiagnosticCode("window")},
    {"/dis/src/", DiagnosticCode("dis")},
    {"/plugins/src/tables/", DiagnosticCode("node-table")},
    {"/plugins/src/", DiagnosticCode("plug-in")},
    {"/session/src/viewers/foxglove", DiagnosticCode("command-line")},
    {"/session/src/viewers/", DiagnosticCode("mcap")},
    {"/session/src/outputs/output", DiagnosticCode("output")},
    {"/session/src/run/world_on_demand", DiagnosticCode("output")},
    {"/session/src/run/requests", DiagnosticCode("request-refused")},
    {"/session/src/replay/replay", DiagnosticCode("replay")},
    {"/session/", DiagnosticCode("command-line")},
    {"/app/options/files", DiagnosticCode("output")},
    {"/app/options/output", DiagnosticCode("output")},
    {"/app/logs/verb_record", DiagnosticCode("log")},
    {"/app/logs/serve_log", DiagnosticCode("log")},
    {"/app/logs/blame", DiagnosticCode("replay")},
    {"/app/logs/replay", DiagnosticCode("replay")},
    {"/app/logs/verb_replay", DiagnosticCode("replay")},
    {"/app/logs/verb_diff", DiagnosticCode("replay")},
    {"/app/options/feeds", DiagnosticCode("feed")},
    {"/app/verbs/verb_mirror", DiagnosticCode("mirror")},
    {"/app/verbs/verb_relay", DiagnosticCode("mirror")},
    {"/app/verbs/verb_serve", DiagnosticCode("mirror")},
    {"/app/", DiagnosticCode("command-line")},
};

}  // namespace

DiagnosticCode DiagnosticCode::of(std::source_location reporter) noexcept {
    const std::string_view file = reporter.file_name();
    for (const auto& [path, code] : kFileCodes)
        if (file.find(path) != file.npos || file.starts_with(path.substr(1))) return code;
    return DiagnosticCode("application");
}

void detail::checkFailed(std::string_view expression, std::string_view values, std::source_location where) noexcept {
    std::fprintf(stderr, "%s:%u: check failed: %.*s: %.*s\n", where.file_name(), static_cast<unsigned>(where.line()),
                 static_cast<int>(expression.size()), expression.data(), static_cast<int>(values.size()),
                 values.data());
    std::fflush(stderr);
    std::abort();
}

std::string Diagnostic::format() const {
    std::string result = file;
    if (where.line) {
        if (!result.empty()) result += ':';
        result += std::to_string(where.line);
        if (where.column) result += ':' + std::to_string(where.column);
    }
    if (!result.empty()) result += ": ";
    switch (severity) {
        case Severity::note:
            result += "note: ";
            break;
        case Severity::warning:
            result += "warning: ";
            break;
        case Severity::error:
            result += "error: ";
            break;
    }
    result += text;
    result += " [";
    result += code.text();
    return result + ']';
}

void Diagnostics::add(Severity severity, SourceLocation where, std::string text, DiagnosticCode code) {
    add({severity, file_, where, std::move(text), code});
}

void Diagnostics::add(Diagnostic diagnostic) {
    // A reader and the builder behind it may see the same fault.
    if (!all_.empty() && diagnostic.where.line != 0 && dropped_ == 0) {
        const Diagnostic& last = all_.back();
        if (last.where.line == diagnostic.where.line && last.where.column == diagnostic.where.column &&
            last.text == diagnostic.text && last.file == diagnostic.file)
            return;
    }
    errors_ += diagnostic.severity == Severity::error;
    warnings_ += diagnostic.severity == Severity::warning;
    if (all_.size() >= limit_)
        ++dropped_;
    else
        all_.push_back(std::move(diagnostic));
}

void Diagnostics::append(const Diagnostics& other) {
    const std::size_t count = other.all_.size();  // fixed before the loop: `other` may be this very collection
    errors_ += other.errors_;
    warnings_ += other.warnings_;
    dropped_ += other.dropped_;
    for (std::size_t i = 0; i < count; ++i) {
        if (all_.size() >= limit_) {
            ++dropped_;
            continue;
        }
        Diagnostic copy = other.all_[i];
        all_.push_back(std::move(copy));
    }
}

}  // namespace rtsg
