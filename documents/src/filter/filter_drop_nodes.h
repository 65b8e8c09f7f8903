// The base of filters that leave out nodes by their type.
//
// Threading: one thread a stream.
#pragma once

#include <string>
#include <unordered_set>
#include <vector>

#include "filter_parts.h"

namespace rtsg::detail {

/// Leaves out whole nodes with their content, and everything that refers to them by name. A DEF that occurs first
/// inside one that is left out is lost with it; its USEs are left out too.
class DropNodes : public Filter {
  public:
    using Filter::Filter;

    /// Whether nodes of this type go.
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

}  // namespace rtsg::detail
