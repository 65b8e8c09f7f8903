// Shared by the functions of the bridge between scripts and scene (bridge*.cpp).
//
// Each function checks everything that comes from the script; it answers with a sentence (a string) where it refuses.
#pragma once

#include <rtsg/core/document_services.h>

#include "runtime.h"

namespace rtsg::script {

inline Call& currentCall(JSContext* cx) {
    return *static_cast<Runtime*>(JS_GetContextPrivate(cx))->current;
}

inline NodeId nodeArgument(const JS::CallArgs& args, unsigned index) {
    return NodeId{args.get(index).isNumber() ? static_cast<std::uint32_t>(args.get(index).toNumber()) : 0u};
}

inline bool answer(JSContext* cx, const JS::CallArgs& args, std::string_view text) {
    JSString* created = JS_NewStringCopyUTF8N(cx, JS::UTF8Chars(text.data(), text.size()));
    if (!created) return false;
    args.rval().setString(created);
    return true;
}

/// Nothing, or the sentence why not.
inline bool answer(JSContext* cx, const JS::CallArgs& args, const Result<>& result) {
    if (!result) return answer(cx, args, result.error().text);
    args.rval().setUndefined();
    return true;
}

inline bool isPrototype(const NodeType& type) {
    return type.kind == NodeType::Kind::proto || type.kind == NodeType::Kind::externProto;
}

/// A field by its name, or by one that it had in VRML97 or in an earlier X3D.
inline FieldIndex fieldCalled(const Scene& scene, const NodeType& type, std::string_view name) {
    if (const FieldIndex found = type.find(name); found != kNoField) return found;
    const std::string_view now = scene.documents().nameNow(type, name);
    return now.empty() ? kNoField : type.find(now);
}

/// Adds the functions about the document as a whole (bridge_document.cpp). False when memory runs out.
bool addDocumentBridge(JSContext* cx, JS::HandleObject bridge);

/// Adds `math`, the elementary functions (bridge_math.cpp). False when memory runs out.
bool addMathBridge(JSContext* cx, JS::HandleObject bridge);

}  // namespace rtsg::script
