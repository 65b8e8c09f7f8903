// The functions by which a script asks for the document as a whole: pieces from text and files, other worlds, the
// document's statements about itself, and its types and fields.
#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <span>

#include <fmt/format.h>

#include <rtsg/core/navigation.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/script_language.h>
#include <rtsg/core/x3d.h>

#include "bridge.h"

namespace rtsg::script {

namespace {

using Root = x3d::RtsgScene;

constexpr std::string_view kShutsDown = "a script that shuts down can change nothing";

/// An array of parts in plain form; each a Value.
bool answerParts(JSContext* cx, const JS::CallArgs& args, std::span<const Value> parts) {
    JS::RootedObject list(cx, JS::NewArrayObject(cx, 0));
    if (!list) return false;
    JS::RootedValue part(cx);
    for (std::uint32_t i = 0; i < parts.size(); ++i)
        if (!toScript(cx, parts[i].type(), parts[i].storage(), &part) || !JS_SetElement(cx, list, i, part))
            return false;
    args.rval().setObject(*list);
    return true;
}

Value strings(std::span<const std::string> texts) {
    Array<String> list;
    for (const std::string& text : texts) list.push_back(String(text));
    return {std::move(list)};
}

/// Null if it is not a value that the prelude sends.
template <class T>
std::optional<Array<T>> listArgument(JSContext* cx, const JS::CallArgs& args, unsigned index) {
    Value value;
    if (!fromScript(cx, FieldTypeOf<Array<T>>::value, args.get(index), value)) return std::nullopt;
    return value.as<Array<T>>();
}

std::vector<std::string> textsOf(const Array<String>& list) {
    std::vector<std::string> texts;
    for (const String& one : list) texts.push_back(one.str());
    return texts;
}

bool answerPiece(JSContext* cx, const JS::CallArgs& args, const Result<DocumentServices::Piece>& piece) {
    if (!piece) return answer(cx, args, piece.error().text);
    std::vector<std::string> names;
    Array<NodeId> ids;
    for (const auto& [name, id] : piece->names) {
        names.push_back(name);
        ids.push_back(id);
    }
    const Value parts[] = {Value(Array<NodeId>(std::span<const NodeId>(piece->roots))), strings(names), Value(ids)};
    return answerParts(cx, args, parts);
}

/// pieceOfText(script, text): [roots, names, their nodes].
bool pieceOfText(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    std::string text;
    if (!stringFrom(cx, args.get(1), text)) return false;
    if (!call.cascade) return answer(cx, args, kShutsDown);
    return answerPiece(cx, args, ScriptPrograms::createPiece(call.scene, text, nodeArgument(args, 0)));
}

/// pieceOfUrls(script, urls): the same.
bool pieceOfUrls(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    const auto urls = listArgument<String>(cx, args, 1);
    if (!urls) return false;
    if (!call.cascade) return answer(cx, args, kShutsDown);
    return answerPiece(cx, args, ScriptPrograms::createPieceOfUrls(call.scene, textsOf(*urls), nodeArgument(args, 0)));
}

/// askPiece(script, urls, node, field name): comes as an event.
bool askPiece(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    const auto urls = listArgument<String>(cx, args, 1);
    std::string name;
    if (!urls || !stringFrom(cx, args.get(3), name)) return false;
    const Node* node = call.scene.find(nodeArgument(args, 2));
    if (!call.cascade || !node) return answer(cx, args, "the node is gone");
    const FieldIndex field = fieldCalled(call.scene, node->type(), name);
    if (field == kNoField || node->type().fields[field].type != FieldType::MFNode ||
        !node->type().fields[field].writable())
        return answer(cx, args, fmt::format("{} has no field {} that takes nodes", node->type().name, name));
    const DocumentRequest request{
        DocumentRequest::Kind::piece, nodeArgument(args, 0), textsOf(*urls), {}, {}, node->id(), field};
    return answer(cx, args, ScriptPrograms::request(call.scene, request));
}

/// askWorld(script, urls)
bool askWorld(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    const auto urls = listArgument<String>(cx, args, 1);
    if (!urls) return false;
    if (!call.cascade) return answer(cx, args, kShutsDown);
    return answer(cx, args,
                  ScriptPrograms::request(
                      call.scene, {DocumentRequest::Kind::world, nodeArgument(args, 0), textsOf(*urls), {}, {}, {}}));
}

/// replaceWorld(script, nodes, names, their nodes)
bool replaceWorld(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    const auto nodes = listArgument<NodeId>(cx, args, 1), named = listArgument<NodeId>(cx, args, 3);
    const auto names = listArgument<String>(cx, args, 2);
    if (!nodes || !names || !named || names->size() != named->size()) return false;
    if (!call.cascade) return answer(cx, args, kShutsDown);
    DocumentRequest request{DocumentRequest::Kind::replacement, nodeArgument(args, 0), {}, {}, {}, {}};
    for (const NodeId id : *nodes)
        if (id) request.nodes.push_back(id);
    for (std::size_t i = 0; i < names->size(); ++i) request.names.emplace_back((*names)[i].str(), (*named)[i]);
    return answer(cx, args, ScriptPrograms::request(call.scene, request));
}

// ---- what the document says of itself ------------------------------------------------------------------------------

/// documentInfo(): [profile, components, meta, units, imports, exports], flat, as the root has them.
bool documentInfo(JSContext* cx, unsigned count, JS::Value* vp) {
    const Scene& scene = currentCall(cx).scene;
    const Node& root = scene.node(scene.root());
    const Value parts[] = {Value(Array<String>{root.get(Root::profile)}),
                           Value(root.get(Root::components)),
                           Value(root.get(Root::meta)),
                           Value(root.get(Root::units)),
                           Value(root.get(Root::imports)),
                           Value(root.get(Root::exports))};
    return answerParts(cx, JS::CallArgsFromVp(count, vp), parts);
}

/// setDocumentInfo("meta" | "imports" | "exports", list)
bool setDocumentInfo(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    std::string which;
    const auto list = listArgument<String>(cx, args, 1);
    if (!list || !stringFrom(cx, args.get(0), which)) return false;
    if (!call.cascade) return answer(cx, args, kShutsDown);
    const Field<Array<String>> field = which == "meta"      ? Root::meta
                                       : which == "imports" ? Root::imports
                                                            : Root::exports;
    return answer(cx, args, call.scene.setField(call.scene.root(), field.index, Value(*list)));
}

/// folder(): where relative urls start.
bool folder(JSContext* cx, unsigned count, JS::Value* vp) {
    const Call& call = currentCall(cx);
    const std::string text = call.options.resources ? call.options.resources->folder().string() : std::string();
    return answer(cx, JS::CallArgsFromVp(count, vp), text);
}

/// localNode(script, name), or 0: the node that a DEF or an IMPORT names in the script's document.
bool localNode(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    std::string name;
    if (!stringFrom(cx, args.get(1), name)) return false;
    const Node* script = call.scene.find(nodeArgument(args, 0));
    args.rval().setNumber(
        call.scene.documents().localNode(call.scene, script ? script->scope() : NodeId{}, name).value);
    return true;
}

/// prototypes(external): the document's own.
bool prototypes(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Scene& scene = currentCall(cx).scene;
    const NodeType::Kind kind = args.get(0).isTrue() ? NodeType::Kind::externProto : NodeType::Kind::proto;
    std::vector<std::string> names;
    for (std::size_t i = builtinTypes().size(); i < scene.typeCount(); ++i) {
        const NodeType& type = scene.type(TypeIndex{static_cast<std::uint16_t>(i)});
        if (type.kind == kind && !type.declaration.empty() && !type.name.contains('#')) names.push_back(type.name);
    }
    const Value list = strings(names);
    return toScript(cx, list.type(), list.storage(), args.rval());
}

/// declaration(name): of a prototype, as ClassicVRML.
bool declaration(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Scene& scene = currentCall(cx).scene;
    std::string name;
    if (!stringFrom(cx, args.get(0), name)) return false;
    const auto type = scene.findType(name);
    return answer(cx, args, type ? scene.type(*type).declaration : std::string());
}

/// declareAs(name, prototype): declares it once more by that name.
bool declareAs(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    std::string name, known;
    if (!stringFrom(cx, args.get(0), name) || !stringFrom(cx, args.get(1), known)) return false;
    if (!call.cascade) return answer(cx, args, kShutsDown);
    const auto type = call.scene.findType(known);
    if (!type) return answer(cx, args, fmt::format("no prototype is named {}", known));
    return answer(cx, args, call.scene.documents().declareAs(call.scene, *type, name, call.options.resources.get()));
}

/// hasBody(prototype): of its instances: true or false, undefined if there are none.
bool hasBody(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Scene& scene = currentCall(cx).scene;
    std::string name;
    if (!stringFrom(cx, args.get(0), name)) return false;
    args.rval().setUndefined();
    const auto type = scene.findType(name);
    const FieldIndex body = type ? scene.type(*type).body() : kNoField;
    if (body == kNoField) return true;
    scene.forEachNode([&](const Node& node) {
        if (!node.is(*type) || args.rval().isTrue()) return;
        args.rval().setBoolean(!static_cast<const Array<NodeId>*>(node.storage(body))->empty());
    });
    return true;
}

/// routes(script): [from nodes, from fields, to nodes, to fields] of the script's document.
bool routes(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Scene& scene = currentCall(cx).scene;
    const Node* script = scene.find(nodeArgument(args, 0));
    Array<NodeId> from, to;
    std::vector<std::string> fromFields, toFields;
    scene.forEachNode([&](const Node& node) {
        if (!script || node.scope() != script->scope()) return;
        for (const Route& route : scene.routesFrom(node.id())) {
            if (route.isConnection) continue;
            from.push_back(route.fromNode);
            to.push_back(route.toNode);
            fromFields.push_back(node.type().fields[route.fromField].name);
            toFields.push_back(scene.node(route.toNode).type().fields[route.toField].name);
        }
    });
    const Value parts[] = {Value(from), strings(fromFields), Value(to), strings(toFields)};
    return answerParts(cx, args, parts);
}

// ---- types and fields ----------------------------------------------------------------------------------------------

bool answerFields(JSContext* cx, const JS::CallArgs& args, const NodeType& type) {
    std::vector<std::string> names;
    Array<std::int32_t> types, access;
    for (const FieldDef& def : type.fields) {
        if (def.hidden) continue;
        names.push_back(def.name);
        types.push_back(static_cast<std::int32_t>(def.type));
        access.push_back(static_cast<std::int32_t>(def.access));
    }
    const Value parts[] = {strings(names), Value(types), Value(access)};
    return answerParts(cx, args, parts);
}

/// fieldsOf(node): [names, types, accesses].
bool fieldsOf(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Node* node = currentCall(cx).scene.find(nodeArgument(args, 0));
    return node ? answerFields(cx, args, node->type()) : answer(cx, args, "the node is gone");
}

/// fieldsOfType(name): the same.
bool fieldsOfType(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    std::string name;
    if (!stringFrom(cx, args.get(0), name)) return false;
    const auto type = currentCall(cx).scene.findType(name);
    if (!type) return answer(cx, args, fmt::format("no node type is named {}", name));
    return answerFields(cx, args, currentCall(cx).scene.type(*type));
}

/// kindsOf(node): its own type, then the types that it implements, by name.
bool kindsOf(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Node* node = currentCall(cx).scene.find(nodeArgument(args, 0));
    std::vector<std::string> names;
    if (node) {
        names = node->type().implements;
        names.insert(names.begin(),
                     isPrototype(node->type()) ? std::string("X3DPrototypeInstance") : node->type().name);
    }
    const Value list = strings(names);
    return toScript(cx, list.type(), list.storage(), args.rval());
}

/// typeNames(): the names of all built-in types, and of the abstract ones that they implement.
bool typeNames(JSContext* cx, unsigned count, JS::Value* vp) {
    std::set<std::string> names{"X3DPrototypeInstance"};
    for (const auto& type : builtinTypes()) {
        if (type->internal) continue;
        names.insert(type->name);
        names.insert(type->implements.begin(), type->implements.end());
    }
    const Value list = strings(std::vector<std::string>(names.begin(), names.end()));
    return toScript(cx, list.type(), list.storage(), JS::CallArgsFromVp(count, vp).rval());
}

/// components(): [names, levels] of the components that this build supports.
bool components(JSContext* cx, unsigned count, JS::Value* vp) {
    std::map<std::string, std::int32_t> levels;
    for (const auto& type : builtinTypes())
        if (!type->internal) levels[type->component] = std::max(levels[type->component], type->level);
    std::vector<std::string> names;
    Array<std::int32_t> numbers;
    for (const auto& [name, level] : levels) {
        names.push_back(name);
        numbers.push_back(level);
    }
    const Value parts[] = {strings(names), Value(numbers)};
    return answerParts(cx, JS::CallArgsFromVp(count, vp), parts);
}

/// nodeText(node, form): 0: ClassicVRML, 1: XML, 2: JSON. Node 0: the whole document.
bool nodeText(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Scene& scene = currentCall(cx).scene;
    const NodeId given = nodeArgument(args, 0), id = given ? given : scene.root();
    const auto form =
        static_cast<DocumentServices::TextForm>(std::clamp(args.get(1).isInt32() ? args.get(1).toInt32() : 0, 0, 2));
    return answer(cx, args, scene.find(id) ? scene.documents().nodeText(scene, id, form) : std::string());
}

/// profiles(): [names, how many components each has, names of these, levels of these].
bool profiles(JSContext* cx, unsigned count, JS::Value* vp) {
    std::vector<std::string> names, components;
    Array<std::int32_t> counts, levels;
    for (const DocumentServices::ProfileParts& profile : currentCall(cx).scene.documents().profiles()) {
        names.push_back(profile.name);
        counts.push_back(static_cast<std::int32_t>(profile.components.size()));
        for (const auto& [component, level] : profile.components) {
            components.push_back(component);
            levels.push_back(level);
        }
    }
    const Value parts[] = {strings(names), Value(counts), strings(components), Value(levels)};
    return answerParts(cx, JS::CallArgsFromVp(count, vp), parts);
}

// ---- the viewer ----------------------------------------------------------------------------------------------------

/// speed(): the metres a second that the bound NavigationInfo allows; 0 if nobody walks.
bool speed(JSContext* cx, unsigned count, JS::Value* vp) {
    const Scene& scene = currentCall(cx).scene;
    const auto& stack = scene.node(scene.root()).get(Root::_navigationStack);
    const Node* bound = stack.empty() ? nullptr : scene.find(stack[0]);
    const bool known = bound && bound->is(x3d::NavigationInfo::type);
    JS::CallArgsFromVp(count, vp).rval().setNumber(known ? double{bound->get(x3d::NavigationInfo::speed)} : 0.0);
    return true;
}

/// viewpointCalled(script, text): binds the viewpoint with this DEF name or, if there is none, with this description.
bool viewpointCalled(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    std::string text;
    if (!stringFrom(cx, args.get(1), text)) return false;
    if (!call.cascade) return answer(cx, args, kShutsDown);
    const Node* script = call.scene.find(nodeArgument(args, 0));
    const NodeId named = call.scene.documents().localNode(call.scene, script ? script->scope() : NodeId{}, text);
    const std::vector<NodeId> all = viewpoints(call.scene);
    auto found = std::ranges::find(all, named);
    if (found == all.end())
        found = std::ranges::find_if(all, [&](NodeId id) {
            const Node& node = call.scene.node(id);
            const FieldIndex field = node.type().findExact("description");
            return field != kNoField && static_cast<const String*>(node.storage(field))->view() == text;
        });
    if (found == all.end()) return answer(cx, args, fmt::format("no viewpoint is named or described as {}", text));
    return answer(cx, args,
                  call.scene.sendEvent(*found, call.scene.node(*found).type().findExact("set_bind"), Value(true)));
}

/// viewpoint(ViewpointChoice)
bool viewpoint(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    if (!call.cascade) return answer(cx, args, kShutsDown);
    const int choice = args.get(0).isInt32() ? args.get(0).toInt32() & 3 : 0;
    return answer(cx, args, bindViewpoint(call.scene, static_cast<ViewpointChoice>(choice)));
}

/// dispose(node): takes it out of all fields in which it hangs.
bool dispose(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    if (!call.cascade) return answer(cx, args, kShutsDown);
    const auto removed = call.scene.removeFromParents(nodeArgument(args, 0));
    if (!removed) return answer(cx, args, removed.error().text);
    args.rval().setUndefined();
    return true;
}

}  // namespace

bool addDocumentBridge(JSContext* cx, JS::HandleObject bridge) {
    static constexpr JSFunctionSpec functions[] = {
        JS_FN("pieceOfText", pieceOfText, 2, 0),
        JS_FN("pieceOfUrls", pieceOfUrls, 2, 0),
        JS_FN("askPiece", askPiece, 4, 0),
        JS_FN("askWorld", askWorld, 2, 0),
        JS_FN("replaceWorld", replaceWorld, 4, 0),
        JS_FN("documentInfo", documentInfo, 0, 0),
        JS_FN("setDocumentInfo", setDocumentInfo, 2, 0),
        JS_FN("folder", folder, 0, 0),
        JS_FN("localNode", localNode, 2, 0),
        JS_FN("prototypes", prototypes, 1, 0),
        JS_FN("declaration", declaration, 1, 0),
        JS_FN("declareAs", declareAs, 2, 0),
        JS_FN("hasBody", hasBody, 1, 0),
        JS_FN("routes", routes, 1, 0),
        JS_FN("fieldsOf", fieldsOf, 1, 0),
        JS_FN("fieldsOfType", fieldsOfType, 1, 0),
        JS_FN("kindsOf", kindsOf, 1, 0),
        JS_FN("typeNames", typeNames, 0, 0),
        JS_FN("components", components, 0, 0),
        JS_FN("nodeText", nodeText, 2, 0),
        JS_FN("profiles", profiles, 0, 0),
        JS_FN("speed", speed, 0, 0),
        JS_FN("viewpoint", viewpoint, 1, 0),
        JS_FN("viewpointCalled", viewpointCalled, 2, 0),
        JS_FN("dispose", dispose, 1, 0),
        JS_FS_END,
    };
    return JS_DefineFunctions(cx, bridge, functions);
}

}  // namespace rtsg::script
