// DocumentFilter: a DocumentHandler that passes everything on. Derive and override what should change on the way.
//
// Without a next handler it drops everything, which makes it a base for handlers that look at a few commands only.
// Threading: one thread a stream. Source: RTSG paper 3.1 (filters between reader and builder).
#pragma once

#include <utility>

#include <rtsg/core/document_handler.h>

namespace rtsg {

class DocumentFilter : public DocumentHandler {
  public:
    /// `next` must outlive the filter; null drops everything.
    explicit DocumentFilter(DocumentHandler* next = nullptr) : next_(next) {}

    void beginDocument(const DocumentHeader& header) override {
        if (next_) next_->beginDocument(header);
    }
    void endDocument() override {
        if (next_) next_->endDocument();
    }
    void component(std::string_view name, int level) override {
        if (next_) next_->component(name, level);
    }
    void meta(std::string_view name, std::string_view content) override {
        if (next_) next_->meta(name, content);
    }
    void unit(std::string_view category, std::string_view name, double conversionFactor) override {
        if (next_) next_->unit(category, name, conversionFactor);
    }
    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override {
        if (next_) next_->beginNode(type, def, field, where);
    }
    void endNode(SourceLocation where) override {
        if (next_) next_->endNode(where);
    }
    void useNode(std::string_view def, std::string_view field, SourceLocation where) override {
        if (next_) next_->useNode(def, field, where);
    }
    void setField(std::string_view name, Value value, SourceLocation where) override {
        if (next_) next_->setField(name, std::move(value), where);
    }
    void declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) override {
        if (next_) next_->declareField(field, std::move(value), where);
    }
    void isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation where) override {
        if (next_) next_->isConnection(nodeField, protoField, where);
    }
    void beginProto(std::string_view name, SourceLocation where) override {
        if (next_) next_->beginProto(name, where);
    }
    void beginProtoBody(SourceLocation where) override {
        if (next_) next_->beginProtoBody(where);
    }
    void endProto(SourceLocation where) override {
        if (next_) next_->endProto(where);
    }
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) override {
        if (next_) next_->externProto(name, fields, url, where);
    }
    void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode, std::string_view toField,
               SourceLocation where) override {
        if (next_) next_->route(fromNode, fromField, toNode, toField, where);
    }
    void importNode(std::string_view inlineDef, std::string_view exportedName, std::string_view localName,
                    SourceLocation where) override {
        if (next_) next_->importNode(inlineDef, exportedName, localName, where);
    }
    void exportNode(std::string_view localName, std::string_view exportedName, SourceLocation where) override {
        if (next_) next_->exportNode(localName, exportedName, where);
    }

  private:
    DocumentHandler* next_;
};

}  // namespace rtsg
