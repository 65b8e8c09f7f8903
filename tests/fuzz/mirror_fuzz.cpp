// Feeds arbitrary bytes to everything that reads a mirror's messages: each of its types with a right prologue and what
// follows as it comes; what is accepted is written and read again the same. Texts of commands go to a player of a log,
// whose clock stays within the log; questions about hashes are answered about a small scene, and answers taken; parts
// of it that hellos ask for, regions too, are made.
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include <unistd.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/log_player.h>
#include <rtsg/sync/log_recorder.h>

#include "edits/questions.h"
#include "edits/upstream.h"
#include "parts/part.h"
#include "sockets/message.h"

namespace {

using namespace rtsg;
using mirror::Message;

void expect(bool condition) {
    if (!condition) std::abort();
}

const Scene& smallScene() {
    static const std::unique_ptr<Scene> scene = [] {
        auto created = std::make_unique<Scene>();
        Diagnostics diagnostics;
        (void)loadText(*created, "#X3D V4.0 utf8\nDEF A Transform { children [ DEF B Shape { geometry Box { } } ] }\n",
                       diagnostics);
        created->newFrame(0);
        return created;
    }();
    return *scene;
}

/// Twenty states in a second, from memory after the first time.
LogPlayer& player() {
    static const std::unique_ptr<LogPlayer> player = [] {
        const auto file = std::filesystem::temp_directory_path() / ("fuzz-" + std::to_string(::getpid()) + ".rlog");
        {
            Scene scene;
            const NodeId node = scene.createNode(x3d::Transform::type);
            auto log = *LogRecorder::start(scene, file, {});
            for (int i = 0; i < 20; ++i) {
                (void)scene.set(node, x3d::Transform::translation, Vec3f(float(i)));
                scene.newFrame(i / 20.0);
            }
            expect(log->stop().has_value());
        }
        auto opened = *LogPlayer::open(file);
        std::filesystem::remove(file);
        return opened;
    }();
    return *player;
}

void command(const std::string& text) {
    LogPlayer& p = player();
    const auto status = p.command(text);
    expect(status ? !status->empty() && status->front() == '{' : !status.error().text.empty());
    (void)p.advance(0.02);
    expect(p.time() >= 0 && p.time() <= p.length());
    expect(p.rate() > 0 && p.rate() <= 1000);
    expect(p.scene().sequence() >= 1);
}

template <class T>
void sameAgain(const T& first, const auto& write, const auto& read) {
    ByteBuffer bytes, again;
    write(first, bytes);
    wire::Reader in(bytes.bytes());
    expect(mirror::readPrologue(in).has_value());
    T second;
    expect(read(second, in));
    write(second, again);
    expect(bytes.size() == again.size() && std::memcmp(bytes.bytes().data(), again.bytes().data(), bytes.size()) == 0);
}

void words(wire::Reader in, Message type) {
    mirror::Words given;
    if (type == Message::control ? !given.readControl(in) : !given.read(in)) return;
    if (type == Message::control) command(given.text);
    sameAgain(
        given, [type](const mirror::Words& w, ByteBuffer& out) { w.write(out, type); },
        [](mirror::Words& w, wire::Reader& again) { return w.read(again); });
}

/// A part of the small scene, as a server follows it: from scratch, then a step in which nothing happens.
void part(const mirror::Wishes& wishes) {
    if (!wishes.partial()) return;
    if (const auto refusal = MirrorPart::refusalOf(wishes)) return expect(!refusal->empty());
    MirrorPart part(wishes);
    SpatialIndex index;
    if (part.region()) {
        expect(part.region()->radius > 0 && part.region()->margin >= 0);
        index.coverRadius(part.region()->radius);
        expect(index.follow(smallScene(), nullptr));
    }
    const auto first = part.follow(smallScene(), nullptr, &index);
    expect(first.has_value() && (*first)->hash == part.scene().hash());
    const auto again = part.follow(smallScene(), nullptr, &index);
    expect(again.has_value() && (*again)->changes.empty());
}

void hello(wire::Reader in) {
    mirror::Hello given;
    if (!given.read(in)) return;
    sameAgain(
        given, [](const mirror::Hello& h, ByteBuffer& out) { h.write(out); },
        [](mirror::Hello& h, wire::Reader& again) { return h.read(again); });
    part(given.wishes);
}

void verdict(wire::Reader in) {
    const auto session = in.number<std::uint64_t>();
    mirror::Verdict given;
    if (!given.read(in)) return;
    sameAgain(
        given, [session](const mirror::Verdict& v, ByteBuffer& out) { v.write(out, session); },
        [](mirror::Verdict& v, wire::Reader& again) {
            again.number<std::uint64_t>();
            return v.read(again);
        });
}

void question(wire::Reader in, Message type) {
    ByteBuffer out;
    ChangeSet set;
    in.number<std::uint64_t>();
    if (type == Message::doubt) (void)mirror::answerDoubt(smallScene(), 1, in, out);
    if (type == Message::inspect) (void)mirror::answerInspect(smallScene(), 1, in, out);
    if (type == Message::want) (void)mirror::answerWant(smallScene(), in, set);
    expect(out.size() <= mirror::kLongestAnswer + 1024);
}

void answer(wire::Reader in, Message type) {
    mirror::Bisection bisection;
    ByteBuffer out;
    bisection.begin(1, {}, out);
    in.number<std::uint64_t>();
    in.number<std::uint64_t>();
    (void)(type == Message::digest ? bisection.digest(smallScene(), in, out)
                                   : bisection.anatomy(smallScene(), in, out));
}

void submission(wire::Reader in) {
    std::uint64_t numbers[4];
    if (!mirror::read(in, numbers)) return;
    mirror::Assembly assembly;
    const char* problem = nullptr;
    const std::span<const std::byte> rest(reinterpret_cast<const std::byte*>(in.at), in.left());
    (void)assembly.add(numbers[1], numbers[2], numbers[3], rest, problem);
    expect(assembly.bytes.size() <= mirror::kLongestSubmission);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
/// The first byte is the type; the prologue before it is a right one.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const auto bytes = std::as_bytes(std::span(data, size));
    wire::Reader whole(bytes);
    (void)mirror::readPrologue(whole);
    if (size == 0) return 0;
    const auto type = static_cast<Message>(data[0] % 24);
    const wire::Reader in(bytes.subspan(1));
    switch (type) {
        case Message::hello:
            hello(in);
            break;
        case Message::doubt:
        case Message::inspect:
        case Message::want:
            question(in, type);
            break;
        case Message::submit:
            submission(in);
            break;
        case Message::control:
        case Message::reply:
            words(in, type);
            break;
        case Message::digest:
        case Message::anatomy:
            answer(in, type);
            break;
        case Message::verdict:
            verdict(in);
            break;
        default:
            break;
    }
    return 0;
}
