// Counts the memory of scripts, by the engine's own gauges, and by a count of everything if these do not suffice.
#include "memory.h"

#include <algorithm>
#include <chrono>
#include <fstream>

#include <malloc.h>

#include <js/MemoryMetrics.h>

namespace rtsg::script {

namespace {

/// The process's bytes in memory; 0 if the system does not tell.
std::size_t residentBytes() {
    std::ifstream file("/proc/self/statm");
    std::size_t all = 0, resident = 0;
    file >> all >> resident;
    return file ? resident * 4096 : 0;
}

/// Between two looks at the process: a look takes some microseconds, and calls may be as short.
constexpr std::int64_t kLookNanoseconds = 5'000'000;

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wnon-virtual-dtor"  // of the engine's class; nothing is deleted through it
/// The engine's count of everything; of interest is what no gauge of its shows.
struct Everything final : JS::RuntimeStats {
    Everything() : RuntimeStats([](const void* at) { return ::malloc_usable_size(const_cast<void*>(at)); }) {}
    void initExtraRealmStats(JS::Realm*, JS::RealmStats*, const JS::AutoRequireNoGC&) override {}
    void initExtraZoneStats(JS::Zone*, JS::ZoneStats*, const JS::AutoRequireNoGC&) override {}
};
#pragma GCC diagnostic pop

}  // namespace

Memory::Memory(JSContext* cx) : cx_(cx), gauge_(cx, js::gc::NewMemoryInfoObject(cx)), outside_(cx) {
    if (JSString* name = JS_AtomizeAndPinString(cx, "mallocBytes")) outside_ = JS::PropertyKey::fromPinnedString(name);
    JS_ClearPendingException(cx);
    counted_ = gauged();
    resident_ = residentBytes();
}

std::size_t Memory::gauged() {
    double outside = 0;
    if (gauge_ && !outside_.get().isVoid()) {
        // An object with getters: it needs a realm, not always the current one, and no pending exception.
        const JS::AutoSaveExceptionState state(cx_);
        const JSAutoRealm realm(cx_, gauge_);
        JS::RootedObject gauge(cx_, gauge_);
        JS::RootedValue one(cx_);
        JS::RootedId id(cx_, outside_);
        if (JS_GetPropertyById(cx_, gauge, id, &one) && one.isNumber()) outside = one.toNumber();
    }
    return JS_GetGCParameter(cx_, JSGC_BYTES) + static_cast<std::size_t>(outside) + compiled_;
}

void Memory::count() {
    JS_GC(cx_);
    Everything everything;
    if (JS::CollectRuntimeStats(cx_, &everything, nullptr, true)) compiled_ = everything.runtime.scriptData;
    counted_ = gauged();
    resident_ = residentBytes();
}

bool Memory::within(std::size_t limit) {
    lookedAt_ = steadyNow();
    const std::size_t resident = residentBytes();
    resident_ = std::min(resident_, resident);
    if (std::max(gauged(), counted_ + (resident - resident_)) <= limit) return true;
    count();
    return counted_ <= limit;
}

bool Memory::withinForNow(std::size_t limit, std::int64_t now) {
    return now - lookedAt_ <= kLookNanoseconds || within(limit);
}

}  // namespace rtsg::script
