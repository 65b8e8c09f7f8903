// Passes commands to a writer until one of them throws.
#include "guarded_writer.h"

#include <exception>
#include <utility>

namespace rtsg::detail {

GuardedWriter::GuardedWriter(const FormatWriter& format, TextSink sink, Diagnostics& diagnostics)
    : format_(format.name) {
    try {
        writer_ = format.make(std::move(sink), diagnostics);
        if (!writer_) noteFailure("there is none");
    } catch (const std::exception& e) {
        noteFailure(e.what());
    } catch (...) {
        noteFailure("it says not why");
    }
}

void GuardedWriter::noteFailure(std::string_view why) {
    state_ = fail("the writer of " + format_ + " files failed: " + std::string(why));
}

template <class Call>
void GuardedWriter::guard(const Call& call) {
    if (!state_) return;
    try {
        call(*writer_);
    } catch (const std::exception& e) {
        noteFailure(e.what());
    } catch (...) {
        noteFailure("it says not why");
    }
}

void GuardedWriter::beginDocument(const DocumentHeader& header) {
    guard([&](DocumentHandler& to) { to.beginDocument(header); });
}

void GuardedWriter::endDocument() {
    guard([&](DocumentHandler& to) { to.endDocument(); });
}

void GuardedWriter::component(std::string_view name, int level, SourceLocation where) {
    guard([&](DocumentHandler& to) { to.component(name, level, where); });
}

void GuardedWriter::meta(std::string_view name, std::string_view content, SourceLocation where) {
    guard([&](DocumentHandler& to) { to.meta(name, content, where); });
}

void GuardedWriter::unit(std::string_view category, std::string_view name, double conversionFactor,
                         SourceLocation where) {
    guard([&](DocumentHandler& to) { to.unit(category, name, conversionFactor, where); });
}

void GuardedWriter::beginNode(std::string_view type, std::string_view def, std::string_view field,
                              SourceLocation where) {
    guard([&](DocumentHandler& to) { to.beginNode(type, def, field, where); });
}

void GuardedWriter::endNode(SourceLocation where) {
    guard([&](DocumentHandler& to) { to.endNode(where); });
}

void GuardedWriter::useNode(std::string_view def, std::string_view field, SourceLocation where) {
    guard([&](DocumentHandler& to) { to.useNode(def, field, where); });
}

void GuardedWriter::setField(std::string_view name, Value value, SourceLocation where) {
    guard([&](DocumentHandler& to) { to.setField(name, std::move(value), where); });
}

void GuardedWriter::declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) {
    guard([&](DocumentHandler& to) { to.declareField(field, std::move(value), where); });
}

void GuardedWriter::isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation where) {
    guard([&](DocumentHandler& to) { to.isConnection(nodeField, protoField, where); });
}

void GuardedWriter::beginProto(std::string_view name, SourceLocation where) {
    guard([&](DocumentHandler& to) { to.beginProto(name, where); });
}

void GuardedWriter::beginProtoBody(SourceLocation where) {
    guard([&](DocumentHandler& to) { to.beginProtoBody(where); });
}

void GuardedWriter::endProto(SourceLocation where) {
    guard([&](DocumentHandler& to) { to.endProto(where); });
}

void GuardedWriter::externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                                const std::vector<std::string>& url, SourceLocation where) {
    guard([&](DocumentHandler& to) { to.externProto(name, fields, url, where); });
}

void GuardedWriter::route(std::string_view fromNode, std::string_view fromField, std::string_view toNode,
                          std::string_view toField, SourceLocation where) {
    guard([&](DocumentHandler& to) { to.route(fromNode, fromField, toNode, toField, where); });
}

void GuardedWriter::importNode(std::string_view inlineDef, std::string_view exportedName, std::string_view localName,
                               SourceLocation where) {
    guard([&](DocumentHandler& to) { to.importNode(inlineDef, exportedName, localName, where); });
}

void GuardedWriter::exportNode(std::string_view localName, std::string_view exportedName, SourceLocation where) {
    guard([&](DocumentHandler& to) { to.exportNode(localName, exportedName, where); });
}

void GuardedWriter::comment(std::string_view text, SourceLocation where) {
    guard([&](DocumentHandler& to) { to.comment(text, where); });
}

void GuardedWriter::documentation(const Documentation& about, SourceLocation where) {
    guard([&](DocumentHandler& to) { to.documentation(about, where); });
}

}  // namespace rtsg::detail
