// Declarations of prototypes: their interfaces, where their names are visible, and the node type an instance gets.
#include "proto.h"

#include <algorithm>

namespace rtsg {

const InterfaceField* ProtoDeclaration::findField(std::string_view fieldName) const {
    constexpr std::size_t few = 8;
    if (fields.size() <= few) {
        const auto found = std::ranges::find(
            fields, fieldName, [](const InterfaceField& field) -> std::string_view { return field.declaration.name; });
        return found == fields.end() ? nullptr : &*found;
    }
    for (; named_ < fields.size(); ++named_) byName_.try_emplace(fields[named_].declaration.name, named_);
    const auto found = byName_.find(fieldName);
    return found == byName_.end() ? nullptr : &fields[found->second];
}

ProtoDeclaration* Environment::find(std::string_view name, std::size_t visible) const {
    const auto found = byName_.find(name);
    if (found != byName_.end() && found->second < visible) return declarations_[found->second].get();
    return outer_ ? outer_->find(name, outerVisible_) : nullptr;
}

ProtoDeclaration* Environment::findHere(std::string_view name) const {
    const auto found = byName_.find(name);
    return found == byName_.end() ? nullptr : declarations_[found->second].get();
}

ProtoDeclaration* Environment::add(std::unique_ptr<ProtoDeclaration> declaration) {
    byName_.emplace(declaration->name, declarations_.size());
    return declarations_.emplace_back(std::move(declaration)).get();
}

void writeDeclaration(const ProtoDeclaration& proto, DocumentHandler& handler) {
    if (proto.external) {
        std::vector<FieldDeclaration> declared;
        declared.reserve(proto.fields.size());
        for (const InterfaceField& field : proto.fields) declared.push_back(field.declaration);
        handler.externProto(proto.name, declared, proto.url, proto.where);
        return;
    }
    handler.beginProto(proto.name, proto.where);
    for (const InterfaceField& field : proto.fields) {
        handler.declareField(field.declaration, field.value, field.where);
        field.nodes.replay(handler);
    }
    handler.beginProtoBody(proto.where);
    proto.body.replay(handler);
    handler.endProto(proto.where);
}

std::shared_ptr<NodeType> makeProtoType(const ProtoDeclaration& proto, std::string name) {
    auto type = std::make_shared<NodeType>();
    type->name = std::move(name);
    type->component = "Core";
    type->kind = proto.external ? NodeType::Kind::externProto : NodeType::Kind::proto;
    type->implements = {"X3DPrototypeInstance", "X3DNode"};
    if (proto.primary) {
        // 4.4.4.3: an instance may stand wherever the first node of its body may.
        type->implements.push_back(proto.primary->name);
        for (const std::string& one : proto.primary->implements)
            if (!type->isA(one)) type->implements.push_back(one);
        type->containerField = proto.primary->containerField;
    }
    for (const InterfaceField& field : proto.fields) {
        FieldDef& def = type->fields.emplace_back();
        def.name = field.declaration.name;
        def.type = field.declaration.type;
        def.custom = field.declaration.custom;
        def.access = field.declaration.access;
        if (sf(def.type) == FieldType::SFNode) def.aspect = Aspect::structure;
        if (field.value && def.holds(*field.value) && sf(def.type) != FieldType::SFNode)
            def.defaultValue = *field.value;
    }
    const auto taken = [&](std::string_view wanted) {
        return std::ranges::find(type->fields, wanted, &FieldDef::name) != type->fields.end();
    };
    if (!taken("metadata")) {
        FieldDef& metadata = type->fields.emplace_back();
        metadata.name = "metadata";
        metadata.type = FieldType::SFNode;
        metadata.accepts = {"X3DMetadataObject"};
    }
    FieldDef& body = type->fields.emplace_back();
    body.name = "body";
    body.type = FieldType::MFNode;
    body.access = Access::initializeOnly;
    body.aspect = Aspect::structure;
    body.hidden = true;
    // Instances of an EXTERNPROTO keep the url that led to the PROTO, since the urls in its body are relative to it.
    if (proto.external && !taken("loadedUrl")) {
        FieldDef& loaded = type->fields.emplace_back();
        loaded.name = "loadedUrl";
        loaded.type = FieldType::SFString;
        loaded.access = Access::initializeOnly;
        loaded.hidden = true;
    }
    if (!type->finish()) return nullptr;
    return type;
}

bool isConnectionLegal(Access protoField, Access nodeField) {
    if (nodeField == Access::inputOutput) return true;
    return nodeField == protoField;
}

std::string_view accessName(Access access) {
    switch (access) {
        case Access::initializeOnly:
            return "initializeOnly";
        case Access::inputOnly:
            return "inputOnly";
        case Access::outputOnly:
            return "outputOnly";
        case Access::inputOutput:
            return "inputOutput";
    }
    return "";
}

}  // namespace rtsg
