// One JavaScript context a thread: the prelude in a realm of its own, a realm for each program, and a watch thread that
// stops calls that take too long or too much.
#include "runtime.h"

#include <algorithm>
#include <chrono>
#include <system_error>
#include <vector>

#include <pthread.h>

#include <rtsg/core/module.h>
#include <rtsg/core/never_destroyed.h>

namespace rtsg::delayed {
extern DelayedLibrary mozjs;
}

namespace rtsg::script {

extern const char* const kPrelude;
extern const char* const kFences;
extern const char* const kBrowser;

namespace {

std::atomic<bool> processEnds = false;
std::mutex listing;  // held while a context is made or destroyed

/// Ends the library with the process: its own threads have to be gone before its static data are. Scenes may live that
/// long, since exit() destroys neither those on a stack nor those of other threads. They call no program from then on.
struct Library {
    std::vector<Runtime*> runtimes;  // of all threads
    void end() {
        processEnds = true;
        const std::scoped_lock lock(listing);
        constexpr std::int64_t kPatience = 1'000'000'000;
        for (const std::int64_t until = steadyNow() + kPatience; steadyNow() < until;) {
            if (std::ranges::none_of(runtimes, &Runtime::isRunning)) break;
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        JS_ShutDown();
    }
};
/// By its priority it is destroyed after all other static objects of the program, scenes among them.
[[gnu::init_priority(101)]] Library spiderMonkey;
struct EndOfLibrary {
    ~EndOfLibrary() { spiderMonkey.end(); }
};

/// How often a running program is looked at.
constexpr std::chrono::milliseconds kWatchPeriod{20};
/// Looks at nothing running after which the watch goes to sleep: until then a call need not wake it.
constexpr int kIdlePeriods = 50;
/// The longest text that scripts may give to eval() or Function(): parsing it is one step, which nothing interrupts.
constexpr std::size_t kLongestProgramText = std::size_t{1} << 22;

bool mayCompile(JSContext*, JS::RuntimeCode, JS::HandleString text) {
    return !text || JS_GetStringLength(text) <= kLongestProgramText;
}

constexpr JSSecurityCallbacks kSecurity{mayCompile, nullptr};

constexpr std::size_t kStackBytes = std::size_t{512} << 10;

/// Everything that the prelude and the fences use. Programs cannot reach anything else through them.
bool resolveForLibrary(JSContext* cx, JS::HandleObject global, JS::HandleId id, bool* resolved) {
    if (!id.isString()) return true;
    for (const char* name :
         {"Array",   "Error",   "Float64Array", "Function", "Infinity", "InternalError", "Map",
          "Math",    "NaN",     "Number",       "Object",   "Proxy",    "RangeError",    "ReferenceError",
          "Reflect", "RegExp",  "Set",          "String",   "Symbol",   "SyntaxError",   "TypeError",
          "WeakMap", "WeakRef", "globalThis",   "undefined"})
        if (JS_LinearStringEqualsAscii(id.toLinearString(), name))
            return JS_ResolveStandardClass(cx, global, id, resolved);
    return true;
}

/// Some versions of the library have to be asked.
template <class Options>
void enableWeakRefs(Options& options) {
    if constexpr (requires { options.getWeakRefsEnabled(); }) {
        using Specifier = decltype(options.getWeakRefsEnabled());
        options.setWeakRefsEnabled(Specifier::EnabledWithoutCleanupSome);
    }
}

JSClassOps globalOps(JSResolveOp resolve) {
    JSClassOps ops = JS::DefaultGlobalClassOps;
    ops.resolve = resolve;
    ops.mayResolve = nullptr;
    return ops;
}

// Set when the library has been loaded.
JSClassOps libraryOps, programOps;
const JSClass kLibraryClass{"Library", JSCLASS_GLOBAL_FLAGS, &libraryOps, nullptr, nullptr, nullptr};
const JSClass kProgramClass{"Script", JSCLASS_GLOBAL_FLAGS, &programOps, nullptr, nullptr, nullptr};

/// Why the library does not start; empty if it has.
const std::string& startEngine() {
    static const std::string& problem = neverDestroyed([]() -> std::string {
        if (const auto loaded = delayed::mozjs.load(); !loaded) return loaded.error().text;
        libraryOps = globalOps(resolveForLibrary);
        programOps = globalOps(Runtime::onResolve);
        if (!JS_Init()) return "the script engine refuses to start";
        // Made after the library's static data, it is destroyed before them.
        static const EndOfLibrary end;
        return {};
    });
    return problem;
}

}  // namespace

std::string Runtime::whyNone() {
    const std::string& problem = startEngine();
    return problem.empty() ? "the script engine does not start" : problem;
}

std::shared_ptr<Runtime> Runtime::ofThisThread(std::size_t heapLimit) {
    static thread_local std::weak_ptr<Runtime> known;
    if (hasEnded()) return nullptr;
    if (auto runtime = known.lock()) return runtime;
    std::shared_ptr<Runtime> runtime(new Runtime);
    if (!runtime->start(heapLimit)) return nullptr;
    known = runtime;
    return runtime;
}

namespace {

/// Bytes of this thread's stack below its present call.
std::size_t stackLeft() {
    pthread_attr_t attributes;
    if (::pthread_getattr_np(::pthread_self(), &attributes) != 0) return SIZE_MAX;
    void* lowest = nullptr;
    std::size_t size = 0;
    const bool known = ::pthread_attr_getstack(&attributes, &lowest, &size) == 0;
    ::pthread_attr_destroy(&attributes);
    if (!known) return SIZE_MAX;
    const auto* const here = static_cast<const char*>(__builtin_frame_address(0));
    return static_cast<std::size_t>(here - static_cast<const char*>(lowest));
}

}  // namespace

bool Runtime::start(std::size_t heapLimit) {
    const std::scoped_lock lock(listing);
    if (hasEnded() || !startEngine().empty()) return false;
    // No limit of the library's own: reached while it moves objects about, that would end the process.
    context_ = JS_NewContext(UINT32_MAX);
    if (!context_) return false;
    spiderMonkey.runtimes.push_back(this);
    heapLimit_ = heapLimit;
    // Short-lived objects of calls take turns in this memory. In the library's own 16 MiB every cache line would come
    // from far away.
    JS_SetGCParameter(context_, JSGC_MAX_NURSERY_BYTES, 4 << 20);
    JS_SetContextPrivate(context_, this);
    JS_SetNativeStackQuota(context_, std::min(kStackBytes, stackLeft() / 2));
    // Scripts see this locale, not the machine's.
    if (!JS_SetDefaultLocale(JS_GetRuntime(context_), "en-US")) return false;
    JS_SetSecurityCallbacks(context_, &kSecurity);
    jobs_ = std::make_unique<Jobs>(context_);
    if (!JS_AddInterruptCallback(context_, onInterrupt) || !JS::InitSelfHostedCode(context_)) return false;
    if (!startLibrary()) return false;
    try {
        watcher_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
    } catch (const std::system_error&) {
        return false;  // nothing would end a program that runs for ever
    }
    return true;
}

Runtime::~Runtime() {
    watcher_ = {};
    // On another thread the library would abort; the memory of one context is then lost.
    if (!context_) return;
    const std::scoped_lock lock(listing);
    if (!hasEnded()) std::erase(spiderMonkey.runtimes, this);
    if (!onOwnThread() || hasEnded()) {
        (void)jobs_.release();
        for (auto* root : {&library_, &prelude_, &names_, &fences_, &fenced_}) (void)root->release();
        (void)new auto(std::move(compiled_));
        (void)memory_.release();
        return;
    }
    jobs_.reset();
    memory_.reset();
    for (auto* root : {&library_, &prelude_, &names_, &fences_, &fenced_}) root->reset();
    compiled_.clear();
    JS_DestroyContext(context_);
}

bool Runtime::hasEnded() {
    return processEnds;
}

bool Runtime::startWatch(double seconds) {
    limit_ = static_cast<std::int64_t>(seconds * 1e9);
    firstLook_ = -1;
    deadline_ = steadyNow() + limit_;
    if (hasEnded()) {
        deadline_ = 0;
        return false;
    }
    if (!watcherSleeps_) return true;
    const std::scoped_lock lock(mutex_);
    wakeUp_.notify_one();
    return true;
}

std::int64_t Runtime::stopWatch(std::int64_t now) {
    return now - (deadline_.exchange(0, std::memory_order_relaxed) - limit_);
}

void Runtime::watch(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    int idle = 0;
    while (!stop.stop_requested()) {
        wakeUp_.wait_for(lock, stop, kWatchPeriod, [] { return false; });
        if (deadline_ != 0) {
            idle = 0;
            JS_RequestInterruptCallback(context_);
        } else if (++idle > kIdlePeriods) {
            // A call that begins from here on sees the flag, or its deadline is seen below.
            watcherSleeps_ = true;
            wakeUp_.wait(lock, stop, [this] { return deadline_ != 0; });
            watcherSleeps_ = false;
            idle = 0;
        }
    }
}

bool Runtime::startLibrary() {
    JSContext* cx = context_;
    JS::RealmOptions options;
    enableWeakRefs(options.creationOptions());  // programs have none: whether an object still exists is chance to them
    JS::RootedObject global(cx, JS_NewGlobalObject(cx, &kLibraryClass, nullptr, JS::FireOnNewGlobalHook, options));
    if (!global) return false;
    library_ = std::make_unique<JS::PersistentRootedObject>(cx, global);
    const JSAutoRealm inside(cx, global);
    memory_ = std::make_unique<Memory>(cx);
    JS::RootedObject bridge(cx, newBridge(cx)), fences(cx), browser(cx), prelude(cx);
    if (!bridge) return false;
    JS::RootedValue bridgeValue(cx, JS::ObjectValue(*bridge)), names(cx), fenced(cx);
    if (!evaluateOwn("browser", kBrowser, bridgeValue, &browser) ||
        !JS_DefineProperty(cx, bridge, "common", browser, 0))
        return false;
    // The prelude comes last, because it freezes the objects that all others are made of.
    if (!evaluateOwn("fences", kFences, bridgeValue, &fences) || !JS_GetProperty(cx, fences, "byName", &fenced) ||
        !evaluateOwn("prelude", kPrelude, bridgeValue, &prelude) || !JS_GetProperty(cx, prelude, "names", &names) ||
        !names.isObject() || !fenced.isObject())
        return false;
    const auto keep = [&](JSObject* object) { return std::make_unique<JS::PersistentRootedObject>(cx, object); };
    prelude_ = keep(prelude);
    fences_ = keep(fences);
    names_ = keep(&names.toObject());
    fenced_ = keep(&fenced.toObject());
    return true;
}

bool Runtime::evaluateOwn(const char* name, std::string_view source, JS::HandleValue bridge,
                          JS::MutableHandleObject result) {
    JS::CompileOptions options(context_);
    options.setFileAndLine(name, 1);
    JS::SourceText<mozilla::Utf8Unit> text;
    JS::RootedValue function(context_), created(context_);
    JS::RootedValueArray<1> arguments(context_);
    arguments[0].set(bridge);
    if (!text.init(context_, source.data(), source.size(), JS::SourceOwnership::Borrowed) ||
        !JS::Evaluate(context_, options, text, &function) ||
        !JS_CallFunctionValue(context_, nullptr, function, arguments, &created) || !created.isObject())
        return false;
    result.set(&created.toObject());
    return true;
}

JSObject* Runtime::newGlobal(NodeId self) {
    // One zone for all: each of its own would take half a megabyte more, and the collector's time.
    JS::RealmOptions options;
    options.creationOptions().setExistingCompartment(*library_);
    options.behaviors().setDiscardSource(true);  // texts of functions, kept or not, are in no count
    JS::RootedObject global(context_,
                            JS_NewGlobalObject(context_, &kProgramClass, nullptr, JS::FireOnNewGlobalHook, options));
    if (!global) {
        JS_ClearPendingException(context_);
        return nullptr;
    }
    JS::SetReservedSlot(global, kSelfSlot, JS::NumberValue(self.value));
    return global;
}

JSObject* Runtime::newController(JS::HandleObject global) {
    JS::RootedValueArray<2> arguments(context_);
    JS::RootedValue created(context_), ignored(context_);
    JS::RootedObject prelude(context_, *prelude_), fences(context_, *fences_);
    arguments[0].set(JS::GetReservedSlot(global, kSelfSlot));
    arguments[1].setObject(*global);
    if (!JS_CallFunctionName(context_, prelude, "program", arguments, &created)) return nullptr;
    JS::SetReservedSlot(global, kControllerSlot, created);
    JS::RootedValueArray<1> realm(context_);
    realm[0].setObject(*global);
    return JS_CallFunctionName(context_, fences, "begin", realm, &ignored) ? &created.toObject() : nullptr;
}

bool Runtime::run(const std::string& source) {
    constexpr std::size_t kMaxKept = std::size_t{4} << 20;
    JS::CompileOptions options(context_);
    options.setFileAndLine("script", 1);
    auto found = compiled_.find(source);
    if (found == compiled_.end()) {
        JS::SourceText<mozilla::Utf8Unit> text;
        if (!text.init(context_, source.data(), source.size(), JS::SourceOwnership::Borrowed)) return false;
        RefPtr<JS::Stencil> stencil = JS::CompileGlobalScriptToStencil(context_, options, text);
        if (!stencil) return false;
        if (compiledBytes_ + source.size() > kMaxKept) {
            compiled_.clear();
            compiledBytes_ = 0;
        }
        compiledBytes_ += source.size();
        found = compiled_.emplace(source, std::move(stencil)).first;
    }
    const JS::InstantiateOptions instantiate(options);
    JS::RootedScript script(context_, JS::InstantiateGlobalStencil(context_, instantiate, found->second));
    JS::RootedValue ignored(context_);
    return script && JS_ExecuteScript(context_, script, &ignored);
}

bool Runtime::putUpFence(JS::HandleObject global, JS::HandleId id) {
    bool isFenced = false;
    JS::RootedObject fenced(context_, *fenced_), fences(context_, *fences_);
    if (!JS_HasOwnPropertyById(context_, fenced, id, &isFenced)) return false;
    if (!isFenced) return true;
    JS::RootedValueArray<3> arguments(context_);
    JS::RootedValue ignored(context_);
    arguments[0].set(JS::StringValue(id.toString()));
    arguments[1].setObject(*global);
    arguments[2].set(JS::GetReservedSlot(global, kSelfSlot));
    return JS_CallFunctionName(context_, fences, "put", arguments, &ignored);
}

bool Runtime::onResolve(JSContext* cx, JS::HandleObject global, JS::HandleId id, bool* resolved) {
    auto& runtime = *static_cast<Runtime*>(JS_GetContextPrivate(cx));
    if (!runtime.names_ || !id.isString()) return JS_ResolveStandardClass(cx, global, id, resolved);
    if (JS_LinearStringEqualsLiteral(id.toLinearString(), "WebAssembly")) return true;  // its memory is not counted
    bool isOurs = false;
    JS::RootedObject names(cx, *runtime.names_);
    if (!JS_HasOwnPropertyById(cx, names, id, &isOurs)) return false;
    if (isOurs) {
        JS::RootedValue value(cx);
        *resolved = true;
        return JS_GetPropertyById(cx, names, id, &value) &&
               JS_DefinePropertyById(cx, global, id, value, JSPROP_RESOLVING);
    }
    if (!JS_ResolveStandardClass(cx, global, id, resolved)) return false;
    return !*resolved || runtime.putUpFence(global, id);
}

bool Runtime::hasRoomFor(std::size_t more) {
    return more <= heapLimit_ && memory_->within(heapLimit_ - more);
}

void Runtime::collect() {
    JS::ClearKeptObjects(context_);
    // Compiled code goes too: it would keep objects of earlier calls alive, and the time of its compilation is chance.
    JS::PrepareForFullGC(context_);
    JS::NonIncrementalGC(context_, JS::GCOptions::Shrink, JS::GCReason::API);
}

bool Runtime::withinMemory(std::int64_t now) {
    if (!memory_->withinForNow(heapLimit_, now)) excess_ = Excess::memory;
    return excess_ == Excess::none;
}

bool Runtime::onInterrupt(JSContext* cx) {
    auto& runtime = *static_cast<Runtime*>(JS_GetContextPrivate(cx));
    const std::int64_t deadline = runtime.deadline_.load(std::memory_order_relaxed);
    if (deadline == 0) return true;
    if (hasEnded()) {
        runtime.excess_ = Excess::process;
        return false;
    }
    // Reading the thread's own time costs as much as a short call, so it counts from the first look on.
    const std::int64_t now = ownTime();
    if (runtime.firstLook_ < 0) runtime.firstLook_ = now;
    if (steadyNow() > deadline && now - runtime.firstLook_ >= runtime.limit_)
        runtime.excess_ = Excess::time;
    else if (!runtime.hasRoomFor(0))
        runtime.excess_ = Excess::memory;
    // False ends the program, which cannot catch this.
    return runtime.excess_ == Excess::none;
}

}  // namespace rtsg::script
