// Renames DEFs to n1, n2, ... in the order in which they appear.
#include <string>
#include <unordered_map>
#include <vector>

#include "filter_parts.h"

namespace rtsg::detail {

namespace {

class ShortNames final : public Filter {
  public:
    using Filter::Filter;

    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override {
        Filter::beginNode(type, renamed(def), field, where);
    }
    void useNode(std::string_view def, std::string_view field, SourceLocation where) override {
        Filter::useNode(renamed(def), field, where);
    }
    void beginProtoBody(SourceLocation where) override {
        names_.emplace_back();
        Filter::beginProtoBody(where);
    }
    void endProto(SourceLocation where) override {
        names_.pop_back();
        Filter::endProto(where);
    }
    void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode, std::string_view toField,
               SourceLocation where) override {
        const std::string from(renamed(fromNode));  // the next call may move the memory of the view
        Filter::route(from, fromField, renamed(toNode), toField, where);
    }
    void importNode(std::string_view inlineDef, std::string_view exported, std::string_view local,
                    SourceLocation where) override {
        const std::string from(renamed(inlineDef));
        Filter::importNode(from, exported, renamed(local), where);
    }
    void exportNode(std::string_view local, std::string_view exported, SourceLocation where) override {
        Filter::exportNode(renamed(local), exported, where);
    }

  private:
    std::string_view renamed(std::string_view def) {
        if (def.empty()) return def;
        const auto [entry, isNew] = names_.back().try_emplace(std::string(def));
        if (isNew) entry->second = "n" + std::to_string(++count_);
        return entry->second;
    }
    std::vector<std::unordered_map<std::string, std::string>> names_{1};  // one map a scope
    std::size_t count_ = 0;
};

}  // namespace

std::unique_ptr<DocumentHandler> makeShortNames(DocumentHandler& next) {
    return std::make_unique<ShortNames>(next);
}

}  // namespace rtsg::detail
