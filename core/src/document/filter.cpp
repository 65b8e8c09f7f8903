// The filters that `rtsg convert --filter` names: each passes a document's commands on, changed.
#include <rtsg/core/filter.h>

#include <unordered_map>
#include <unordered_set>

#include "filter_parts.h"

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

namespace {

/// Leaves out whole nodes, what is in them, and what refers to them by name. A DEF that occurs first inside one that is
/// left out is lost with it; its USEs are left out too.
class DropNodes : public Filter {
  public:
    using Filter::Filter;

    virtual bool drops(std::string_view type) const = 0;

    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) final {
        if (inside_ || drops(type)) {
            ++inside_;
            if (!def.empty()) names_.back().emplace(def);
            return;
        }
        if (!def.empty()) names_.back().erase(std::string(def));
        Filter::beginNode(type, def, field, where);
    }
    void endNode(SourceLocation where) final {
        if (inside_)
            --inside_;
        else
            Filter::endNode(where);
    }
    void useNode(std::string_view def, std::string_view field, SourceLocation where) final {
        if (!inside_ && !dropped(def)) Filter::useNode(def, field, where);
    }
    void setField(std::string_view name, Value value, SourceLocation where) final {
        if (!inside_) Filter::setField(name, std::move(value), where);
    }
    void declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) final {
        if (!inside_) Filter::declareField(field, std::move(value), where);
    }
    void isConnection(std::string_view nodeField, std::string_view protoField, SourceLocation where) final {
        if (!inside_) Filter::isConnection(nodeField, protoField, where);
    }
    void beginProto(std::string_view name, SourceLocation where) final {
        if (!inside_) Filter::beginProto(name, where);
    }
    void beginProtoBody(SourceLocation where) final {
        names_.emplace_back();
        if (!inside_) Filter::beginProtoBody(where);
    }
    void endProto(SourceLocation where) final {
        names_.pop_back();
        if (!inside_) Filter::endProto(where);
    }
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) final {
        if (!inside_) Filter::externProto(name, fields, url, where);
    }
    void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode, std::string_view toField,
               SourceLocation where) final {
        if (!inside_ && !dropped(fromNode) && !dropped(toNode))
            Filter::route(fromNode, fromField, toNode, toField, where);
    }
    void importNode(std::string_view inlineDef, std::string_view exported, std::string_view local,
                    SourceLocation where) final {
        if (!inside_ && !dropped(inlineDef)) Filter::importNode(inlineDef, exported, local, where);
    }
    void exportNode(std::string_view local, std::string_view exported, SourceLocation where) final {
        if (!inside_ && !dropped(local)) Filter::exportNode(local, exported, where);
    }
    void comment(std::string_view text, SourceLocation where) final {
        if (!inside_) Filter::comment(text, where);
    }
    void documentation(const Documentation& about, SourceLocation where) final {
        if (!inside_) Filter::documentation(about, where);
    }

  private:
    bool dropped(std::string_view def) const {
        return !names_.back().empty() && names_.back().contains(std::string(def));
    }
    std::size_t inside_ = 0;
    std::vector<std::unordered_set<std::string>> names_{1};  // one set a scope
};

class DropMetadata final : public DropNodes {
  public:
    using DropNodes::DropNodes;
    void meta(std::string_view, std::string_view) override {}
    bool drops(std::string_view type) const override {
        if (type == "WorldInfo") return true;
        const NodeType* known = findBuiltinType(type);
        return known && known->isA("X3DMetadataObject");
    }
};

class DropScripts final : public DropNodes {
  public:
    using DropNodes::DropNodes;
    bool drops(std::string_view type) const override { return type == "Script"; }
};

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
        const std::string from(renamed(fromNode));  // the next call may move what the view is on
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

std::unique_ptr<DocumentHandler> makeFilter(std::string_view name, DocumentHandler& next) {
    if (name == "drop-metadata") return std::make_unique<DropMetadata>(next);
    if (name == "drop-scripts") return std::make_unique<DropScripts>(next);
    if (name == "short-names") return std::make_unique<ShortNames>(next);
    if (name == "drop-comments") return detail::makeDropComments(next);
    if (name == "drop-defaults") return detail::makeDropDefaults(next);
    if (name == "quantise-1e-3") return detail::makeQuantise(1e-3, next);
    if (name == "quantise-1e-4") return detail::makeQuantise(1e-4, next);
    if (name == "quantise-1e-5") return detail::makeQuantise(1e-5, next);
    return nullptr;
}

std::vector<std::string_view> filterNames() {
    return {"drop-comments", "drop-defaults", "drop-metadata", "drop-scripts",
            "quantise-1e-3", "quantise-1e-4", "quantise-1e-5", "short-names"};
}

}  // namespace rtsg
