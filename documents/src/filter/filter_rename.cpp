// Renames DEFs of a document and all that refers to them; prototypes have names of their own, which stay.
#include <map>
#include <string>
#include <unordered_map>
#include <unordered_set>

#include "filter_parts.h"

namespace rtsg::detail {

namespace {

class Rename final : public Filter {
  public:
    Rename(DocumentHandler& next, Diagnostics& diagnostics) : Filter(next), diagnostics_(diagnostics) {}

    std::map<std::string, std::string> names;

    void endDocument() override {
        for (const auto& [old, now] : names)
            if (!met_.contains(old))
                diagnostics_.warning({}, "rename: no node is called '" + old + "'", DiagnosticCode("build"));
        Filter::endDocument();
    }
    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override {
        if (!def.empty() && protos_ == 0) {
            met_.emplace(def);
            const std::string now(renamed(def));
            const auto [known, isNew] = given_.try_emplace(now, def);
            if (!isNew && known->second != def)
                diagnostics_.warning(where,
                                     "both '" + known->second + "' and '" + std::string(def) + "' are called '" + now +
                                         "' now: what refers to that name finds the last one before it",
                                     DiagnosticCode("build"));
        }
        Filter::beginNode(type, renamed(def), field, where);
    }
    void useNode(std::string_view def, std::string_view field, SourceLocation where) override {
        Filter::useNode(renamed(def), field, where);
    }
    void beginProtoBody(SourceLocation where) override {
        ++protos_;
        Filter::beginProtoBody(where);
    }
    void endProto(SourceLocation where) override {
        --protos_;
        Filter::endProto(where);
    }
    void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode, std::string_view toField,
               SourceLocation where) override {
        Filter::route(renamed(fromNode), fromField, renamed(toNode), toField, where);
    }
    void importNode(std::string_view inlineDef, std::string_view exported, std::string_view local,
                    SourceLocation where) override {
        if (protos_ == 0) met_.emplace(local);
        Filter::importNode(renamed(inlineDef), exported, renamed(local), where);
    }
    void exportNode(std::string_view local, std::string_view exported, SourceLocation where) override {
        Filter::exportNode(renamed(local), exported, where);
    }

  private:
    std::string_view renamed(std::string_view def) const {
        if (protos_ > 0) return def;
        const auto found = names.find(std::string(def));
        return found == names.end() ? def : std::string_view(found->second);
    }
    Diagnostics& diagnostics_;
    std::size_t protos_ = 0;
    std::unordered_set<std::string> met_;                 // as the document calls them
    std::unordered_map<std::string, std::string> given_;  // by present name
};

}  // namespace

Result<FilterPtr> makeRename(std::string_view pairs, DocumentHandler& next, Diagnostics& diagnostics) {
    auto filter = std::make_unique<Rename>(next, diagnostics);
    for (std::size_t from = 0; from <= pairs.size();) {
        const std::size_t end = std::min(pairs.find(',', from), pairs.size());
        const std::string_view pair = pairs.substr(from, end - from);
        const std::size_t colon = pair.find(':');
        if (colon == pair.npos || colon == 0 || colon + 1 == pair.size())
            return fail("rename=OLD:NEW,... takes pairs of names, not '" + std::string(pair) + "'");
        filter->names.insert_or_assign(std::string(pair.substr(0, colon)), std::string(pair.substr(colon + 1)));
        from = end + 1;
    }
    return filter;
}

}  // namespace rtsg::detail
