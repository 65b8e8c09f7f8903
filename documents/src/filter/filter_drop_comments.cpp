// Leaves out comments, and authors' remarks on declarations.
#include "filter_parts.h"

namespace rtsg::detail {

namespace {

class DropComments final : public Filter {
  public:
    using Filter::Filter;
    void comment(std::string_view, SourceLocation) override {}
    void documentation(const Documentation&, SourceLocation) override {}
    void declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) override {
        Filter::declareField({field.access, field.type, field.name, {}, field.custom}, std::move(value), where);
    }
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) override {
        std::vector<FieldDeclaration> bare = fields;
        for (FieldDeclaration& field : bare) field.about.reset();
        Filter::externProto(name, bare, url, where);
    }
};

}  // namespace

std::unique_ptr<DocumentHandler> makeDropComments(DocumentHandler& next) {
    return std::make_unique<DropComments>(next);
}

}  // namespace rtsg::detail
