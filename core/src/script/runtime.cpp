// One JavaScript context a thread, with a watch thread that stops calls that take too long or too much.
#include "runtime.h"

#include <chrono>

namespace rtsg::script {

extern const char* const kPrelude;
extern const char* const kFences;

namespace {

std::int64_t steadyNow() {
    return std::chrono::steady_clock::now().time_since_epoch().count();
}

std::atomic<int> contexts = 0;

/// Started once, ended with the process, unless a context was left behind on a thread that is gone.
bool startLibrary() {
    struct Library {
        bool started = JS_Init();
        ~Library() {
            if (started && contexts == 0) JS_ShutDown();
        }
    };
    static const Library library;
    return library.started;
}

/// How often a running program is looked at.
constexpr std::chrono::milliseconds kWatchPeriod{20};
/// Looks at nothing running after which the watch goes to sleep: until then a call need not wake it.
constexpr int kIdlePeriods = 50;
/// Of a text that scripts give to eval() or Function(): parsing it is one step, which nothing interrupts.
constexpr std::size_t kLongestProgramText = std::size_t{1} << 22;

bool mayCompile(JSContext*, JS::RuntimeCode, JS::HandleString text) {
    return !text || JS_GetStringLength(text) <= kLongestProgramText;
}

constexpr JSSecurityCallbacks kSecurity{mayCompile, nullptr};

constexpr std::size_t kStackBytes = std::size_t{512} << 10;

}  // namespace

std::shared_ptr<Runtime> Runtime::ofThisThread(std::size_t heapLimit) {
    static thread_local std::weak_ptr<Runtime> known;
    if (auto runtime = known.lock()) return runtime;
    std::shared_ptr<Runtime> runtime(new Runtime);
    if (!runtime->start(heapLimit)) return nullptr;
    known = runtime;
    return runtime;
}

bool Runtime::start(std::size_t heapLimit) {
    if (!startLibrary()) return false;
    // No limit of the library's own: reached while it moves objects about, that would end the process.
    context_ = JS_NewContext(UINT32_MAX);
    if (!context_) return false;
    ++contexts;
    heapLimit_ = heapLimit;
    JS_SetContextPrivate(context_, this);
    JS_SetNativeStackQuota(context_, kStackBytes);
    // What the language takes from the machine's locale comes from here.
    if (!JS_SetDefaultLocale(JS_GetRuntime(context_), "en-US")) return false;
    JS_SetSecurityCallbacks(context_, &kSecurity);
    jobs_ = std::make_unique<Jobs>(context_);
    if (!JS_AddInterruptCallback(context_, onInterrupt) || !JS::InitSelfHostedCode(context_)) return false;
    static constexpr JSClass kAnchorClass{"Anchor", JSCLASS_GLOBAL_FLAGS, &JS::DefaultGlobalClassOps, nullptr, nullptr,
                                          nullptr};
    const JS::RealmOptions realm;
    JS::RootedObject anchor(context_,
                            JS_NewGlobalObject(context_, &kAnchorClass, nullptr, JS::FireOnNewGlobalHook, realm));
    if (!anchor) return false;
    anchor_ = std::make_unique<JS::PersistentRootedObject>(context_, anchor);
    {
        const JSAutoRealm inside(context_, anchor);
        memory_ = std::make_unique<Memory>(context_);
    }
    watcher_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
    return true;
}

Runtime::~Runtime() {
    watcher_ = {};
    // Elsewhere the library would abort; what is left then is the memory of one context.
    if (!context_) return;
    if (!onOwnThread()) {
        (void)jobs_.release();
        (void)anchor_.release();
        (void)memory_.release();
        return;
    }
    jobs_.reset();
    memory_.reset();
    anchor_.reset();
    for (RefPtr<JS::Stencil>& library : libraries_) library = nullptr;
    JS_DestroyContext(context_);
    --contexts;
}

void Runtime::startWatch(double seconds) {
    deadline_ = steadyNow() + static_cast<std::int64_t>(seconds * 1e9);
    if (!watcherSleeps_) return;
    const std::scoped_lock lock(mutex_);
    wakeUp_.notify_one();
}

void Runtime::stopWatch() {
    deadline_.store(0, std::memory_order_relaxed);
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

bool Runtime::evaluate(Library library, JS::MutableHandleValue result) {
    const bool isPrelude = library == Library::prelude;
    JS::CompileOptions options(context_);
    options.setFileAndLine(isPrelude ? "prelude" : "fences", 1);
    RefPtr<JS::Stencil>& stencil = libraries_[isPrelude ? 0 : 1];
    if (!stencil) {
        const std::string_view source = isPrelude ? kPrelude : kFences;
        JS::SourceText<mozilla::Utf8Unit> text;
        if (!text.init(context_, source.data(), source.size(), JS::SourceOwnership::Borrowed)) return false;
        stencil = JS::CompileGlobalScriptToStencil(context_, options, text);
        if (!stencil) return false;
    }
    const JS::InstantiateOptions instantiate(options);
    JS::RootedScript script(context_, JS::InstantiateGlobalStencil(context_, instantiate, stencil));
    return script && JS_ExecuteScript(context_, script, result);
}

bool Runtime::hasRoomFor(std::size_t more) {
    return more <= heapLimit_ && memory_->within(heapLimit_ - more);
}

bool Runtime::withinMemory() {
    if (!memory_->withinForNow(heapLimit_)) excess_ = Excess::memory;
    return excess_ == Excess::none;
}

bool Runtime::onInterrupt(JSContext* cx) {
    auto& runtime = *static_cast<Runtime*>(JS_GetContextPrivate(cx));
    const std::int64_t deadline = runtime.deadline_.load(std::memory_order_relaxed);
    if (deadline == 0) return true;
    if (steadyNow() > deadline)
        runtime.excess_ = Excess::time;
    else if (!runtime.hasRoomFor(0))
        runtime.excess_ = Excess::memory;
    // False ends the program, which cannot catch this.
    return runtime.excess_ == Excess::none;
}

}  // namespace rtsg::script
