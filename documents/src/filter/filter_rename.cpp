// Renames DEFs of a document and all that refers to them: as the user says, or to n1, n2, ... in their order.
#include <map>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "filter_parts.h"

namespace rtsg::detail {

namespace {

class Renaming : public Filter {
  public:
    using Filter::Filter;

    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override {
        Filter::beginNode(type, renamed(def), field, where);
    }
    void useNode(std::string_view def, std::string_view field, SourceLocation where) override {
        Filter::useNode(renamed(def), field, where);
    }
    void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode, std::string_view toField,
               SourceLocation where) override {
        const std::string from = renamed(fromNode);  // names get their numbers in the order of the text
        Filter::route(from, fromField, renamed(toNode), toField, where);
    }
    void importNode(std::string_view inlineDef, std::string_view exported, std::string_view local,
                    SourceLocation where) override {
        const std::string from = renamed(inlineDef);
        Filter::importNode(from, exported, renamed(local), where);
    }
    void exportNode(std::string_view local, std::string_view exported, SourceLocation where) override {
        Filter::exportNode(renamed(local), exported, where);
    }

  protected:
    virtual std::string renamed(std::string_view def) = 0;
};

/// Prototypes have names of their own, which stay.
class Rename final : public Renaming {
  public:
    Rename(DocumentHandler& next, Diagnostics& diagnostics) : Renaming(next), diagnostics_(diagnostics) {}

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
            const std::string now = renamed(def);
            const auto [known, isNew] = given_.try_emplace(now, def);
            if (!isNew && known->second != def)
                diagnostics_.warning(where,
                                     "both '" + known->second + "' and '" + std::string(def) + "' are called '" + now +
                                         "' now: what refers to that name finds the last one before it",
                                     DiagnosticCode("build"));
        }
        Renaming::beginNode(type, def, field, where);
    }
    void beginProtoBody(SourceLocation where) override {
        ++protos_;
        Filter::beginProtoBody(where);
    }
    void endProto(SourceLocation where) override {
        --protos_;
        Filter::endProto(where);
    }
    void importNode(std::string_view inlineDef, std::string_view exported, std::string_view local,
                    SourceLocation where) override {
        if (protos_ == 0) met_.emplace(local);
        Renaming::importNode(inlineDef, exported, local, where);
    }

  private:
    std::string renamed(std::string_view def) override {
        const auto found = protos_ > 0 ? names.end() : names.find(std::string(def));
        return found == names.end() ? std::string(def) : found->second;
    }
    Diagnostics& diagnostics_;
    std::size_t protos_ = 0;
    std::unordered_set<std::string> met_;                 // as the document calls them
    std::unordered_map<std::string, std::string> given_;  // by present name
};

class ShortNames final : public Renaming {
  public:
    using Renaming::Renaming;

    void beginProtoBody(SourceLocation where) override {
        names_.emplace_back();
        Filter::beginProtoBody(where);
    }
    void endProto(SourceLocation where) override {
        names_.pop_back();
        Filter::endProto(where);
    }

  private:
    std::string renamed(std::string_view def) override {
        if (def.empty()) return {};
        const auto [entry, isNew] = names_.back().try_emplace(std::string(def));
        if (isNew) entry->second = "n" + std::to_string(++count_);
        return entry->second;
    }
    std::vector<std::unordered_map<std::string, std::string>> names_{1};  // one map a scope
    std::size_t count_ = 0;
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

FilterPtr makeShortNames(DocumentHandler& next) {
    return std::make_unique<ShortNames>(next);
}

}  // namespace rtsg::detail
