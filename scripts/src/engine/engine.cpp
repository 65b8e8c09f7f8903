// Runs the programs of Script nodes in SpiderMonkey: compiles, calls, and turns exceptions into diagnostics.
#include "engine.h"

#include <algorithm>
#include <bit>
#include <optional>
#include <unordered_map>

#include <fmt/format.h>

#include <rtsg/core/never_destroyed.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/web_address.h>
#include <rtsg/core/x3d.h>
#include <rtsg/scripts/run_scripts.h>

#include "runtime.h"
#include "syntax.h"

namespace rtsg {

using namespace script;

namespace {

/// Scripts that write to each other's fields directly nest; beyond this it is a circle.
constexpr int kMaximumDepth = 16;
/// So many bytes of a failing program's message, and so many of the promises that a call leaves rejected, are reported.
constexpr std::size_t kLongestMessage = 1000, kMaxRejections = 10;

/// The program's text, from the first url that has one; `problem` says why there is none.
std::string sourceOf(const Scene& scene, const Node& node, const ScriptOptions& options, std::string& problem) {
    for (const String& url : node.get(x3d::Script::url)) {
        const std::string_view text = url.view();
        const auto start = text.find_first_not_of(" \t\r\n");
        if (start == text.npos) continue;
        if (const auto program = programInUrl(text)) return std::string(*program);
        static const auto& nothing = neverDestroyed([] { return Resources(); });
        const Resources& resources = options.resources ? *options.resources : nothing;
        auto file = resources.open(scene, node, x3d::Script::url.index, text.substr(start));
        auto program = file ? file->read() : Result<std::string>(std::unexpected(file.error()));
        if (program) return std::move(*program);
        problem += (problem.empty() ? "" : "; ") + program.error().text;
        problem += hintForProgram(text);
    }
    if (problem.empty()) problem = "no program in its url";
    return {};
}

/// A file's name as SpiderMonkey 102 (const char*) or 128 (an object) has it.
template <class Name>
std::string_view textOf(const Name& name) {
    if constexpr (requires { name.c_str(); })
        return name.c_str();
    else
        return name;
}

}  // namespace

struct ScriptEngine::State {
    struct Program {
        /// Its global object, from which all else of it hangs, and the controller's function for events.
        struct Roots {
            JS::PersistentRootedObject global;
            JS::PersistentRootedValue event;
            Roots(JSContext* cx, JSObject* created) : global(cx, created), event(cx) {}
        };
        std::unique_ptr<Roots> roots;
        bool canRun = false;  // has a controller, and has not been ended
        bool eventsPending = false;
        double preparedAt = -kNever;
        bool stale = false;  // its url has changed
        Array<String> url;   // which it came from
        bool load = true;    // as its Script said
        /// On the scene's clock: when its file was read last, and since when it is read every `refreshed` seconds.
        double readAt = 0, refreshedSince = 0, refreshed = 0;
        bool hasInitialize = false, hasPrepareEvents = false, hasEventsProcessed = false;
        /// Which fields have a function that takes their events; of those from 64 on, sorted. The controller calls
        /// each by its place among them.
        std::uint64_t handled = 0;
        std::vector<FieldIndex> handledToo;

        void addHandler(FieldIndex field) {
            if (field < 64)
                handled |= std::uint64_t{1} << field;
            else
                handledToo.push_back(field);
        }
        /// The number by which the controller calls the field's function, or -1.
        std::int32_t handlerOf(FieldIndex field) const {
            if (field < 64) {
                const std::uint64_t own = std::uint64_t{1} << field;
                return handled & own ? std::popcount(handled & (own - 1)) : -1;
            }
            const auto found = std::ranges::lower_bound(handledToo, field);
            if (found == handledToo.end() || *found != field) return -1;
            return std::popcount(handled) + static_cast<std::int32_t>(found - handledToo.begin());
        }

        /// It never runs again; its memory goes with the next collection.
        void end() {
            canRun = false;
            handled = 0;
            handledToo.clear();
            roots.reset();
        }
    };

    Scene& scene;
    ScriptOptions options;
    std::shared_ptr<Runtime> runtime;
    bool refused = false;  // the engine does not start
    std::unordered_map<std::uint32_t, Program> programs;

    /// The time that calls have taken since the scene's clock was set to `at`, in nanoseconds.
    struct Spent {
        double at = -kNever;
        std::int64_t calls = 0;   // by the wall's clock, one after the other
        std::int64_t thread = 0;  // the thread's own time at the first one
        bool over = false, before = false;
    };
    Spent spent;

    JSContext* context() const { return runtime->context(); }

    /// Programs that each keep to their limit may still be without number: those that make others, those of a hundred
    /// nodes that each loop. Calls of one frame share a time of their own, less of it if the frame before used it up.
    /// Both clocks have to say so: the wall's goes on while others have the machine, the thread's while other things
    /// than programs run, and asking that one costs as much as a short call.
    double frameLimit() const {
        constexpr double kCalls = 5;
        return (spent.before ? 1 : kCalls) * options.timeLimit;
    }
    bool mayCall() {
        if (spent.at != scene.now()) spent = {scene.now(), 0, ownTime(), false, spent.over};
        const auto limit = static_cast<std::int64_t>(frameLimit() * 1e9);
        return spent.calls <= limit || ownTime() - spent.thread <= limit;
    }
    void refuseCall(Cascade* cascade, NodeId id) {
        if (!std::exchange(spent.over, true))
            warn(cascade, id,
                 fmt::format("stopped: scripts ran longer than {} s in one frame; it and those whose turn comes after "
                             "it are not called again",
                             frameLimit()));
    }

    /// The pending exception as a sentence with the script's own line; clears it.
    std::string takeError() {
        JSContext* cx = context();
        switch (runtime->takeExcess()) {
            case Runtime::Excess::time:
                return fmt::format("stopped: it ran longer than {} s", options.timeLimit);
            case Runtime::Excess::memory:
                return fmt::format("stopped: out of memory, scripts may hold {} MiB", options.heapLimit >> 20);
            case Runtime::Excess::process:
                return "stopped: the process ends";
            case Runtime::Excess::none:
                break;
        }
        if (!JS_IsExceptionPending(cx)) return "stopped: out of memory";
        JS::ExceptionStack stack(cx);
        if (!JS::StealPendingExceptionStack(cx, &stack)) return "an unknown error";
        return describe(stack);
    }

    std::string describe(const JS::ExceptionStack& stack) const {
        JSContext* cx = context();
        JS::ErrorReportBuilder report(cx);
        if (!report.init(cx, stack, JS::ErrorReportBuilder::NoSideEffects)) {
            JS_ClearPendingException(cx);
            return "an unknown error";
        }
        const unsigned line = lineIn(stack, report.report());
        std::string text = report.toStringResult() ? report.toStringResult().c_str() : "an unknown error";
        if (text.size() > kLongestMessage) {
            std::size_t end = kLongestMessage;
            while ((text[end] & 0xC0) == 0x80) --end;  // not within a character
            text = text.substr(0, end) + "...";
        }
        return line > 0 ? fmt::format("line {}: {}", line, text) : text;
    }

    /// The line of the script that made the prelude throw: the first frame that is not the prelude's. No code of the
    /// program runs here, whatever it has made of `stack`.
    unsigned lineIn(const JS::ExceptionStack& stack, const JSErrorReport* report) const {
        JSContext* cx = context();
        if (report->filename && textOf(report->filename) == "script") return report->lineno;
        JS::RootedObject thrown(cx, stack.exception().isObject() ? &stack.exception().toObject() : nullptr);
        JS::RootedObject saved(cx, thrown ? JS::ExceptionStackOrNull(thrown) : nullptr);
        if (!saved) saved = stack.stack();
        JS::RootedString text(cx);
        JS::RootedValue value(cx);
        std::string frames;
        if (!saved || !JS::BuildStackString(cx, nullptr, saved, &text)) {
            JS_ClearPendingException(cx);
            return 0;
        }
        value.setString(text);
        if (!stringFrom(cx, value, frames)) {
            JS_ClearPendingException(cx);
            return 0;
        }
        const auto at = frames.find("@script:");
        return at == frames.npos ? 0 : static_cast<unsigned>(std::strtoul(frames.c_str() + at + 8, nullptr, 10));
    }

    enum class RealmKind { program, library };
    /// Runs `body` (returns false with an exception pending) as one call, and then the jobs that it leaves; reports
    /// errors. Runs in the realm of the program, or briefly in that of the library, whose functions go into it.
    template <class Body>
    bool enter(Cascade* cascade, const Node& node, Program& program, const Body& body,
               RealmKind where = RealmKind::program) {
        if (runtime->depth >= kMaximumDepth) {
            warn(cascade, node.id(), "scripts write to each other in a circle: cut off");
            return false;
        }
        // The program may destroy its own node, and so itself: nothing of either is used after the body.
        const NodeId id = node.id();
        if (runtime->depth == 0 && !mayCall()) {
            refuseCall(cascade, id);
            program.end();
            return false;
        }
        JS::RootedObject global(context(), program.roots->global);
        Call call{scene, cascade, options, scene.now(), global, id};
        if (runtime->depth == 0 && !runtime->startWatch(options.timeLimit)) return false;
        ++runtime->depth;
        Call* outer = std::exchange(runtime->current, &call);
        const JSAutoRealm realm(context(), where == RealmKind::program ? global.get() : runtime->library());
        const Jobs::Mark mark = runtime->jobs().mark();
        const bool ok = body();
        bool goesOn = (ok || report(cascade, id)) && runJobs(cascade, id, global, mark);
        const std::int64_t end = steadyNow();
        goesOn = goesOn && (runtime->withinMemory(end) || report(cascade, id));
        reportRejections(cascade, id, mark);
        runtime->jobs().endCall(mark);
        // One that runs over its limit is ended itself: the others are not to pay for the rest of it.
        if (--runtime->depth == 0)
            spent.calls += std::min(runtime->stopWatch(end), static_cast<std::int64_t>(options.timeLimit * 1e9));
        runtime->current = outer;
        return ok && goesOn;
    }

    /// Warns about a node that still exists; without a cascade, about what shutdown() does.
    void warn(Cascade* cascade, NodeId id, const std::string& text) const {
        const Node* alive = scene.find(id);
        if (!alive) return;
        if (cascade)
            cascade->warn(*alive, text);
        else
            ScriptPrograms::warn(scene, *alive, text);
    }

    /// Reports the pending exception; false if the program has been ended.
    bool report(Cascade* cascade, NodeId id) {
        const bool fatal = !JS_IsExceptionPending(context());  // time or memory: it would only happen again
        const std::string error = takeError();
        warn(cascade, id, fatal ? error + "; it is not called again" : error);
        if (!fatal) return true;
        if (const auto found = programs.find(id.value); found != programs.end()) found->second.end();
        return false;
    }

    /// The jobs of promises that the call has added, and those that they add. False if the program has been ended.
    bool runJobs(Cascade* cascade, NodeId id, JS::HandleObject global, const Jobs::Mark& mark) {
        JSContext* cx = context();
        JS::RootedObject job(cx);
        JS::RootedValue function(cx), controller(cx), ignored(cx);
        for (std::size_t taken = 0; (job = runtime->jobs().next(mark, taken));) {
            function.setObject(*job);
            bool done = JS_CheckForInterrupt(cx) &&
                        JS::Call(cx, JS::UndefinedHandleValue, function, JS::HandleValueArray::empty(), &ignored);
            controller.set(JS::GetReservedSlot(global, Runtime::kControllerSlot));
            if (done && controller.isObject()) {
                JS::RootedObject object(cx, &controller.toObject());
                done = JS_CallFunctionName(cx, object, "flush", JS::HandleValueArray::empty(), &ignored);
            }
            if (!done && !report(cascade, id)) return false;
        }
        return true;
    }

    void reportRejections(Cascade* cascade, NodeId id, const Jobs::Mark& mark) {
        JSContext* cx = context();
        JS::RootedObject promise(cx);
        JS::RootedValue reason(cx);
        std::size_t reported = 0;
        for (std::size_t taken = 0; (promise = runtime->jobs().nextRejected(mark, taken)); ++reported) {
            if (reported == kMaxRejections) return warn(cascade, id, "more promises that nothing handles");
            reason = JS::GetPromiseResult(promise);
            warn(cascade, id, describe(JS::ExceptionStack(cx, reason, nullptr)) + " (a promise that nothing handles)");
        }
    }

    bool call(const Program& program, const char* function, JS::HandleValueArray arguments,
              JS::MutableHandleValue result) const {
        JS::RootedObject controller(context(),
                                    &JS::GetReservedSlot(program.roots->global, Runtime::kControllerSlot).toObject());
        return JS_CallFunctionName(context(), controller, function, arguments, result);
    }

    bool ask(const Program& program, const char* function, const std::string& name,
             JS::MutableHandleValue result) const {
        JS::RootedValueArray<1> arguments(context());
        JSString* text = JS_NewStringCopyUTF8N(context(), JS::UTF8Chars(name.data(), name.size()));
        if (!text) return false;
        arguments[0].setString(text);
        if (call(program, function, arguments, result)) return true;
        JS_ClearPendingException(context());
        return false;
    }
    bool has(const Program& program, const std::string& name) const {
        JS::RootedValue result(context());
        return ask(program, "has", name, &result) && result.isBoolean() && result.toBoolean();
    }
    /// Whether there is a function of that name, which event() calls from now on by the next number.
    bool isHandler(const Program& program, const std::string& name) const {
        JS::RootedValue result(context());
        return ask(program, "handler", name, &result) && result.isInt32() && result.toInt32() >= 0;
    }

    /// The program's controller, then the program itself.
    bool load(Program& program, const std::string& source) const {
        JSContext* cx = context();
        JS::RootedObject global(cx, program.roots->global), controller(cx, runtime->newController(global));
        JS::RootedValue event(cx), ignored(cx);
        if (!controller || !JS_GetProperty(cx, controller, "event", &event)) return false;
        program.roots->event = event;
        program.canRun = true;
        if (!runtime->run(source)) return false;
        // Top-level statements may have assigned to fields.
        return JS_CallFunctionName(cx, controller, "flush", JS::HandleValueArray::empty(), &ignored);
    }

    static bool hasNewUrl(const Program& program, const Node& node) {
        const Array<String>& url = node.get(x3d::Script::url);
        if (program.load != node.get(x3d::Script::load)) return true;
        return !program.url.sameStorage(url) && Value(program.url) != Value(url);
    }

    /// When its file is to be read again, as those of Inlines are (19775-1, 9.3.2).
    static double nextRefresh(const Program& program, const Node& node) {
        const double every = node.get(x3d::Script::autoRefresh).seconds, next = program.readAt + every;
        if (!(every > 0) || !program.load ||
            next - program.refreshedSince > node.get(x3d::Script::autoRefreshTimeLimit).seconds)
            return kNever;
        const bool leadsToFile = std::ranges::any_of(program.url, [](const String& url) {
            return url.view().find_first_not_of(" \t\r\n") != std::string_view::npos && !programInUrl(url.view());
        });
        return leadsToFile ? next : kNever;
    }
    /// Marks the program as old if its file is due to be read again, and can be: else it goes on until it can.
    void refresh(const Cascade& cascade, const Node& node) {
        const auto found = programs.find(node.id().value);
        if (found == programs.end()) return;
        if (const double every = node.get(x3d::Script::autoRefresh).seconds; found->second.refreshed != every) {
            found->second.refreshed = every;
            found->second.readAt = found->second.refreshedSince = cascade.now();
        }
        if (nextRefresh(found->second, node) > cascade.now()) return;
        found->second.readAt = cascade.now();
        std::string problem;
        found->second.stale |= !sourceOf(scene, node, options, problem).empty();
    }

    /// Forgets the program; its shutdown() is called first, and has no outputs.
    void shutDown(NodeId id) {
        const auto found = programs.find(id.value);
        if (found == programs.end()) return;
        const Node* node = scene.find(id);
        Program program = std::move(found->second);
        programs.erase(found);
        if (!program.canRun || !node || !runtime->onOwnThread()) return;
        enter(nullptr, *node, program, [&] {
            JS::RootedValue ignored(context());
            return call(program, "shutdown", JS::HandleValueArray::empty(), &ignored);
        });
    }

    /// The node's program, compiled and initialised; null if it has none that can run.
    Program* ready(Cascade& cascade, const Node& node) {
        double refreshedSince = cascade.now();
        // Not while programs run: one may have changed the url of another on the stack.
        if (const auto old = programs.find(node.id().value); old != programs.end()) {
            const bool isOld = old->second.stale || hasNewUrl(old->second, node);
            if (!isOld || (runtime && runtime->depth > 0)) return old->second.canRun ? &old->second : nullptr;
            if (!hasNewUrl(old->second, node)) refreshedSince = old->second.refreshedSince;
            shutDown(node.id());
        }
        Program& program = programs[node.id().value];
        program.refreshedSince = refreshedSince;
        program.refreshed = node.get(x3d::Script::autoRefresh).seconds;
        create(cascade, node, program);
        const auto still = programs.find(node.id().value);
        return still != programs.end() && still->second.canRun ? &still->second : nullptr;
    }

    void create(Cascade& cascade, const Node& node, Program& program) {
        if (Runtime::hasEnded()) return;
        if (!runtime && !refused) {
            runtime = Runtime::ofThisThread(options.heapLimit);
            refused = !runtime;
        }
        if (refused) return cascade.warn(node, Runtime::whyNone());
        if (runtime->depth == 0 && !mayCall()) return refuseCall(&cascade, node.id());
        std::string problem;
        program.url = node.get(x3d::Script::url);
        program.load = node.get(x3d::Script::load);
        program.readAt = cascade.now();
        if (program.url.empty() || !program.load) return;
        const std::string source = sourceOf(scene, node, options, problem);
        if (source.empty()) {
            if (!problem.empty()) cascade.warn(node, problem);
            return;
        }
        JS::RootedObject global(context(), runtime->newGlobal(node.id()));
        if (!global) return cascade.warn(node, "out of memory for scripts");
        program.roots = std::make_unique<Program::Roots>(context(), global);
        const bool loaded = enter(&cascade, node, program, [&] { return load(program, source); });
        if (!loaded) return program.end();
        enter(&cascade, node, program, [&] {
            program.hasPrepareEvents = has(program, "prepareEvents");
            program.hasEventsProcessed = has(program, "eventsProcessed");
            const std::vector<FieldDef>& fields = node.type().fields;
            for (std::size_t i = 0; i < fields.size(); ++i) {
                const FieldDef& def = fields[i];
                std::string name = def.name;
                if (def.access == Access::inputOutput && has(program, "set_" + def.name)) name = "set_" + def.name;
                if (!def.hidden && def.writable() && isHandler(program, name))
                    program.addHandler(static_cast<FieldIndex>(i));
            }
            program.hasInitialize = has(program, "initialize");
            return true;
        });
        if (program.canRun && program.hasInitialize) run(cascade, node, program, "initialize");
    }

    /// Calls a function of the program without arguments.
    void run(Cascade& cascade, const Node& node, Program& program, const char* name) {
        enter(&cascade, node, program, [&] {
            JS::RootedValueArray<1> arguments(context());
            JS::RootedValue ignored(context());
            arguments[0].setString(JS_NewStringCopyZ(context(), name));
            return call(program, "call", arguments, &ignored);
        });
    }
};

namespace {

class EcmaScript final : public ScriptLanguage {
  public:
    std::unique_ptr<ScriptPrograms> makePrograms(Scene& scene, const ScriptOptions& options) const override {
        return std::make_unique<ScriptEngine>(scene, options);
    }
    std::optional<SyntaxFault> checkSyntax(const std::string& source) const override {
        return script::syntaxFault(source);
    }
};

}  // namespace

std::shared_ptr<const ScriptLanguage> ecmaScript() {
    static const auto& language = neverDestroyed([] { return std::make_shared<const EcmaScript>(); });
    return language;
}

ScriptEngine::ScriptEngine(Scene& scene, const ScriptOptions& options)
    : state_(new State{.scene = scene, .options = options, .runtime = {}, .programs = {}, .spent = {}}) {}

ScriptEngine::~ScriptEngine() {
    // On a foreign thread the roots cannot be given back: they stay with the context, which is left alone too.
    if (state_->runtime && !state_->runtime->onOwnThread())
        for (auto& [id, program] : state_->programs) (void)program.roots.release();
}

void ScriptEngine::onEvent(Cascade& cascade, const Node& node, FieldIndex field, EventValue value) {
    State& s = *state_;
    if (field == x3d::Script::url.index) {
        // The cascade wakes the node; onTime loads the new program.
        if (const auto old = s.programs.find(node.id().value); old != s.programs.end()) old->second.stale = true;
        return;
    }
    State::Program* program = s.ready(cascade, node);
    if (!program) return;
    program->eventsPending = true;
    // One that is being loaded, and has had another write to it meanwhile, handles nothing yet.
    const std::int32_t handler = program->handlerOf(field);
    if (handler < 0) return;
    const auto call = [&] {
        JSContext* cx = s.context();
        JS::RootedValueArray<4> arguments(cx);
        arguments[0].setInt32(handler);
        arguments[1].setInt32(static_cast<int>(value.type()));
        arguments[3].setNumber(cascade.now());
        JS::RootedValue event(cx, program->roots->event), ignored(cx);
        return toScript(cx, value.type(), value.storage(), arguments[2]) &&
               JS::Call(cx, JS::UndefinedHandleValue, event, arguments, &ignored);
    };
    s.enter(&cascade, node, *program, call, State::RealmKind::library);
}

double ScriptEngine::onTime(Cascade& cascade, const Node& node, ScriptPhase phase) {
    State& s = *state_;
    const NodeId id = node.id();
    if (phase == ScriptPhase::run) s.refresh(cascade, node);
    const auto later = [&] {
        const auto still = s.programs.find(id.value);
        return still == s.programs.end() ? kNever : State::nextRefresh(still->second, node);
    };
    const auto known = s.programs.find(id.value);
    const bool runs = known != s.programs.end() && !known->second.stale && !State::hasNewUrl(known->second, node);
    if (runs && phase == ScriptPhase::initialize) return kNever;
    if (!runs && phase == ScriptPhase::prepare) return kNever;
    State::Program* program = runs ? (known->second.canRun ? &known->second : nullptr) : s.ready(cascade, node);
    if (phase == ScriptPhase::initialize) return cascade.now();
    if (!program) return later();
    const bool everyFrame = program->hasPrepareEvents;
    bool ranNow = !runs;
    if (program->preparedAt != cascade.now() && everyFrame) {
        program->preparedAt = cascade.now();
        s.run(cascade, node, *program, "prepareEvents");
        const auto still = s.programs.find(id.value);
        if (still == s.programs.end() || !still->second.canRun) return later();
        program = &still->second;
        ranNow = true;
    }
    if (phase == ScriptPhase::prepare) return cascade.now();
    if (std::exchange(program->eventsPending, false) && program->hasEventsProcessed) {
        s.run(cascade, node, *program, "eventsProcessed");
        ranNow = true;
    }
    if (!ranNow) return everyFrame ? cascade.now() : later();
    // One that has set its own url starts anew with the next frame.
    const auto still = s.programs.find(id.value);
    const bool restarts = still != s.programs.end() && s.hasNewUrl(still->second, node);
    return everyFrame || restarts ? cascade.now() : later();
}

void ScriptEngine::findHeld(const std::vector<NodeId>& nodes,
                            const std::function<void(NodeId script, NodeId held)>& visit) {
    State& s = *state_;
    if (!s.runtime || !s.runtime->onOwnThread() || s.runtime->depth > 0 || Runtime::hasEnded()) return;
    std::vector<NodeId> asked;
    for (const auto& [id, program] : s.programs)
        if (program.canRun) asked.push_back(NodeId{id});
    std::ranges::sort(asked);
    const auto ask = [&](NodeId script, const char* function, JS::MutableHandleValue answer) {
        const State::Program& program = s.programs.at(script.value);
        JS::RootedObject global(s.context(), program.roots->global);
        Call call{s.scene, nullptr, s.options, s.scene.now(), global, script, &nodes};
        Call* outer = std::exchange(s.runtime->current, &call);
        const JSAutoRealm realm(s.context(), global);
        const bool ok = s.call(program, function, JS::HandleValueArray::empty(), answer);
        if (!ok) JS_ClearPendingException(s.context());
        s.runtime->current = outer;
        return ok;
    };
    JS::RootedValue answer(s.context());
    const auto holdsAll = [&](NodeId script) {  // for all that is known: memory has run out
        for (const NodeId node : nodes) visit(script, node);
    };
    std::erase_if(asked, [&](NodeId id) {
        if (ask(id, "loosen", &answer) && answer.isInt32()) return answer.toInt32() == 0;
        holdsAll(id);
        return false;
    });
    if (asked.empty()) return;
    s.runtime->collect();
    for (const NodeId id : asked) {
        Value held;
        if (ask(id, "tighten", &answer) && fromScript(s.context(), FieldType::MFNode, answer, held))
            for (const NodeId node : held.as<Array<NodeId>>()) visit(id, node);
        else
            holdsAll(id);
    }
}

void ScriptEngine::forget(NodeId id) {
    state_->shutDown(id);
}

void ScriptEngine::forgetAll() {
    std::vector<NodeId> nodes;
    for (const auto& [id, program] : state_->programs) nodes.push_back(NodeId{id});
    std::ranges::sort(nodes);
    for (const NodeId id : nodes) state_->shutDown(id);
}

}  // namespace rtsg
