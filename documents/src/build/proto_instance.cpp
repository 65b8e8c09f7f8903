// Prototypes in the SceneBuilder: recording declarations, making types of them, and instances of those.
// Source: ISO/IEC 19775-1 V4.0 4.4.4 (PROTO, table 4.4 for IS), 4.4.5 (EXTERNPROTO).
#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/never_destroyed.h>
#include <rtsg/documents/loader.h>

#include "builder_state.h"
#include "portable_materials.h"

namespace rtsg {

// ---- declarations ----------------------------------------------------------------------------------------------

void SceneBuilder::beginProto(std::string_view name, SourceLocation where) {
    State& s = *state_;
    s.noteWork(where);
    if (s.skipDepth) return;
    if (s.skipProtoDepth) {
        ++s.skipProtoDepth;
        return;
    }
    if (s.isRecording()) {
        if (s.recordingOpen.back() == 'i') return;
        s.recordingOpen += 'i';
        return s.recorder().beginProto(name, where);
    }
    // Prototypes within a PROTO's body were declared once, together with it.
    if (s.scope().proto && !s.scope().declarationsOnly) {
        s.skipProtoDepth = 1;
        return;
    }
    s.recording = std::make_unique<ProtoDeclaration>();
    s.recording->name = name;
    s.recording->where = where;
    s.recordingOpen = "i";
    s.recordingDefault = &s.discarded;
}

void SceneBuilder::beginProtoBody(SourceLocation where) {
    State& s = *state_;
    if (s.skipDepth || s.skipProtoDepth || !s.isRecording()) return;
    if (s.recordingOpen.back() != 'i') return;
    s.recordingOpen.back() = 'b';
    if (s.recordingOpen.size() > 1) s.recorder().beginProtoBody(where);
}

void SceneBuilder::endProto(SourceLocation where) {
    State& s = *state_;
    if (s.skipDepth) return;
    if (s.skipProtoDepth) {
        --s.skipProtoDepth;
        return;
    }
    if (!s.isRecording()) return;
    while (s.recordingOpen.back() == 'n') endNode(where);
    if (s.recordingOpen.size() > 1) {
        if (s.recordingOpen.back() == 'i') beginProtoBody(where);
        s.recordingOpen.pop_back();
        return s.recorder().endProto(where);
    }
    s.discarded = {};
    s.declare(std::move(s.recording));
}

void SceneBuilder::externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                               const std::vector<std::string>& url, SourceLocation where) {
    State& s = *state_;
    s.noteWork(where);
    if (s.skipDepth || s.skipProtoDepth) return;
    if (s.isRecording()) {
        if (s.recordingOpen.back() != 'i') s.recorder().externProto(name, fields, url, where);
        return;
    }
    if (s.scope().proto && !s.scope().declarationsOnly) return;
    auto declaration = std::make_unique<ProtoDeclaration>();
    declaration->name = name;
    declaration->where = where;
    declaration->external = true;
    declaration->url = url;
    for (const FieldDeclaration& field : fields) declaration->fields.push_back({field, {}, {}, where});
    s.declare(std::move(declaration));
}

void SceneBuilder::State::chooseDefault(std::string_view field, SourceLocation where) {
    recordingDefault = &discarded;
    for (InterfaceField& one : recording->fields)
        if (one.declaration.name == field) recordingDefault = &one.nodes;
    if (recordingDefault == &discarded) error(where, fmt::format("PROTO {} has no field '{}'", recording->name, field));
}

void SceneBuilder::State::declare(std::unique_ptr<ProtoDeclaration> declaration) {
    NameScope& in = scope();
    const char* kind = declaration->external ? "EXTERNPROTO" : "PROTO";
    if (findBuiltin(declaration->name).second) {
        error(declaration->where,
              fmt::format("{} {} has the name of a built-in node type, which stays", kind, declaration->name));
        return;
    }
    if (in.environment->findHere(declaration->name)) {
        error(declaration->where,
              fmt::format("{} {} is declared already; the first declaration stays", kind, declaration->name));
        return;
    }
    declaration->environment = in.environment;
    declaration->visible = in.environment->size();
    declaration->source = in.source;
    if (!declaration->external) {
        // Its own prototypes first: the first node of the body may be one of them.
        declaration->inside = session.newEnvironment(declaration->environment, declaration->visible);
        std::string prefix = fmt::format("{}{}#", in.prefix, declaration->name);
        NameScope& body = pushScope({}, declaration->inside, in.source);
        body.proto = declaration.get();
        body.declarationsOnly = true;
        body.prefix = std::move(prefix);
        push(OpenNode::Kind::body, declaration->where);
        if (scopes.size() < kMaximumProtoDepth)
            declaration->body.replay(handler);
        else
            error(declaration->where, "PROTO declarations nest too deeply");
        pop();
        popScope();
        const std::string_view first = declaration->body.firstNodeType();
        if (const NodeType* known = findBuiltin(first).second)
            declaration->primary = known;
        else if (const ProtoDeclaration* nested = declaration->inside->find(first))
            declaration->primary = nested->primary;
    }
    if (defineProtoType(*declaration, scope().prefix)) scope().environment->add(std::move(declaration));
}

bool SceneBuilder::State::defineProtoType(ProtoDeclaration& declaration, const std::string& prefix) {
    // Only what the document itself declares is ever saved or instanced by name.
    const std::string text = prefix.empty() ? declarationText(declaration) : std::string();
    auto type = makeProtoType(declaration, prefix + declaration.name);
    if (!type) {
        error(declaration.where, fmt::format("PROTO {} declares a field twice or too many of them", declaration.name));
        return false;
    }
    type->declaration = text;
    const auto same = [&](const NodeType& known) {
        return known.kind == type->kind && known.declaration == type->declaration &&
               std::ranges::equal(known.fields, type->fields, [](const FieldDef& a, const FieldDef& b) {
                   return a.name == b.name && haveOneType(a, b) && a.access == b.access && a.hidden == b.hidden &&
                          a.defaultValue == b.defaultValue;
               });
    };
    for (int copy = 2;; ++copy) {
        const auto known = scene.findType(type->name);
        if (!known) break;
        if (same(scene.type(*known))) {
            declaration.type = *known;
            return true;
        }
        type->name = fmt::format("{}{}#{}", prefix, declaration.name, copy);
    }
    const auto defined = scene.defineType(type);
    if (!defined) {
        error(declaration.where, defined.error().text);
        return false;
    }
    declaration.type = *defined;
    return true;
}

Environment* SceneBuilder::State::libraryOf(LoadSession::File& file) {
    if (file.prototypes) return file.prototypes;
    file.prototypes = session.newEnvironment();
    reportFile(file);
    NameScope& library = pushScope({}, file.prototypes, &file.source);
    library.isDocument = true;
    library.declarationsOnly = true;
    library.prefix = file.source.path.stem().string() + '#';
    push(OpenNode::Kind::body, {});
    replayFile(file);
    pop();
    popScope();
    return file.prototypes;
}

void SceneBuilder::State::resolveExternal(ProtoDeclaration& declaration) {
    if (declaration.resolved) return;
    declaration.resolved = true;
    std::string why;
    const auto failed = [&](const std::string& reason) { why += (why.empty() ? "" : "; ") + reason; };
    for (const std::string& url : declaration.url) {
        const auto portable = detail::portableMaterial(url);
        const Result<LoadSession::File*> file =
            portable ? &session.portableMaterials()
                     : session.open(*options.resources, declaration.source->base, url, nodesLeft(), time, dialect);
        if (!file) {
            failed(file.error().text);
            continue;
        }
        Environment* library = libraryOf(**file);
        const std::string fragment = portable ? std::string(*portable) : urlFragment(url);
        ProtoDeclaration* target =
            fragment.empty() ? (library->size() ? library->at(0) : nullptr) : library->findHere(fragment);
        // A PROTO with the name of a later version's node has been renamed by the reader.
        if (!target && !fragment.empty()) target = library->findHere(fragment + "_");
        if (!target) {
            failed(fmt::format("'{}' declares no PROTO{}{}", url, fragment.empty() ? "" : " ", fragment));
            continue;
        }
        std::string targetUrl = loadedUrlOf((*file)->source.path, url);
        if (target->external) {
            // An EXTERNPROTO that leads to an EXTERNPROTO; a circle of them ends here without a body.
            if (externDepth < kMaximumProtoDepth) {
                ++externDepth;
                resolveExternal(*target);
                --externDepth;
            }
            targetUrl = joinUrls(targetUrl, target->targetUrl);
            target = target->target;
            if (!target) {
                failed(fmt::format("'{}' leads to no PROTO", url));
                continue;
            }
        }
        declaration.target = target;
        declaration.targetUrl = std::move(targetUrl);
        declaration.primary = target->primary;
        break;
    }
    if (!declaration.target) {
        if (declaration.url.empty()) why = "it has no url";
        error(declaration.where,
              fmt::format("EXTERNPROTO {} cannot be resolved, its instances do nothing: {}", declaration.name, why));
        return;
    }
    for (const InterfaceField& field : declaration.fields) {
        const InterfaceField* other = declaration.target->findField(field.declaration.name);
        if (!other)
            error(declaration.where,
                  fmt::format("EXTERNPROTO {}: the PROTO has no field '{}'", declaration.name, field.declaration.name));
        else if (!haveOneType(other->declaration, field.declaration) ||
                 other->declaration.access != field.declaration.access)
            error(declaration.where,
                  fmt::format("EXTERNPROTO {}: field '{}' is {} {} in the PROTO", declaration.name,
                              field.declaration.name, accessName(other->declaration.access),
                              fieldTypeName(other->declaration.type, other->declaration.custom.get())));
    }
}

// ---- instances -------------------------------------------------------------------------------------------------

void SceneBuilder::State::connectInterface(OpenNode& node) {
    for (const IsRequest& request : node.connections) connect(node, request);
}

void SceneBuilder::State::connect(OpenNode& node, const IsRequest& request) {
    const NameScope& in = scope();
    const Node& instance = scene.node(in.owner);
    const auto refuse = [&](std::string why) {
        error(request.where,
              fmt::format("{}.{} IS {}: {}", node.describe(), request.nodeField, request.protoField, why));
    };
    const FieldIndex target = node.type->find(request.nodeField);
    if (target == kNoField) return refuse("the node has no such field");
    const FieldDef& def = node.type->fields[target];
    // 4.4.4.3: X3DPrototypeInstance has metadata as every node has, declared or not.
    static const auto& metadata =
        neverDestroyed([] { return InterfaceField{{Access::inputOutput, FieldType::SFNode, "metadata"}, {}, {}, {}}; });
    const InterfaceField* declared = in.proto->findField(request.protoField);
    if (!declared && request.protoField == "metadata") declared = &metadata;
    const FieldIndex source = instance.type().find(request.protoField);
    if (!declared) return refuse(fmt::format("PROTO {} has no such field", in.proto->name));
    if (!haveOneType(declared->declaration, def))
        return refuse(fmt::format("the types differ, {} and {}", def.typeName(),
                                  fieldTypeName(declared->declaration.type, declared->declaration.custom.get())));
    const Access access = declared->declaration.access;
    if (!isConnectionLegal(access, def.access))
        return refuse(
            fmt::format("{} cannot be connected with {} (table 4.4)", accessName(def.access), accessName(access)));
    const bool hasValue = access == Access::initializeOnly || access == Access::inputOutput;
    // An EXTERNPROTO may leave fields of its PROTO out, or declare them wrongly: they keep the PROTO's default.
    const bool fromInstance = source != kNoField && haveOneType(instance.type().fields[source], def) &&
                              instance.type().fields[source].access == access;
    if (hasValue && sf(def.type) == FieldType::SFNode) {
        std::vector<NodeId> nodes;
        if (fromInstance && def.type == FieldType::SFNode) {
            if (const NodeId only = *static_cast<const NodeId*>(instance.storage(source))) nodes.push_back(only);
        } else if (fromInstance) {
            for (const NodeId id : *static_cast<const Array<NodeId>*>(instance.storage(source))) nodes.push_back(id);
        }
        std::erase_if(nodes, [&](NodeId id) {
            const NodeType* type = effectiveType(id);
            const bool accepted = !type || def.accepts.empty() ||
                                  std::ranges::any_of(def.accepts, [&](const auto& one) { return type->isA(one); });
            if (!accepted) refuse(fmt::format("the field does not accept {}", type->name));
            return !accepted;
        });
        node.list(target) = std::move(nodes);
        node.markGiven(target);
    } else if (hasValue) {
        const std::optional<Value> value = fromInstance ? std::optional(instance.value(source)) : declared->value;
        if (value) store(node, target, *value, request.where);
        node.markGiven(target);
    }
    if (!fromInstance) return;
    if (auto connected = scene.addIsConnection(in.owner, source, node.id, target); !connected)
        refuse(connected.error().text);
}

void SceneBuilder::State::expand(OpenNode& instance) {
    const std::size_t position = static_cast<std::size_t>(&instance - open.data());
    const SourceLocation where = instance.where;
    const bool external = instance.proto->external;
    ProtoDeclaration* proto = external ? instance.proto->target : instance.proto;
    if (!proto) {
        storeChildren(instance);  // inert, but saved as it came
        return;
    }
    std::size_t depth = 0;
    for (const auto& above : scopes) {
        if (above->proto) ++depth;
        if (above->proto == proto) {
            error(where, fmt::format("PROTO {} contains itself", proto->name));
            storeChildren(instance);
            return;
        }
    }
    if (depth >= kMaximumProtoDepth) {
        error(where, fmt::format("PROTO instances nest more than {} deep", kMaximumProtoDepth));
        storeChildren(instance);
        return;
    }
    const NodeId id = instance.id;
    if (const FieldIndex loaded = hiddenField(scene.node(id).type(), "loadedUrl"); external && loaded != kNoField)
        setHidden(scene, id, loaded, Value(String(instance.proto->targetUrl)));
    NameScope& inside = pushScope(id, proto->inside, proto->source);
    inside.proto = proto;
    inside.instanceType = &scene.node(id).type();
    inside.quiet = proto->instanced;
    proto->instanced = true;
    // Defaults made of nodes: each instance has its own, with names inside the PROTO.
    inside.openBase = position;
    for (const InterfaceField& field : proto->fields) {
        const FieldIndex index = inside.instanceType->find(field.declaration.name);
        if (index == kNoField || open[position].isGiven(index)) continue;
        if (!field.nodes.empty())
            field.nodes.replay(handler);
        else if (external && field.value && sf(field.declaration.type) != FieldType::SFNode &&
                 inside.instanceType->fields[index].holds(*field.value))
            store(open[position], index, *field.value, where);
    }
    storeChildren(open[position]);
    inside.openBase = openCount;
    push(OpenNode::Kind::body, where);
    proto->body.replay(handler);
    closeOpenNodes();
    std::vector<NodeId> nodes;
    if (!open[openCount - 1].children.empty()) nodes = std::move(open[openCount - 1].children.front().nodes);
    pop();
    if (!nodes.empty())
        if (auto stored =
                scene.setField(id, inside.instanceType->body(), Value(Array<NodeId>(std::span<const NodeId>(nodes))));
            !stored)
            error(where, stored.error().text);
    finishScope(inside);
    popScope();
}

void SceneBuilder::State::checkUnusedProtos() {
    // Otherwise errors in a PROTO that nobody uses would not be reported.
    const Environment& declared = *scopes.front()->environment;
    bool unused = false;
    for (std::size_t i = 0; i < declared.size(); ++i) unused |= !declared.at(i)->external && !declared.at(i)->instanced;
    if (!unused || isTrial) return;
    Scene scratch;
    registerDocuments(scratch, dialect);
    Diagnostics found(diagnostics.file());
    BuildOptions trialOptions = options;
    trialOptions.loadInlines = false;
    SceneBuilder trial(scratch, found, trialOptions);
    trial.state_->isTrial = true;
    for (std::size_t i = 0; i < declared.size(); ++i) writeDeclaration(*declared.at(i), trial);
    for (std::size_t i = 0; i < declared.size(); ++i) {
        if (declared.at(i)->external || declared.at(i)->instanced) continue;
        trial.beginNode(declared.at(i)->name, {}, {}, declared.at(i)->where);
        trial.endNode(declared.at(i)->where);
    }
    trial.finish();
    for (const Diagnostic& one : found.all()) {
        const bool said = std::ranges::any_of(diagnostics.all(), [&](const Diagnostic& other) {
            return other.where.line == one.where.line && other.where.column == one.where.column &&
                   other.text == one.text;
        });
        if (!said && one.file == diagnostics.file()) diagnostics.add(one.severity, one.where, one.text);
    }
}

}  // namespace rtsg
