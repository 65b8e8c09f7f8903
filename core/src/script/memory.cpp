// Counts what scripts hold, by the engine's own gauges: one for its heap, one a program for what lies outside of it.
#include "memory.h"

#include <algorithm>

namespace rtsg::script {

Holding::Holding(JSContext* cx, Memory& memory) : cx_(cx), memory_(memory), global_(cx), gauge_(cx) {
    global_ = JS::CurrentGlobalOrNull(cx);
    JS::RootedObject info(cx, js::gc::NewMemoryInfoObject(cx));
    JS::RootedValue zone(cx);
    if (info && JS_GetProperty(cx, info, "zone", &zone) && zone.isObject()) gauge_ = &zone.toObject();
    JS_ClearPendingException(cx);
    memory_.holdings_.push_back(this);
}

Holding::~Holding() {
    memory_.outside_ -= bytes_;
    std::erase(memory_.holdings_, this);
}

void Holding::update() {
    if (!gauge_) return;
    JSAutoRealm realm(cx_, global_);
    JS::RootedValue bytes(cx_);
    JS::RootedObject gauge(cx_, gauge_);
    if (!JS_GetProperty(cx_, gauge, "mallocBytes", &bytes) || !bytes.isNumber()) {
        JS_ClearPendingException(cx_);
        return;
    }
    memory_.outside_ -= bytes_;
    bytes_ = static_cast<std::size_t>(bytes.toNumber());
    memory_.outside_ += bytes_;
}

std::size_t Memory::bytes(JSContext* cx, Holding* changed) {
    if (changed) changed->update();
    return JS_GetGCParameter(cx, JSGC_BYTES) + outside_;
}

std::size_t Memory::bytesCollected(JSContext* cx) {
    JS_GC(cx);
    for (Holding* holding : holdings_) holding->update();
    return bytes(cx, nullptr);
}

}  // namespace rtsg::script
