// Sends held commands, with each connection directly after the declaration of its field.
#include "held_script.h"

#include <utility>

#include <rtsg/documents/filter.h>

namespace rtsg::detail {

namespace {

class Connector final : public Filter {
  public:
    Connector(DocumentHandler& next, const std::unordered_map<std::size_t, HeldScript::Connections>& connections)
        : Filter(next), connections_(connections) {}

    void beginNode(std::string_view type, std::string_view def, std::string_view field, SourceLocation where) override {
        const auto found = connections_.find(nodes_++);
        open_.push_back(found == connections_.end() ? nullptr : &found->second);
        Filter::beginNode(type, def, field, where);
    }
    void endNode(SourceLocation where) override {
        open_.pop_back();
        Filter::endNode(where);
    }
    void declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) override {
        const HeldScript::Connections* connections = open_.back();
        const auto found = connections ? connections->find(field.name) : HeldScript::Connections::const_iterator{};
        if (!connections || found == connections->end()) return Filter::declareField(field, std::move(value), where);
        Filter::declareField(field, std::nullopt, where);
        for (const std::string& proto : found->second) isConnection(field.name, proto, where);
    }
    void beginProto(std::string_view name, SourceLocation where) override {
        open_.push_back(nullptr);  // what its interface declares is not the Script's
        Filter::beginProto(name, where);
    }
    void endProto(SourceLocation where) override {
        open_.pop_back();
        Filter::endProto(where);
    }

  private:
    const std::unordered_map<std::size_t, HeldScript::Connections>& connections_;
    std::size_t nodes_ = 0;
    std::vector<const HeldScript::Connections*> open_;  // null where there are none
};

}  // namespace

void HeldScript::report() const {
    Connector connector(next_, connections_);
    commands_.replay(connector);
}

}  // namespace rtsg::detail
