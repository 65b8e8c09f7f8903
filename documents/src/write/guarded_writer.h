// GuardedWriter: a writer whose exceptions end what it writes, and nothing else.
//
// Writers may come from plug-ins. Invariant: after the first exception the writer hears of nothing more, and state()
// says why. Threading: one thread a writer.
#pragma once

#include <rtsg/documents/dialect.h>

namespace rtsg::detail {

class GuardedWriter final : public DocumentHandler {
  public:
    GuardedWriter(const FormatWriter& format, TextSink sink, Diagnostics& diagnostics);
    /// The failure of the writer, if it has failed.
    const Result<>& state() const { return state_; }

    void beginDocument(const DocumentHeader& header) override;
    void endDocument() override;
    void component(std::string_view name, int level, SourceLocation where) override;
    void meta(std::string_view name, std::string_view content, SourceLocation where) override;
    void unit(std::string_view category, std::string_view name, double conversionFactor, SourceLocation where) override;
    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override;
    void endNode(SourceLocation where) override;
    void useNode(std::string_view def, std::string_view field, SourceLocation where) override;
    void setField(std::string_view name, Value value, SourceLocation where) override;
    void declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) override;
    void isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation where) override;
    void beginProto(std::string_view name, SourceLocation where) override;
    void beginProtoBody(SourceLocation where) override;
    void endProto(SourceLocation where) override;
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) override;
    void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode, std::string_view toField,
               SourceLocation where) override;
    void importNode(std::string_view inlineDef, std::string_view exportedName, std::string_view localName,
                    SourceLocation where) override;
    void exportNode(std::string_view localName, std::string_view exportedName, SourceLocation where) override;
    void comment(std::string_view text, SourceLocation where) override;
    void documentation(const Documentation& about, SourceLocation where) override;

  private:
    template <class Call>
    void guard(const Call& call);
    void noteFailure(std::string_view why);

    std::string format_;
    std::unique_ptr<DocumentHandler> writer_;
    Result<> state_;
};

}  // namespace rtsg::detail
