// Field values in the plain form that scripts and scene exchange: a number, a string, a Float64Array, an array of
// strings.
#pragma once

#include <string>
#include <vector>

#include <rtsg/core/custom_field.h>
#include <rtsg/core/value.h>

// SpiderMonkey's headers are not clean under our warnings.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpedantic"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wold-style-cast"
#pragma GCC diagnostic ignored "-Wnon-virtual-dtor"
#include <js/Array.h>
#include <js/CharacterEncoding.h>
#include <js/CompilationAndEvaluation.h>
#include <js/Conversions.h>
#include <js/ErrorReport.h>
#include <js/Exception.h>
#include <js/GCVector.h>
#include <js/Initialization.h>
#include <js/Interrupt.h>
#include <js/LocaleSensitive.h>
#include <js/Promise.h>
#include <js/SourceText.h>
#include <js/Stack.h>
#include <js/experimental/JSStencil.h>
#include <js/experimental/TypedData.h>
#include <jsapi.h>
#include <jsfriendapi.h>
#pragma GCC diagnostic pop
// Rooted variables are linked into a list while they live; the compiler sees only that their address is kept.
#pragma GCC diagnostic ignored "-Wdangling-pointer"

namespace rtsg::script {

/// `storage` is in block representation. False with a pending exception when memory runs out.
bool toScript(JSContext* cx, FieldType type, const void* storage, JS::MutableHandleValue out);
/// False if `value` is not the plain form of `type` (the prelude sees to it that it is) or memory runs out.
/// `custom`: which type SFCustom and MFCustom are.
bool fromScript(JSContext* cx, FieldType type, JS::HandleValue value, Value& out, const CustomType* custom = nullptr);
/// UTF-8.
bool stringFrom(JSContext* cx, JS::HandleValue value, std::string& out);

}  // namespace rtsg::script
