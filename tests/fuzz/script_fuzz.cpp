// Runs programs made of arbitrary bytes in a Script that may write to everything: whatever they do, frames end, the
// scene goes on, what follows it agrees, other scenes' programs compute what they did, and two runs are equal.
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <span>
#include <vector>

#include <rtsg/core/replica.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/scripts/run_scripts.h>

#include "script_grammar.h"

namespace {

using rtsg::Scene;

constexpr const char* kSurroundings = R"(#X3D V4.0 utf8
PROFILE Full
PROTO P [ inputOutput SFFloat size 1 ] { Transform { children Shape { geometry Box { } } } }
DEF C TimeSensor { loop TRUE }
DEF I PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 1 1 1 ] }
DEF T Transform { children [ DEF G Group { } Viewpoint { } Switch { } P { } ] }
DEF M Transform { }
DEF S Script {
  directOutput TRUE
  inputOnly SFFloat go inputOutput SFVec3f v 1 2 3 inputOutput SFInt32 n 0 inputOutput SFFloat f 0 inputOutput SFString s "s"
  inputOutput SFNode node NULL inputOutput MFNode nodes [ ] inputOutput MFVec3f vs [ 1 2 3, 4 5 6 ] inputOutput SFMatrix4f m
  1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 inputOutput SFImage image 1 1 1 0xFF outputOnly SFColor color outputOnly MFColor colors
  outputOnly MFString strings inputOutput MFBool bools [ TRUE ] inputOutput MFImage images [ ] inputOutput SFRotation rotation 0 0 1 0
}
DEF O Script { directOutput TRUE inputOutput SFVec3f v 0 0 0 url "ecmascript: function set_v(x) { v = x.negate(); }" }
DEF W Script { inputOnly SFFloat set_fraction outputOnly SFFloat out url "ecmascript: function set_fraction(x) { out = x; }" }
ROUTE C.fraction_changed TO I.set_fraction
ROUTE C.fraction_changed TO S.go
ROUTE C.fraction_changed TO W.set_fraction
ROUTE I.value_changed TO M.translation
ROUTE S.v TO O.v
)";

void require(bool holds, const char* what, const std::string& program) {
    if (holds) return;
    std::fprintf(stderr, "VIOLATED: %s\n----\n%s\n", what, program.c_str());
    std::abort();
}

rtsg::ScriptOptions options(std::string& printed) {
    rtsg::ScriptOptions options;
    options.timeLimit = .03;
    options.heapLimit = std::size_t{64} << 20;
    options.print = [&printed](std::string_view text) {
        if (printed.size() < 100'000) printed += text;
    };
    return options;
}

/// A program in a scene of its own, which keeps the engine of this thread running, and which no other can reach.
class Neighbour {
  public:
    Neighbour() {
        rtsg::ScriptOptions patient = options(printed_);
        patient.timeLimit = 2;  // collecting what others left may fall into its time
        rtsg::runScripts(scene_, std::move(patient));
        rtsg::Diagnostics diagnostics;
        (void)rtsg::loadText(scene_, R"(#X3D V4.0 utf8
PROFILE Full
DEF N Script { inputOnly SFVec3f go outputOnly SFVec3f turned outputOnly MFFloat all url "ecmascript: var seen = new MFFloat();
  function go(p) { seen[3] = p.x; all = seen; turned = new SFRotation(0, 0, 1, Math.PI / 2).multVec(p).add(SFVec3f(0, 0, [1, 2].map(i => i * i).reduce((a, b) => a + b))); }" }
)",
                             diagnostics);
    }

    bool computes() {
        const rtsg::NodeId script = scene_.findName("N");
        const rtsg::NodeType& type = scene_.node(script).type();
        const auto x = static_cast<float>(++frames_ % 1000);
        (void)scene_.sendEvent(script, type.find("go"), rtsg::Value(rtsg::Vec3f(x, 0, 0)));
        scene_.newFrame(frames_);
        const auto turned = scene_.node(script).value(type.find("turned")).as<rtsg::Vec3f>();
        const auto all = scene_.node(script).value(type.find("all")).as<rtsg::Array<float>>();
        return std::abs(turned.x) < 1e-3 && std::abs(turned.y - x) < 1e-3 && turned.z == 5 &&
               all == rtsg::Array<float>{0, 0, 0, x} && scene_.diagnostics().all().empty();
    }

  private:
    std::string printed_;
    Scene scene_;
    int frames_ = 0;
};

/// An event that the application sends still travels along a route of its own, in the next frame. Its nodes are in a
/// scope of their own, whose routes no program can list and delete.
bool stillRoutes(Scene& scene, double t) {
    namespace x3d = rtsg::x3d;
    const rtsg::NodeId scope = scene.createNode(x3d::Group::type);
    const rtsg::NodeId from = scene.createNode(x3d::Transform::type, scope);
    const rtsg::NodeId to = scene.createNode(x3d::Transform::type, scope);
    scene.hold(scope);
    scene.hold(from);
    scene.hold(to);
    const rtsg::FieldIndex field = x3d::Transform::translation.index;
    const rtsg::Vec3f value(1, 2, 3);
    if (!scene.addRoute(from, field, to, field) || !scene.sendEvent(from, field, rtsg::Value(value))) return false;
    scene.newFrame(t);
    return scene.now() == t && scene.find(to) && scene.node(to).get(x3d::Transform::translation) == value;
}

struct Outcome {
    std::vector<std::string> frames;  // hashes
    std::string printed, problems;
    bool complete = true;  // of what was reported nothing was left out
    bool operator==(const Outcome&) const = default;
};

Outcome run(const std::string& program) {
    constexpr int kFrames = 4;
    Outcome outcome;
    {
        Scene scene;
        rtsg::runScripts(scene, options(outcome.printed));
        rtsg::Diagnostics diagnostics;
        require(rtsg::loadText(scene, kSurroundings, diagnostics) && diagnostics.errors() == 0, "the surroundings load",
                program);
        rtsg::Replica replica(scene);
        const rtsg::NodeId script = scene.findName("S");
        const rtsg::Array<rtsg::String> url{rtsg::String("ecmascript:" + program)};
        require(scene.setField(script, rtsg::x3d::Script::url.index, rtsg::Value(url)).has_value(), "url is set",
                program);
        for (int frame = 1; frame <= kFrames; ++frame) {
            scene.newFrame(frame * .25);
            require(scene.now() == frame * .25, "the clock goes on", program);
            outcome.frames.push_back(scene.hash().hex());
        }
        Scene copy;
        require(copy.apply(std::make_shared<const rtsg::ChangeSet>(scene.snapshot())).has_value(),
                "a snapshot is applied", program);
        require(copy.hash() == scene.hash(), "a snapshot has the state's hash", program);
        replica.drain();
        require(replica.attached() && replica.scene().hash() == scene.hash(), "a replica follows", program);
        require(stillRoutes(scene, 2), "another node's route works while programs run", program);
        rtsg::ScriptOptions off = options(outcome.printed);
        off.enabled = false;
        scene.setScriptOptions(std::move(off));
        require(stillRoutes(scene, 3), "another node's route works when programs have ended", program);
        for (const rtsg::Diagnostic& d : scene.diagnostics().all()) outcome.problems += d.text + "\n";
        outcome.complete = scene.diagnostics().dropped() == 0;
    }
    return outcome;
}

bool mentions(const std::string& text, std::initializer_list<const char*> words) {
    for (const char* word : words)
        if (text.find(word) != std::string::npos) return true;
    return false;
}

/// Whether a message depends on the machine and not on the program: when it was stopped, how deep it got, and whether
/// the engine had compiled the place of an error, which it then describes in other words.
bool isChance(std::string program, const Outcome& outcome) {
    program.erase(0, std::string_view(rtsg::fuzz::ScriptWriter::kOpening).size());
    return !outcome.complete || mentions(outcome.problems, {"ran longer", "memory", "recursion", "can't convert"}) ||
           mentions(program, {"catch", "finally", "then(", "any("});
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    // Goes before what the engine keeps for the whole process.
    static thread_local Neighbour neighbour;
    const std::string program = rtsg::fuzz::ScriptWriter(std::span(data, size)).program();
    if (std::getenv("RTSG_FUZZ_SHOW")) std::fprintf(stderr, "%s", program.c_str());
    const Outcome first = run(program);
    if (std::getenv("RTSG_FUZZ_SHOW")) std::fprintf(stderr, "----\n%s", first.problems.c_str());
    if (!isChance(program, first)) {
        const Outcome second = run(program);
        if (!isChance(program, second))
            require(first == second, "two runs are equal", program + first.problems + second.problems);
    }
    require(neighbour.computes(), "another scene's program computes what it did", program);
    return 0;
}
