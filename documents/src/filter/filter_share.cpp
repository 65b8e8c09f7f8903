// Finds nodes that are equal except for their names, and uses the first one in place of the others.
#include <algorithm>
#include <map>
#include <string>
#include <unordered_map>
#include <unordered_set>

#include <rtsg/core/field_text.h>

#include "commands/document_tree.h"
#include "filter_parts.h"

namespace rtsg::detail {

namespace {

class ShareNodes final : public TreeFilter {
  public:
    using TreeFilter::TreeFilter;

    void change() override {
        uses_ = usesIn(0);
        classify();
        // Which of two nodes of one name a USE means depends on where it stands: such documents stay as they are.
        if (!doubled_) replace();
    }

  private:
    static constexpr std::uint32_t kAlone = 0;  // equal to nothing

    /// Nodes that do nothing by themselves, and that no view is bound to.
    bool isPlain(const Item& item) const {
        const NodeType* type = protos_.contains(item.name) ? nullptr : findBuiltinType(item.name);
        return type && !type->internal && type->acts == Acts::never && !type->isA("X3DBindableNode") &&
               !type->isA("X3DSensorNode") && type->name != "Inline" && !item.items.empty();
    }
    bool isLinked(const Item& item) const {
        const auto found = uses_.find(item.def);
        return !item.def.empty() && found != uses_.end() && found->second.linked;
    }
    bool isUsed(const Item& item) const { return !item.def.empty() && uses_.contains(item.def); }

    /// Numbers the nodes so that equal ones have the same number, from the inside outwards.
    void classify() {
        classes_.assign(size(), kAlone);
        std::unordered_map<std::string, std::uint32_t> known;
        walk(
            0,
            [&](Index index) {
                const Item& item = (*this)[index];
                if (item.kind == Kind::proto || item.kind == Kind::externProto) protos_.insert(item.name);
                if (item.kind == Kind::node && !item.def.empty() && !taken_.insert(item.def).second) doubled_ = true;
                return item.kind == Kind::node || index == 0;
            },
            [&](Index index) {
                const Item& item = (*this)[index];
                if (item.kind != Kind::node || !isPlain(item) || isLinked(item)) return;
                if (const std::string key = keyOf(item); !key.empty())
                    classes_[index] =
                        known.try_emplace(key, static_cast<std::uint32_t>(known.size() + 1)).first->second;
            });
    }
    /// Empty for a node that has something in it that is like no other.
    std::string keyOf(const Item& item) const {
        std::vector<std::string> parts;
        for (const Index index : item.items) {
            const Item& in = (*this)[index];
            if (in.kind == Kind::value)
                parts.push_back("v" + in.field + "=" + printFieldText(*in.value));
            else if (in.kind == Kind::use)
                parts.push_back("u" + in.field + "=" + in.def);
            else if (in.kind == Kind::node && classes_[index] != kAlone && !isUsed(in))
                parts.push_back("n" + in.field + "=" + std::to_string(classes_[index]));
            else if (in.kind != Kind::comment)
                return {};
        }
        std::string key = item.name;
        for (const std::string& part : parts) key += "\n" + part;
        return key;
    }
    void replace() {
        std::unordered_map<std::uint32_t, Index> first;
        std::unordered_map<std::string, std::string> now;  // names of nodes that are replaced
        walk(
            0,
            [&](Index index) {
                Item& item = (*this)[index];
                if (const auto other = now.find(item.def); other != now.end() && item.kind == Kind::use)
                    item.def = other->second;
                if (item.kind != Kind::node) return index == 0;
                if (classes_[index] == kAlone) return true;
                const auto [found, isNew] = first.try_emplace(classes_[index], index);
                if (isNew) return true;
                Item& original = (*this)[found->second];
                if (original.def.empty()) original.def = freshName();
                if (!item.def.empty()) now.insert_or_assign(item.def, original.def);
                Item use{.kind = Kind::use, .where = item.where, .end = item.end};
                use.def = original.def;
                use.field = item.field;
                item = std::move(use);
                return false;
            },
            [](Index) {});
    }
    std::string freshName() {
        std::string name;
        do {
            name = "shared" + std::to_string(++count_);
        } while (!taken_.insert(name).second);
        return name;
    }

    std::unordered_map<std::string, Uses> uses_;
    std::unordered_set<std::string> protos_, taken_;
    std::vector<std::uint32_t> classes_;
    bool doubled_ = false;  // two nodes have one name
    std::size_t count_ = 0;
};

}  // namespace

FilterPtr makeShareNodes(DocumentHandler& next) {
    return std::make_unique<ShareNodes>(next);
}

}  // namespace rtsg::detail
