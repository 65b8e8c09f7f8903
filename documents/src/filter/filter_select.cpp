// Keeps some nodes of a document, with all that is in them, at its top.
#include <algorithm>
#include <string>
#include <unordered_map>
#include <unordered_set>

#include "commands/document_tree.h"
#include "filter_parts.h"

namespace rtsg::detail {

namespace {

class Select final : public TreeFilter {
  public:
    Select(DocumentHandler& next, Diagnostics& diagnostics) : TreeFilter(next), diagnostics_(diagnostics) {}

    std::vector<std::string> wanted;

    void change() override {
        std::vector<Index> kept, chosen;
        for (const Index index : (*this)[0].items)
            if (const Kind kind = (*this)[index].kind; kind == Kind::component || kind == Kind::meta ||
                                                       kind == Kind::unit || kind == Kind::proto ||
                                                       kind == Kind::externProto)
                kept.push_back(index);
        choose(chosen);
        if (chosen.empty())
            diagnostics_.warning({}, "no node has a name or type that is selected: the document is empty",
                                 DiagnosticCode("build"));
        else
            for (const std::string& name : wanted)
                if (!met_.contains(name))
                    diagnostics_.warning({}, "select: no node is called '" + name + "' or is of such a type",
                                         DiagnosticCode("build"));
        for (const Index index : chosen) {
            Item& item = (*this)[index];
            item.field.clear();
            completed(index);
            kept.push_back(index);
        }
        for (const Index index : routes_) {
            const Item& item = (*this)[index];
            const bool both = item.kind == Kind::route ? inside_.contains(item.def) && inside_.contains(item.other)
                                                       : inside_.contains(item.def);
            if (both) kept.push_back(index);
        }
        (*this)[0].items = std::move(kept);
    }

  private:
    bool isWanted(const Item& item) const {
        return std::ranges::any_of(wanted,
                                   [&](const std::string& name) { return name == item.def || name == item.name; });
    }
    /// The outermost nodes that are wanted; remembers where each name is.
    void choose(std::vector<Index>& chosen) {
        std::size_t within = 0;
        walk(
            0,
            [&](Index index) {
                const Item& item = (*this)[index];
                if (item.kind == Kind::proto) return false;
                if (item.kind == Kind::route || item.kind == Kind::importing || item.kind == Kind::exporting)
                    routes_.push_back(index);
                if (item.kind != Kind::node) return index == 0;
                if (!item.def.empty()) named_.insert_or_assign(item.def, index);
                met_.insert({item.def, item.name});
                if (isWanted(item) && within++ == 0) chosen.push_back(index);
                return true;
            },
            [&](Index index) {
                if ((*this)[index].kind == Kind::node && isWanted((*this)[index])) --within;
            });
    }
    /// Nodes that are used in here and stand elsewhere come in, at their first use.
    void completed(Index from) {
        std::vector<Index> waiting{from};
        while (!waiting.empty()) {
            const Index top = waiting.back();
            waiting.pop_back();
            walk(
                top,
                [&](Index index) {
                    Item& item = (*this)[index];
                    if (item.kind == Kind::node && !item.def.empty()) inside_.insert(item.def);
                    if (item.kind != Kind::use || inside_.contains(item.def)) return true;
                    const auto found = named_.find(item.def);
                    if (found == named_.end()) return true;
                    Item copy = (*this)[found->second];
                    copy.field = item.field;
                    inside_.insert(copy.def);
                    item = std::move(copy);
                    return true;
                },
                [](Index) {});
        }
    }

    Diagnostics& diagnostics_;
    std::unordered_map<std::string, Index> named_;
    std::unordered_set<std::string> inside_;  // names of nodes that are kept
    std::unordered_set<std::string> met_;     // names and types of the document
    std::vector<Index> routes_;
};

}  // namespace

Result<FilterPtr> makeSelect(std::string_view names, DocumentHandler& next, Diagnostics& diagnostics) {
    auto filter = std::make_unique<Select>(next, diagnostics);
    for (std::size_t from = 0; from <= names.size();) {
        const std::size_t end = std::min(names.find(',', from), names.size());
        if (end == from) return fail("select=NAME,... takes names of nodes or types");
        filter->wanted.emplace_back(names.substr(from, end - from));
        from = end + 1;
    }
    return filter;
}

}  // namespace rtsg::detail
