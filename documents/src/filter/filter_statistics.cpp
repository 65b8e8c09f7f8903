// Counts the content of a document, and reports it at the end.
#include <algorithm>
#include <string>
#include <vector>

#include "commands/value_numbers.h"
#include "filter_parts.h"

namespace rtsg::detail {

namespace {

class Statistics final : public Filter {
  public:
    Statistics(DocumentHandler& next, Diagnostics& diagnostics)
        : Filter(next), count_(nullptr), diagnostics_(diagnostics) {}

    void endDocument() override {
        Filter::endDocument();
        std::vector<std::pair<std::size_t, std::string>> types;
        for (const auto& [type, n] : count_.nodesByType()) types.emplace_back(n, type);
        std::ranges::sort(types, [](const auto& a, const auto& b) {
            return a.first != b.first ? a.first > b.first : a.second < b.second;
        });
        std::string text = number(count_.nodes(), "node") + " of " + number(types.size(), "type") + ", " +
                           number(names_, "name") + ", " + number(count_.uses(), "USE") + ", " +
                           number(count_.routes(), "route") + ", " + number(count_.protos(), "prototype") + ", depth " +
                           std::to_string(deepest_) + "; " + number(values_, "value") + " with " +
                           number(elements_, "element") + " in lists, the longest " + std::to_string(longest_);
        for (const char* separator = ": "; const auto& [n, type] : types) {
            text += separator + std::to_string(n) + " " + type;
            separator = ", ";
        }
        diagnostics_.add(Severity::note, {}, text, DiagnosticCode("statistics"));
    }
    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override {
        count_.beginNode(type, def, field, where);
        if (!def.empty()) ++names_;
        deepest_ = std::max(deepest_, ++depth_);
        Filter::beginNode(type, def, field, where);
    }
    void endNode(SourceLocation where) override {
        --depth_;
        Filter::endNode(where);
    }
    void useNode(std::string_view def, std::string_view field, SourceLocation where) override {
        count_.useNode(def, field, where);
        Filter::useNode(def, field, where);
    }
    void setField(std::string_view name, Value value, SourceLocation where) override {
        ++values_;
        const std::size_t size = isMF(value.type()) ? elementsIn(value) : 0;
        elements_ += size;
        longest_ = std::max(longest_, size);
        Filter::setField(name, std::move(value), where);
    }
    void beginProto(std::string_view name, SourceLocation where) override {
        count_.beginProto(name, where);
        Filter::beginProto(name, where);
    }
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) override {
        count_.externProto(name, fields, url, where);
        Filter::externProto(name, fields, url, where);
    }
    void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode, std::string_view toField,
               SourceLocation where) override {
        count_.route(fromNode, fromField, toNode, toField, where);
        Filter::route(fromNode, fromField, toNode, toField, where);
    }

  private:
    static std::string number(std::size_t n, const char* what) {
        return std::to_string(n) + " " + what + (n == 1 ? "" : "s");
    }
    CountFilter count_;
    Diagnostics& diagnostics_;
    std::size_t names_ = 0, values_ = 0, elements_ = 0, longest_ = 0, depth_ = 0, deepest_ = 0;
};

}  // namespace

FilterPtr makeStatistics(DocumentHandler& next, Diagnostics& diagnostics) {
    return std::make_unique<Statistics>(next, diagnostics);
}

}  // namespace rtsg::detail
