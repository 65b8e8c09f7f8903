// The functions by which a script acts on the scene. Each function checks everything that comes from the script; if it
// refuses, it answers with a sentence (a string), which the prelude turns into an exception at the script's own line.
#include <algorithm>

#include <fmt/format.h>

#include <rtsg/core/script_language.h>
#include <rtsg/core/terminal.h>
#include <rtsg/core/x3d.h>

#include "bridge.h"

namespace rtsg::script {

namespace {

bool print(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    std::string text;
    if (!stringFrom(cx, args.get(0), text)) return false;
    const Call& call = currentCall(cx);
    if (call.options.print)
        call.options.print(text);
    else
        std::fputs(terminalText(text, Lines::kept).c_str(), stdout);
    args.rval().setUndefined();
    return true;
}

bool now(JSContext* cx, unsigned count, JS::Value* vp) {
    JS::CallArgsFromVp(count, vp).rval().setNumber(currentCall(cx).now);
    return true;
}

/// The running program's global object.
bool global(JSContext* cx, unsigned count, JS::Value* vp) {
    JS::CallArgsFromVp(count, vp).rval().setObject(*currentCall(cx).global);
    return true;
}

/// lexical(name): the value that the program has declared by `let`, `const` or `class`, if any.
bool lexical(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    std::string name;
    if (!stringFrom(cx, args.get(0), name)) return false;
    const JSAutoRealm inside(cx, currentCall(cx).global);
    const JS::RootedObject declared(cx, JS_ExtensibleLexicalEnvironment(currentCall(cx).global));
    args.rval().setUndefined();
    bool known = false;
    if (!declared || !JS_HasOwnProperty(cx, declared, name.c_str(), &known)) return declared == nullptr;
    return !known || JS_GetProperty(cx, declared, name.c_str(), args.rval());
}

/// hasRoomFor(bytes)
bool hasRoomFor(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const double bytes = args.get(0).isNumber() ? args.get(0).toNumber() : 0;
    auto& runtime = *static_cast<Runtime*>(JS_GetContextPrivate(cx));
    args.rval().setBoolean(!(bytes > 0) || (bytes < 1e18 && runtime.hasRoomFor(static_cast<std::size_t>(bytes))));
    return true;
}

bool exists(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    args.rval().setBoolean(currentCall(cx).scene.find(nodeArgument(args, 0)) != nullptr);
    return true;
}

/// isLoose(node): whether it matters that the program's variables hold it.
bool isLoose(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const std::vector<NodeId>* loose = currentCall(cx).loose;
    args.rval().setBoolean(loose && std::ranges::binary_search(*loose, nodeArgument(args, 0)));
    return true;
}

bool type(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Node* node = currentCall(cx).scene.find(nodeArgument(args, 0));
    args.rval().setInt32(node ? node->typeIndex().value : -1);
    return true;
}

bool typeName(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Node* node = currentCall(cx).scene.find(nodeArgument(args, 0));
    return answer(cx, args, node ? std::string_view(node->type().name) : std::string_view());
}

bool nodeName(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    return answer(cx, args, currentCall(cx).scene.name(nodeArgument(args, 0)));
}

/// field(node, name): index | type << 16 | access << 24, or -1.
bool field(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    std::string name;
    if (!stringFrom(cx, args.get(1), name)) return false;
    const Node* node = currentCall(cx).scene.find(nodeArgument(args, 0));
    const FieldIndex index = node ? fieldCalled(currentCall(cx).scene, node->type(), name) : kNoField;
    if (index == kNoField) {
        args.rval().setInt32(-1);
        return true;
    }
    const FieldDef& def = node->type().fields[index];
    args.rval().setInt32(index | static_cast<int>(def.type) << 16 | static_cast<int>(def.access) << 24);
    return true;
}

/// The author's fields of a Script; and its description, which X3D 4.0 gave to every Script: authors of before declared
/// one, and their programs read it.
bool fieldNames(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Node* node = currentCall(cx).scene.find(nodeArgument(args, 0));
    JS::RootedObject names(cx, JS::NewArrayObject(cx, 0));
    if (!names || !node) return false;
    const NodeType& builtin = currentCall(cx).scene.type(x3d::Script::type);
    std::uint32_t next = 0;
    for (const FieldDef& def : node->type().fields) {
        if (def.hidden || (builtin.findExact(def.name) != kNoField && def.name != "description")) continue;
        JS::RootedString name(cx, JS_NewStringCopyUTF8N(cx, JS::UTF8Chars(def.name.data(), def.name.size())));
        if (!name || !JS_SetElement(cx, names, next++, name)) return false;
    }
    args.rval().setObject(*names);
    return true;
}

/// read(node, field)
bool read(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Node* node = currentCall(cx).scene.find(nodeArgument(args, 0));
    const auto index = static_cast<FieldIndex>(args.get(1).isNumber() ? args.get(1).toNumber() : kNoField);
    if (!node || index >= node->type().fields.size() || !node->type().fields[index].readable()) {
        args.rval().setUndefined();
        return true;
    }
    return toScript(cx, node->type().fields[index].type, node->storage(index), args.rval());
}

/// The content of a reader: its Script's number, place and field as (number << 5 | place) << 16 | field, which a double
/// holds.
constexpr std::size_t kBitInReader = 0, kReadInCall = 1;

/// Whether the program whose global object this is has touched the field in its call, or one that shares its bit.
bool isTouched(JSObject* global, unsigned bit) {
    const JS::AutoCheckCannotGC noCollection;
    bool shared = false;
    const double* bits =
        JS_GetFloat64ArrayData(&JS::GetReservedSlot(global, Runtime::kTouchedSlot).toObject(), &shared, noCollection);
    return (static_cast<std::uint32_t>(*bits) >> bit & 1u) != 0;
}

/// The getter of a program's own field of one number. The engine can call it from compiled code, which it cannot do
/// with getters in JavaScript where a program names a global variable.
bool readOwn(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    JSObject* reader = &args.callee();
    const Call& call = currentCall(cx);
    const auto packed = static_cast<std::uint64_t>(js::GetFunctionNativeReserved(reader, kBitInReader).toNumber());
    const NodeId self{static_cast<std::uint32_t>(packed >> 21)};
    const Node* node = call.scene.find(self);
    if (!node || self != call.self || isTouched(call.global, packed >> 16 & 0x1F)) {
        const JS::RootedValue inCall(cx, js::GetFunctionNativeReserved(reader, kReadInCall));
        return JS::Call(cx, JS::UndefinedHandleValue, inCall, JS::HandleValueArray::empty(), args.rval());
    }
    const auto field = static_cast<FieldIndex>(packed & 0xFFFF);
    const FieldType type = node->type().slot(field).type;
    if (type != FieldType::SFBool) return toScript(cx, type, node->storage(field), args.rval());
    args.rval().setBoolean(*static_cast<const bool*>(node->storage(field)));
    return true;
}

/// reader(field, place, touched, read): the function that reads an own field of one number. It calls `read` if
/// `touched` has bit `place`: then the value is not the scene's.
bool reader(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const JSAutoRealm inside(cx, currentCall(cx).global);
    JSFunction* created = js::NewFunctionWithReserved(cx, readOwn, 0, 0, "");
    if (!created) return false;
    JSObject* object = JS_GetFunctionObject(created);
    const std::uint64_t packed = static_cast<std::uint64_t>(currentCall(cx).self.value) << 21 |
                                 static_cast<std::uint64_t>(args.get(1).toInt32()) << 16 |
                                 static_cast<std::uint64_t>(args.get(0).toInt32());
    js::SetFunctionNativeReserved(object, kBitInReader, JS::NumberValue(static_cast<double>(packed)));
    js::SetFunctionNativeReserved(object, kReadInCall, args.get(3));
    JS::SetReservedSlot(currentCall(cx).global, Runtime::kTouchedSlot, args.get(2));
    args.rval().setObject(*object);
    return true;
}

/// The field that an assignment to a field of another node reaches. For an initializeOnly field this is the input that
/// sets it, if there is one (`faces.coordIndex = ...` is `faces.set_coordIndex = ...`). In the interface of a PROTO or
/// a Script an input of that name is another field.
FieldIndex inputFor(const Node* script, const Node* node, FieldIndex index) {
    if (!node || node == script || index >= node->type().fields.size()) return index;
    const NodeType& type = node->type();
    const FieldDef& def = type.fields[index];
    const bool fromTable = type.kind == NodeType::Kind::builtin || type.kind == NodeType::Kind::user;
    if (!fromTable || def.access != Access::initializeOnly) return index;
    const FieldIndex input = type.findExact("set_" + def.name);
    if (input == kNoField || type.fields[input].access != Access::inputOnly || !haveOneType(type.fields[input], def))
        return index;
    return input;
}

/// Why `script` may not write the field, or nothing.
std::string writeRefusal(const Call& call, const Node* script, const Node* node, FieldIndex index) {
    if (!call.cascade) return "a script that shuts down can change nothing";
    if (!script || !node || index >= node->type().fields.size()) return "the node is gone";
    const FieldDef& def = node->type().fields[index];
    if (node == script)
        return def.access == Access::inputOnly ? "an input-only field cannot be written by its own script" : "";
    if (def.writable()) return "";
    if (def.access == Access::initializeOnly && call.scene.parents(node->id()).empty()) return "";
    return fmt::format("{}.{} takes no events", node->type().name, def.name);
}

bool mayWrite(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    const Node* script = call.scene.find(nodeArgument(args, 0));
    const Node* node = call.scene.find(nodeArgument(args, 1));
    const auto index = static_cast<FieldIndex>(args.get(2).isNumber() ? args.get(2).toNumber() : kNoField);
    return answer(cx, args, writeRefusal(call, script, node, inputFor(script, node, index)));
}

/// mayHold(node, field, plain value): why the field cannot hold these nodes, or nothing.
bool mayHold(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    const Node* node = call.scene.find(nodeArgument(args, 0));
    const auto index = static_cast<FieldIndex>(args.get(1).isNumber() ? args.get(1).toNumber() : kNoField);
    Value value;
    if (!call.cascade || !node || index >= node->type().fields.size()) return answer(cx, args, "the node is gone");
    const FieldDef& def = node->type().fields[index];
    if (!fromScript(cx, def.type, args.get(2), value, def.custom.get())) {
        if (JS_IsExceptionPending(cx)) return false;
        return answer(cx, args, fmt::format("{} was expected", def.typeName()));
    }
    return answer(cx, args, call.cascade->mayHold(*node, index, value));
}

/// warn(script, text)
bool warn(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    std::string text;
    if (!stringFrom(cx, args.get(1), text)) return false;
    const Node* script = call.scene.find(nodeArgument(args, 0));
    if (call.cascade && script) call.cascade->warn(*script, text);
    args.rval().setUndefined();
    return true;
}

/// write(script, node, field, plain value, assigned): assigned values are sent even if equal, others only if changed.
bool write(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    const Node* script = call.scene.find(nodeArgument(args, 0));
    const Node* node = call.scene.find(nodeArgument(args, 1));
    auto index = static_cast<FieldIndex>(args.get(2).isNumber() ? args.get(2).toNumber() : kNoField);
    Value value;
    if (node && index < node->type().fields.size()) {
        const FieldDef& def = node->type().fields[index];
        if (!fromScript(cx, def.type, args.get(3), value, def.custom.get())) {
            if (JS_IsExceptionPending(cx)) return false;
            return answer(cx, args, fmt::format("{} was expected", def.typeName()));
        }
        const bool assigned = args.get(4).isBoolean() && args.get(4).toBoolean();
        if (!assigned && (!def.readable() || equalStorage(def.type, node->storage(index), value.storage()))) {
            args.rval().setUndefined();
            return true;
        }
    }
    index = inputFor(script, node, index);
    if (const std::string refusal = writeRefusal(call, script, node, index); !refusal.empty())
        return answer(cx, args, refusal);
    const FieldDef& def = node->type().fields[index];
    // VRML97 leaves the effect open (6.40), and browsers do as the program says.
    if (node != script && !script->get(x3d::Script::directOutput))
        call.cascade->warn(*script, "writes to other nodes though its directOutput is FALSE; it is done all the same");
    if (node != script && def.access == Access::initializeOnly)
        return answer(cx, args, call.scene.setField(node->id(), index, std::move(value)));
    if (node != script) return answer(cx, args, call.cascade->deliver(node->id(), index, value));
    return answer(cx, args, call.cascade->output(*node, index, value));
}

bool named(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    std::string name;
    if (!stringFrom(cx, args.get(1), name)) return false;
    const Node* script = call.scene.find(nodeArgument(args, 0));
    args.rval().setNumber(call.scene.findName(name, script ? script->scope() : NodeId{}).value);
    return true;
}

/// roots(script): of its scene, or of the body of the instance that it is in.
bool roots(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Scene& scene = currentCall(cx).scene;
    const Node* script = scene.find(nodeArgument(args, 0));
    const Node* around = script ? scene.find(script->scope()) : nullptr;
    const FieldIndex body = around ? around->type().body() : kNoField;
    if (body != kNoField && isPrototype(around->type()))
        return toScript(cx, FieldType::MFNode, around->storage(body), args.rval());
    const Node& root = scene.node(scene.root());
    return toScript(cx, FieldType::MFNode, &root.get(x3d::RtsgScene::children), args.rval());
}

/// isInWorld(script): whether the world's own document has it, rather than an Inline or a PROTO.
bool isInWorld(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Node* node = currentCall(cx).scene.find(nodeArgument(args, 0));
    args.rval().setBoolean(node && !node->scope());
    return true;
}

/// isInPrototype(script)
bool isInPrototype(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Scene& scene = currentCall(cx).scene;
    const Node* script = scene.find(nodeArgument(args, 0));
    const Node* around = script ? scene.find(script->scope()) : nullptr;
    args.rval().setBoolean(around && isPrototype(around->type()));
    return true;
}

bool createNode(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    std::string name;
    if (!stringFrom(cx, args.get(1), name)) return false;
    const Node* script = call.scene.find(nodeArgument(args, 0));
    if (!call.cascade || !script) return answer(cx, args, "a script that shuts down can change nothing");
    const auto created = ScriptPrograms::createNode(call.scene, name, script->scope());
    if (!created) return answer(cx, args, created.error().text);
    args.rval().setNumber(created->value);
    return true;
}

template <bool add>
bool changeRoute(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    std::string names[2];
    if (!stringFrom(cx, args.get(2), names[0]) || !stringFrom(cx, args.get(4), names[1])) return false;
    const Node* from = call.scene.find(nodeArgument(args, 1));
    const Node* to = call.scene.find(nodeArgument(args, 3));
    if (!call.cascade || !from || !to) return answer(cx, args, "the node is gone");
    const FieldIndex fields[2] = {fieldCalled(call.scene, from->type(), names[0]),
                                  fieldCalled(call.scene, to->type(), names[1])};
    for (int end = 0; end < 2; ++end)
        if (fields[end] == kNoField)
            return answer(cx, args, fmt::format("{} has no field {}", (end ? to : from)->type().name, names[end]));
    return answer(cx, args,
                  add ? call.scene.addRoute(from->id(), fields[0], to->id(), fields[1])
                      : call.scene.removeRoute(from->id(), fields[0], to->id(), fields[1]));
}

template <bool add>
bool changeRoots(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    const NodeId node = nodeArgument(args, 0);
    if (!call.cascade || !call.scene.find(node)) return answer(cx, args, "the node is gone");
    const NodeId root = call.scene.root();
    if constexpr (add) {
        return answer(cx, args, call.scene.insertChild(root, x3d::RtsgScene::children, node));
    } else {
        const auto& children = call.scene.node(root).get(x3d::RtsgScene::children);
        const auto found = std::ranges::find(children, node);
        if (found == children.end()) return answer(cx, args, "the node is no root");
        return answer(cx, args,
                      call.scene.removeChild(root, x3d::RtsgScene::children.index,
                                             static_cast<std::size_t>(found - children.begin())));
    }
}

bool rename(JSContext* cx, unsigned count, JS::Value* vp) {
    const JS::CallArgs args = JS::CallArgsFromVp(count, vp);
    const Call& call = currentCall(cx);
    std::string name;
    if (!stringFrom(cx, args.get(1), name)) return false;
    if (!call.cascade) return answer(cx, args, "a script that shuts down can change nothing");
    return answer(cx, args, call.scene.setName(nodeArgument(args, 0), name));
}

}  // namespace

JSObject* newBridge(JSContext* cx) {
    static constexpr JSFunctionSpec functions[] = {
        JS_FN("print", print, 1, 0),
        JS_FN("now", now, 0, 0),
        JS_FN("global", global, 0, 0),
        JS_FN("lexical", lexical, 1, 0),
        JS_FN("hasRoomFor", hasRoomFor, 1, 0),
        JS_FN("exists", exists, 1, 0),
        JS_FN("isLoose", isLoose, 1, 0),
        JS_FN("type", type, 1, 0),
        JS_FN("typeName", typeName, 1, 0),
        JS_FN("nodeName", nodeName, 1, 0),
        JS_FN("field", field, 2, 0),
        JS_FN("fieldNames", fieldNames, 1, 0),
        JS_FN("read", read, 2, 0),
        JS_FN("reader", reader, 4, 0),
        JS_FN("mayWrite", mayWrite, 3, 0),
        JS_FN("mayHold", mayHold, 3, 0),
        JS_FN("warn", warn, 2, 0),
        JS_FN("write", write, 5, 0),
        JS_FN("named", named, 2, 0),
        JS_FN("roots", roots, 1, 0),
        JS_FN("isInPrototype", isInPrototype, 1, 0),
        JS_FN("isInWorld", isInWorld, 1, 0),
        JS_FN("createNode", createNode, 2, 0),
        JS_FN("addRoute", changeRoute<true>, 5, 0),
        JS_FN("deleteRoute", changeRoute<false>, 5, 0),
        JS_FN("addRoot", changeRoots<true>, 1, 0),
        JS_FN("removeRoot", changeRoots<false>, 1, 0),
        JS_FN("rename", rename, 2, 0),
        JS_FS_END,
    };
    JS::RootedObject bridge(cx, JS_NewPlainObject(cx));
    if (!bridge || !JS_DefineFunctions(cx, bridge, functions)) return nullptr;
    JS::RootedString version(cx, JS_NewStringCopyZ(cx, RTSG_VERSION));
    if (!version || !JS_DefineProperty(cx, bridge, "version", version, 0)) return nullptr;
    return addDocumentBridge(cx, bridge) && addMathBridge(cx, bridge) ? bridge.get() : nullptr;
}

}  // namespace rtsg::script
