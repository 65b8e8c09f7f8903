// Filters that leave something out: comments, values that are defaults, names that nothing refers to, metadata,
// Scripts.
#include <string>
#include <unordered_set>
#include <vector>

#include "commands/document_tree.h"
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

class DropDefaults final : public Filter {
  public:
    using Filter::Filter;

    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override {
        // A PROTO may have the name of a node of a later version; its defaults are its own.
        open_.push_back(protos_.contains(std::string(type)) ? nullptr : findBuiltinType(type));
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
        protos_.emplace(name);
        Filter::beginProto(name, where);
    }
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) override {
        protos_.emplace(name);
        Filter::externProto(name, fields, url, where);
    }

  private:
    std::vector<const NodeType*> open_;  // null: a PROTO's instance, or of unknown type
    std::unordered_set<std::string> protos_;
};

class DropNames final : public TreeFilter {
  public:
    using TreeFilter::TreeFilter;

    void change() override {
        for (const Index scope : scopes()) {
            const auto uses = usesIn(scope);
            walk(
                scope,
                [&](Index index) {
                    Item& item = (*this)[index];
                    if (item.kind == Kind::node && !uses.contains(item.def)) item.def.clear();
                    return item.kind != Kind::body || index == scope;
                },
                [](Index) {});
        }
    }
};

/// Leaves out whole nodes with their content, and everything that refers to them by name. A DEF that occurs first
/// inside one that is left out is lost with it; its USEs are left out too.
class DropNodes : public EachCommand<DropNodes> {
  public:
    explicit DropNodes(DocumentHandler& next) : next_(next) {}

    /// Whether nodes of this type go.
    virtual bool drops(std::string_view type) const = 0;

    bool isFull() const final { return next_.isFull(); }
    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) final {
        if (inside_ || drops(type)) {
            ++inside_;
            if (!def.empty()) names_.back().emplace(def);
            return;
        }
        if (!def.empty()) names_.back().erase(std::string(def));
        EachCommand::beginNode(type, def, field, where);
    }
    void endNode(SourceLocation where) final {
        if (inside_)
            --inside_;
        else
            EachCommand::endNode(where);
    }
    void useNode(std::string_view def, std::string_view field, SourceLocation where) final {
        if (!dropped(def)) EachCommand::useNode(def, field, where);
    }
    void beginProtoBody(SourceLocation where) final {
        names_.emplace_back();
        EachCommand::beginProtoBody(where);
    }
    void endProto(SourceLocation where) final {
        names_.pop_back();
        EachCommand::endProto(where);
    }
    void route(std::string_view fromNode, std::string_view fromField, std::string_view toNode, std::string_view toField,
               SourceLocation where) final {
        if (!dropped(fromNode) && !dropped(toNode)) EachCommand::route(fromNode, fromField, toNode, toField, where);
    }
    void importNode(std::string_view inlineDef, std::string_view exported, std::string_view local,
                    SourceLocation where) final {
        if (!dropped(inlineDef)) EachCommand::importNode(inlineDef, exported, local, where);
    }
    void exportNode(std::string_view local, std::string_view exported, SourceLocation where) final {
        if (!dropped(local)) EachCommand::exportNode(local, exported, where);
    }

  private:
    friend EachCommand<DropNodes>;
    template <class Call>
    void pass(const Call& call) {
        if (!inside_) call(next_);
    }
    bool dropped(std::string_view def) const {
        return !names_.back().empty() && names_.back().contains(std::string(def));
    }

    DocumentHandler& next_;
    std::size_t inside_ = 0;
    std::vector<std::unordered_set<std::string>> names_{1};  // one set a scope
};

class DropMetadata final : public DropNodes {
  public:
    using DropNodes::DropNodes;
    void meta(std::string_view, std::string_view, SourceLocation) override {}
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

}  // namespace

FilterPtr makeDropFilter(std::string_view what, DocumentHandler& next) {
    if (what == "comments") return std::make_unique<DropComments>(next);
    if (what == "defaults") return std::make_unique<DropDefaults>(next);
    if (what == "metadata") return std::make_unique<DropMetadata>(next);
    if (what == "names") return std::make_unique<DropNames>(next);
    return std::make_unique<DropScripts>(next);
}

}  // namespace rtsg::detail
