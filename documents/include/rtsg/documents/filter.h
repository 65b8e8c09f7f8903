// Filter: a document handler that passes commands on to another handler, changed or unchanged; filters form a chain
// between a reader and a writer or builder.
//
// Invariant: a filter keeps begin and end calls nested. Threading: one thread a stream. Source: RTSG paper 3.1.
#pragma once

#include <map>
#include <optional>
#include <utility>

#include <rtsg/documents/document_handler.h>

namespace rtsg {

/// Makes one call of all commands: `pass(call)` of the class Handler, where call(to) sends the command to a handler.
template <class Handler>
class EachCommand : public DocumentHandler {
  public:
    void beginDocument(const DocumentHeader& header) override {
        self().pass([&](DocumentHandler& to) { to.beginDocument(header); });
    }
    void endDocument() override {
        self().pass([&](DocumentHandler& to) { to.endDocument(); });
    }
    void component(std::string_view name, int level, SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.component(name, level, where); });
    }
    void meta(std::string_view name, std::string_view content, SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.meta(name, content, where); });
    }
    void unit(std::string_view category, std::string_view name, double conversionFactor,
              SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.unit(category, name, conversionFactor, where); });
    }
    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.beginNode(type, def, field, where); });
    }
    void endNode(SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.endNode(where); });
    }
    void useNode(std::string_view def, std::string_view field, SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.useNode(def, field, where); });
    }
    void setField(std::string_view name, Value value, SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.setField(name, std::move(value), where); });
    }
    void declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.declareField(field, std::move(value), where); });
    }
    void isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.isConnection(nodeField, protoField, where); });
    }
    void beginProto(std::string_view name, SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.beginProto(name, where); });
    }
    void beginProtoBody(SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.beginProtoBody(where); });
    }
    void endProto(SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.endProto(where); });
    }
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.externProto(name, fields, url, where); });
    }
    void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode, std::string_view toField,
               SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.route(fromNode, fromField, toNode, toField, where); });
    }
    void importNode(std::string_view inlineDef, std::string_view exportedName, std::string_view localName,
                    SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.importNode(inlineDef, exportedName, localName, where); });
    }
    void exportNode(std::string_view localName, std::string_view exportedName, SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.exportNode(localName, exportedName, where); });
    }
    void comment(std::string_view text, SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.comment(text, where); });
    }
    void documentation(const Documentation& about, SourceLocation where) override {
        self().pass([&](DocumentHandler& to) { to.documentation(about, where); });
    }

  private:
    Handler& self() { return static_cast<Handler&>(*this); }
};

/// Passes all commands on; override those that shall differ. Without a next handler it drops them, which makes it a
/// base for handlers that need a few commands only.
class Filter : public EachCommand<Filter> {
  public:
    /// `next` must outlive the filter; null drops everything.
    explicit Filter(DocumentHandler* next = nullptr) : next_(next) {}
    explicit Filter(DocumentHandler& next) : next_(&next) {}

    bool isFull() const override { return next_ && next_->isFull(); }

  private:
    friend EachCommand<Filter>;
    template <class Call>
    void pass(const Call& call) {
        if (next_) call(*next_);
    }

    DocumentHandler* next_;
};

/// Counts the commands that pass.
class CountFilter final : public Filter {
  public:
    using Filter::Filter;

    std::size_t nodes() const { return nodes_; }
    std::size_t uses() const { return uses_; }
    std::size_t routes() const { return routes_; }
    std::size_t protos() const { return protos_; }
    const std::map<std::string, std::size_t, std::less<>>& nodesByType() const { return byType_; }

    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override;
    void useNode(std::string_view def, std::string_view field, SourceLocation where) override;
    void beginProto(std::string_view name, SourceLocation where) override;
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) override;
    void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode, std::string_view toField,
               SourceLocation where) override;

  private:
    std::size_t nodes_ = 0, uses_ = 0, routes_ = 0, protos_ = 0;
    std::map<std::string, std::size_t, std::less<>> byType_;
};

}  // namespace rtsg
