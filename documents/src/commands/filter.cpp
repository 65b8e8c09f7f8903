// A handler that counts what passes.
#include <rtsg/documents/filter.h>

namespace rtsg {

void CountFilter::beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) {
    ++nodes_;
    auto found = byType_.find(type);
    if (found == byType_.end()) found = byType_.emplace(type, 0).first;
    ++found->second;
    Filter::beginNode(type, def, field, where);
}
void CountFilter::useNode(std::string_view def, std::string_view field, SourceLocation where) {
    ++uses_;
    Filter::useNode(def, field, where);
}
void CountFilter::beginProto(std::string_view name, SourceLocation where) {
    ++protos_;
    Filter::beginProto(name, where);
}
void CountFilter::externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                              const std::vector<std::string>& url, SourceLocation where) {
    ++protos_;
    Filter::externProto(name, fields, url, where);
}
void CountFilter::route(std::string_view fromNode, std::string_view fromField, std::string_view toNode,
                        std::string_view toField, SourceLocation where) {
    ++routes_;
    Filter::route(fromNode, fromField, toNode, toField, where);
}

}  // namespace rtsg
