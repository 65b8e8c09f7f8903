// Leaves out values that equal their defaults.
#include "filter_parts.h"

namespace rtsg::detail {

namespace {

class DropDefaults final : public Filter {
  public:
    using Filter::Filter;

    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override {
        // A PROTO may have the name of a node of a later version; its defaults are its own.
        open_.push_back(protos_.contains(type) ? nullptr : findBuiltinType(type));
        Filter::beginNode(type, def, field, where);
    }
    void endNode(SourceLocation where) override {
        open_.pop_back();
        Filter::endNode(where);
    }
    void setField(std::string_view name, Value value, SourceLocation where) override {
        const NodeType* type = open_.empty() ? nullptr : open_.back();
        const FieldIndex index = type ? type->findExact(name) : kNoField;
        if (index != kNoField && !type->fields[index].hidden && value == type->fields[index].defaultValue) return;
        Filter::setField(name, std::move(value), where);
    }
    void beginProto(std::string_view name, SourceLocation where) override {
        protos_.emplace(name, true);
        Filter::beginProto(name, where);
    }
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) override {
        protos_.emplace(name, true);
        Filter::externProto(name, fields, url, where);
    }

  private:
    std::vector<const NodeType*> open_;  // null: a PROTO's instance, or of unknown type
    std::map<std::string, bool, std::less<>> protos_;
};

}  // namespace

std::unique_ptr<DocumentHandler> makeDropDefaults(DocumentHandler& next) {
    return std::make_unique<DropDefaults>(next);
}

}  // namespace rtsg::detail
